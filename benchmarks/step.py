"""What one step of a tag's alignment costs: compiled, against the same sums in numpy, with warm and with cold caches.

    python benchmarks/step.py [--calls 300] [--cold-mb 16]

A tag of 60 px, one core; the least of the calls, taken in turn. Beside a decoder the caches are rather cold. Set
OPENBLAS_NUM_THREADS=1.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tagsway.tags.refine import refine
from tagsway.tags.template import make_template

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import make_pose, photograph, see_tag
from test_tags_refine import refine_plainly

SIDE_PX, SHAPE = 60.0, (1024, 1280)
STEPS = {"at rest": ((0.0, 0.0), False), "moving": ((2.5, 0.3), False), "with the sums over blocks": ((0.0, 0.0), True)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--calls", type=int, default=300)
    parser.add_argument("--cold-mb", type=int, default=16, help="memory that is written between two calls")
    options = parser.parse_args()
    pose = make_pose((640.3, 300.8), SIDE_PX, 0.1, (0.01, 0.005))
    template = make_template("tag36h11", 0, scale_px=SIDE_PX / 2, blur_px=0.55)
    for name, (motion_px, with_blocks) in STEPS.items():
        grey = photograph(see_tag(pose, SHAPE, motion_px=motion_px), 3.0, np.random.default_rng(0))

        def step(grey=grey, motion_px=motion_px, with_blocks=with_blocks) -> None:
            refine(grey, pose, template, motion_px=motion_px, with_blocks=with_blocks)

        warm = least(step, options.calls)
        cold = least(step, options.calls // 3, touched=np.zeros(options.cold_mb << 18, np.float32))
        plain = least(lambda grey=grey, motion_px=motion_px: refine_plainly(grey, pose, template, motion_px), 10)
        print(
            f"{name}: numpy / compiled {plain / warm:.0f}, cold / warm {cold / warm:.1f} "
            f"({1e6 * plain:.0f}, {1e6 * warm:.0f} and {1e6 * cold:.0f} µs)",
            flush=True,
        )


def least(work: Callable[[], object], calls: int, *, touched: np.ndarray | None = None) -> float:
    """Return the seconds of the quickest call, with some memory written to before each."""
    taken = []
    for _ in range(calls):
        if touched is not None:
            touched += 1
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return min(taken)


if __name__ == "__main__":
    main()
