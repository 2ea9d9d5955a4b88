"""What a film makes of the indicators: rendered moves with known truth, identified, and judged by the same code.

    python benchmarks/indicators.py [--quick]

Each row is one film. The truth is the scene's own motion at 5 kHz; its accelerations are differences of places. Prints
bandwidth, and truth, error and stated standard error of each peak acceleration; then overshoot, settling time and the
error in the box. A peak of a noisy curve lies too high, a jump above the bandwidth is rounded off: the mean of the
errors over the films says which prevails. `--quick` takes two films.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from scenes import small_scene
from tagsway.indicators import indicators_of
from tagsway.model import Indicators, Settings
from tagsway.pipeline import identify
from tagsway.scene import Scene, render_scene, simulate_scene
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat

SETTINGS = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)
TRUTH_HZ = 5000.0
CAMERA = SceneCamera(width=512, height=448, distance_m=1.5, focal_px=1750.0)


def film_of(acceleration_m_s2: float, fps_hz: float, noise_grey: float, height_m: float, seed: int) -> Scene:
    """A pick and place of 0.28 m; from `height_m` on the product is above the rim of the box."""
    scene = small_scene()
    assert scene.move is not None
    move = replace(scene.move, max_acceleration_m_s2=acceleration_m_s2, pick_height_m=height_m, place_height_m=height_m)
    return small_scene(
        seed=seed,
        payload=replace(scene.payload, damping_ratio=0.06),
        move=move,
        duration_s=3.0,
        camera=CAMERA,
        picture=Picture(exposure_s=0.001, noise_grey=noise_grey, supersampling=2),
        video=VideoFormat(fps_hz=fps_hz, quality=14.0),
    )


CASES = {
    "2.75 m/s², 200 fps": (2.75, 200.0, 1.0, 0.02),
    "2.75 m/s², 200 fps, noisy": (2.75, 200.0, 6.0, 0.02),
    "5 m/s², 200 fps": (5.0, 200.0, 1.0, 0.02),
    "5 m/s², 200 fps, noisy": (5.0, 200.0, 6.0, 0.02),
    "5 m/s², 100 fps": (5.0, 100.0, 1.0, 0.02),
    "3 m/s² over the rim": (3.0, 200.0, 1.0, 0.05),
    "4 m/s² over the rim": (4.0, 200.0, 3.0, 0.05),
    "4 m/s² over the rim, 100 fps": (4.0, 100.0, 1.0, 0.05),
}


def truth_of(scene: Scene, end_s: float) -> Indicators:
    """Return the indicators of the scene's own motion, until the film's last free swing ends."""
    time = np.arange(scene.tool.start_s, end_s, 1 / TRUTH_HZ)
    motion = simulate_scene(scene, time)
    tcp, pcp = motion.tcp_m[:, [0, 2]], motion.pcp_m[:, [0, 2]]
    push = np.gradient(np.gradient(pcp, 1 / TRUTH_HZ, axis=0), 1 / TRUTH_HZ, axis=0)
    rest = motion.pivot_m[-1, [0, 2]] - [0.0, scene.payload.tag_radius_m or scene.payload.length_m]
    return indicators_of(time, tcp, pcp, push, end_s=motion.move_s[1], final_m=rest, bandwidth_hz=TRUTH_HZ)


def main() -> None:
    """Print a row a film, and the errors over all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    names = list(CASES)[:: 4 if parser.parse_args().quick else 1]
    print(f"{'film':<30}{'Hz':>5}{'x″: truth':>11}{'error':>7}{'stated':>7}{'with g':>8}{'error':>7}{'stated':>7}"
          f"{'over %':>8}{'error':>7}{'settle s':>9}{'error':>8}{'box mm':>8}{'error':>7}")  # fmt: skip
    ratios = []
    for seed, name in enumerate(names, start=1):
        scene = film_of(*CASES[name], seed)
        with tempfile.TemporaryDirectory() as folder:
            render_scene(scene, Path(folder) / "film.mp4")
            result = identify(Path(folder) / "film.mp4", SETTINGS).result
        seen = result.indicators
        assert seen is not None
        assert result.window_s is not None
        true = truth_of(scene, result.window_s[1])
        row, peaks = f"{name:<30}{seen.max_pcp_acceleration_m_s2.bandwidth_hz:>5.0f}", []
        for which in ("horizontal", "vector_with_gravity"):
            measured, known = (getattr(each.max_pcp_acceleration_m_s2, which) for each in (seen, true))
            peaks.append((measured.value - known.value) / measured.std)
            row += f"{known.value:>{11 if which == 'horizontal' else 8}.2f}{measured.value - known.value:>+7.2f}"
            row += f"{measured.std:>7.2f}"
        ratios.append(peaks)
        row += f"{true.overshoot_percent:>8.2f}{seen.overshoot_percent - true.overshoot_percent:>+7.2f}"
        row += _pair(true.settling_time_s, seen.settling_time_s, 9, 3) + _pair(true.box_error_m, seen.box_error_m, 8, 2)
        print(row, flush=True)
    mean, root = np.mean(ratios, axis=0), np.sqrt(np.mean(np.square(ratios), axis=0))
    print(f"error ÷ stated, over {len(ratios)} films: x″ mean {mean[0]:+.2f}, root mean square {root[0]:.2f}; "
          f"with gravity {mean[1]:+.2f}, {root[1]:.2f}")  # fmt: skip


def _pair(true: float | None, seen: float | None, width: int, digits: int) -> str:
    """Return truth and error; lengths in mm. Where one of them is "never", both as they are."""
    if true is None or seen is None:
        words = ["never" if value is None else f"{value:.3f}" for value in (true, seen)]
        return f"{words[0]:>{width}}{words[1]:>{digits + 5}}"
    factor = 1e3 if digits == 2 else 1.0
    return f"{factor * true:>{width}.{digits}f}{factor * (seen - true):>+{digits + 5}.{digits}f}"


if __name__ == "__main__":
    main()
