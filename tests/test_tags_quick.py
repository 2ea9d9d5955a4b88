import math

import numpy as np
import pytest

from tag_images import make_pose, photograph, see_tag
from tagsway.tags.quick import Known, Lattice, Lattices, refine_quickly
from tagsway.tags.refine import refine
from tagsway.tags.template import Template, make_template

SIDE, BLUR = 60.0, 0.7
SHAPE = (140, 140)
TEMPLATE = make_template("tag36h11", 0, scale_px=SIDE / 2, blur_px=BLUR)


def find_lattice(pose: np.ndarray, motion: tuple[float, float], template: Template = TEMPLATE) -> Lattice | None:
    lattices = Lattices("tag36h11", 0, template)
    lattices.find(pose, motion)
    return lattices.find(pose, motion)


@pytest.mark.parametrize("motion", [(0.0, 0.0), (4.0, 1.7)])
def test_samples_tell_what_the_pixels_tell(motion: tuple[float, float]) -> None:
    rng = np.random.default_rng(0)
    known, quick, exact, normalised, turned = None, [], [], [], []
    for k in range(80):
        pose = make_pose((70 + rng.uniform(), 70 + rng.uniform()), SIDE, 0.02 * (k % 8), (0.01, 0.006))
        drawn = see_tag(pose, SHAPE, tag_id=0, blur_px=BLUR, motion_px=motion)
        grey = photograph(drawn, 3.0, rng)
        near = pose / pose[2, 2]
        near[:2, 2] += rng.normal(scale=0.03, size=2)
        lattice = find_lattice(near, motion)
        pixels = refine(grey, near, TEMPLATE, motion_px=motion)
        assert lattice is not None
        assert pixels is not None
        if known is None:
            known = Known.learn(grey, pixels, TEMPLATE, lattice)
            assert known is not None
        samples = refine_quickly(grey, near, TEMPLATE, lattice, known)
        assert samples is not None
        error = samples.homography[:2, 2] - pose[:2, 2] / pose[2, 2]
        quick.append(error)
        exact.append(pixels.homography[:2, 2] - pose[:2, 2] / pose[2, 2])
        normalised.append(error**2 / np.array(samples.plain[:2]))
        turned.append(samples.plain[2] / pixels.plain[2])
    ratio = math.sqrt(np.mean(np.square(quick)) / np.mean(np.square(exact)))
    assert 0.9 < ratio < 1.15  # statistics: the two share their noise, so 160 values tell their ratio to 3 %
    assert 0.7 < np.mean(normalised) < 1.35  # statistics: 160 squares are known to 11 %
    assert 0.8 < np.mean(turned) < 1.25  # statistics: the noise of each image is known to 2 %, that of the first counts


def test_a_lattice_is_made_for_a_motion_that_comes_again() -> None:
    pose = make_pose((70, 70), SIDE)
    lattices = Lattices("tag36h11", 0, TEMPLATE)
    assert lattices.find(pose, (3.0, 1.0)) is None
    made = lattices.find(pose, (3.0, 1.0))
    assert made is not None
    assert lattices.find(pose, (-3.0, -1.0)) is made  # to and fro blur alike
    assert lattices.find(pose, (1.0, 3.0)) is None


@pytest.mark.parametrize("side", [30.0, 120.0])
def test_small_and_large_tags_are_left_to_the_pixels(side: float) -> None:
    template = make_template("tag36h11", 0, scale_px=side / 2, blur_px=BLUR)
    assert find_lattice(make_pose((150, 150), side), (0.0, 0.0), template) is None


def test_a_tag_at_the_edge_of_the_image_is_left_to_the_pixels() -> None:
    inside, outside = make_pose((70, 70), SIDE), make_pose((31, 70), SIDE)
    lattice = find_lattice(inside, (0.0, 0.0))
    assert lattice is not None
    image = photograph(see_tag(inside, SHAPE, tag_id=0, blur_px=BLUR), 3.0, np.random.default_rng(1))
    pixels = refine(image, inside, TEMPLATE)
    assert pixels is not None
    known = Known.learn(image, pixels, TEMPLATE, lattice)
    assert known is not None
    cut = photograph(see_tag(outside, SHAPE, tag_id=0, blur_px=BLUR), 3.0, np.random.default_rng(1))
    assert refine_quickly(cut, outside, TEMPLATE, lattice, known) is None


def test_an_image_without_contrast_is_no_step() -> None:
    pose = make_pose((70, 70), SIDE)
    lattice = find_lattice(pose, (0.0, 0.0))
    assert lattice is not None
    known = Known(covariance=(1e-6, 0.0, 1e-6), turning=1e-6, variance_ratio=2.0, contrast=0.2)
    assert refine_quickly(np.full(SHAPE, 90, np.uint8), pose, TEMPLATE, lattice, known) is None
