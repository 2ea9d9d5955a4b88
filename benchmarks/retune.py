"""What a corrected shaper gains, against what `identify retune` promised of it.

    python benchmarks/retune.py [--films 10]

Simulated films at 200 Hz, 0.1 mm of noise, of a payload up to 10 % off the frequency that its shaper was designed for.
Each is corrected, the corrected move is simulated for the same payload, and the share of the residual that went is held
against the promise: the error over the stated one, root mean square, is to be about 1. Ends with 1 where it is above 2.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np

from tagsway.errors import NotIdentifiableError
from test_design_loop import DESIGNED_HZ, LEVEL, LIFTED, Case

CASES = (("level", LEVEL, 0.0, "zv"), ("lifted", LIFTED, 0.0, "zv"), ("lifted, drag", LIFTED, 0.05, "zvd"))


def main() -> int:
    """Print a row for each kind of move."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=int, default=10)
    options = parser.parse_args()
    offsets = np.random.default_rng(1).uniform(-0.1, 0.1, options.films)
    worst = 0.0
    print(f"{'move':<14}{'shaper':<8}{'true gain, median':>18}{'promised':>10}{'± stated':>10}{'error/stated':>14}")
    for name, move, drag, kind in CASES:
        true, promised, stated = [], [], []
        for seed, offset in enumerate(offsets):
            case = Case(move=move, true_hz=DESIGNED_HZ * (1 + offset), drag_per_rad=drag, kind=kind)
            try:
                found, shaper = case.retune(noise_m=1e-4, seed=seed)
            except NotIdentifiableError:  # the move happens to leave nothing
                continue
            true.append(1 - case.residual_m(found.shaper) / case.residual_m(shaper))
            promised.append(found.gain.value)
            stated.append(found.gain.std)
        ratio = float(np.sqrt(np.mean(np.square(np.subtract(true, promised) / stated))))
        worst = max(worst, ratio)
        medians = [float(np.median(values)) for values in (true, promised, stated)]
        print(f"{name:<14}{kind:<8}{medians[0]:>18.3f}{medians[1]:>10.3f}{medians[2]:>10.3f}{ratio:>14.2f}", flush=True)
    return 0 if worst <= 2 else 1


if __name__ == "__main__":
    sys.exit(main())
