"""The radius of a sway from a camera that nobody calibrated: its error with the camera found from the tags' own
corners, and with a scale for each tag beside it.

    python benchmarks/camera.py [--trials 60] [--tilt 10] [--span 0.4] [--leaving 0.0] [--focal-widths 0.9 2.4]

Each trial draws a camera (1280 × 1024, tilt up to 10° about both axes, k1 to ±0.15), tags that lie up to 3 % of the
distance apart in depth and are stuck on 1° out of the plane, a move across 40 % of the image with a lift, and a sway;
the corners have 0.05 px of noise. The radius is the mean distance from tool to product.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from tagsway.camera import find_view, straighten_sightings
from tagsway.model import PlaneView, Sightings
from tagsway.tracks import join_tags

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from camera_scenes import RADIUS_M, SETTINGS, draw_lens, film


def radius_error(sightings: Sightings, view: PlaneView | None = None) -> float:
    """Return the relative error of the mean distance from tool to product."""
    track, _, _ = join_tags(sightings, SETTINGS, view=view)
    assert track.tcp is not None
    return float(np.mean(np.linalg.norm(track.pcp.position - track.tcp.position, axis=1))) / RADIUS_M - 1


def plain_scale(sightings: Sightings) -> Sightings:
    """Return sightings with every tag's sides as at the middle of its way, so that no tilt shows in them."""
    tags = tuple(
        replace(
            tag,
            corners_px=tag.centre_px[:, None] + np.median(tag.corners_px - tag.centre_px[:, None], axis=0),
        )
        for tag in sightings.tags
    )
    return replace(sightings, tags=tags)


def main() -> None:
    """Run the trials and print the errors."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--tilt", type=float, default=10.0, help="degrees, about both axes")
    parser.add_argument("--span", type=float, default=0.4, help="share of the image that the move crosses")
    parser.add_argument("--leaving", type=float, default=0.0, help="amplitude out of the plane, rad")
    parser.add_argument("--noise", type=float, default=0.05, help="of a corner, px")
    parser.add_argument("--focal-widths", type=float, nargs=2, default=(0.9, 2.4), help="focal length in widths")
    options = parser.parse_args()
    errors: dict[str, list[float]] = {"found": [], "stated": [], "linear tilt": [], "plain scale": []}
    spent, fallen = [], 0
    for seed in range(options.trials):
        rng = np.random.default_rng(seed)
        lens = draw_lens(rng, tilt_deg=options.tilt, focal_widths=tuple(options.focal_widths))
        sightings = film(lens, rng, span=options.span, leaving_rad=options.leaving, noise_px=options.noise)
        start = time.process_time()
        view, _ = find_view(sightings, SETTINGS)
        straight = sightings if view is None else straighten_sightings(sightings, view)
        spent.append(time.process_time() - start)
        errors["linear tilt"].append(radius_error(sightings))
        errors["plain scale"].append(radius_error(plain_scale(sightings)))
        if view is None:
            fallen += 1
            continue
        errors["found"].append(radius_error(straight, view))
        errors["stated"].append(view.scale(1).std / view.scale(1).value)
    rms = {name: 100 * float(np.sqrt(np.mean(np.square(e)))) if e else float("nan") for name, e in errors.items()}
    print(f"error of the radius, rms of {options.trials} cameras that nobody calibrated:")
    print(f"  camera from the tags' own corners {rms['found']:6.2f} %   (stated {rms['stated']:.2f} %)")
    print(f"  a scale for each tag, linear tilt {rms['linear tilt']:6.2f} %")
    print(f"  a scale for each tag              {rms['plain scale']:6.2f} %")
    print(f"fell back to plain scale: {fallen}; CPU time {np.median(spent):.2f} s, at most {max(spent):.2f} s")


if __name__ == "__main__":
    main()
