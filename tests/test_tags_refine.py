import math

import numpy as np
import pytest
from scipy.ndimage import correlate, map_coordinates

from tag_images import make_pose, photograph, see_tag
from tagsway.tags.refine import refine
from tagsway.tags.streak import find_streak
from tagsway.tags.template import Template, make_template

SHAPE = (130, 150)
BLOCKS = 10
STILL, MOVING = (0.0, 0.0), (2.4, -1.1)


def look(pose: np.ndarray, *, family: str = "tag36h11", motion_px: tuple[float, float] = STILL) -> np.ndarray:
    image = see_tag(pose, SHAPE, family=family, motion_px=motion_px, background=170)
    return photograph(image, 3.0, np.random.default_rng(0))


def template_for(side: float, family: str = "tag36h11") -> Template:
    return make_template(family, 0, scale_px=side / 2, blur_px=0.55)


def weigh_three(off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of three texels in the parabola through them, and in its slope; shape (3, n)."""
    weights = np.stack([off * (off - 1) / 2, 1 - off**2, off * (off + 1) / 2])
    return weights, np.stack([off - 0.5, -2 * off, off + 0.5])


def see_plainly(
    grey: np.ndarray, pose: np.ndarray, template: Template, motion_px: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[int, int, int, int]]:
    """Return rows, columns, and the four channels of the pixels of the region, by whole images in double precision."""
    moves = math.hypot(*motion_px) > 0
    reach = template.texture_half_width if moves else template.half_width
    corners = pose @ np.array([[-reach, reach, reach, -reach], [-reach, -reach, reach, reach], [1, 1, 1, 1]])
    x, y = corners[:2] / corners[2]
    left, top = max(math.floor(x.min()), 0), max(math.floor(y.min()), 0)
    right, bottom = min(math.ceil(x.max()), grey.shape[1] - 1), min(math.ceil(y.max()), grey.shape[0] - 1)
    rows, columns = np.mgrid[top : bottom + 1, left : right + 1]
    place = template.texture_grid @ np.linalg.inv(pose) @ np.stack([columns, rows, np.ones_like(rows)]).reshape(3, -1)
    u, v = place[:2] / place[2]
    last = len(template.texture) - 1
    inside = (u >= 0) & (v >= 0) & (u <= last) & (v <= last)
    texture = template.texture.astype(float)
    printed = template.printed.astype(float) if template.printed.size else np.ones_like(texture)
    u, v = (np.clip(place, 0.5, last - 0.5) for place in (u, v))  # so that three texels lie around
    weight = map_coordinates(printed, (v, u), order=1, mode="nearest") * inside
    column, row = (np.clip(np.rint(place), 1, last - 1).astype(int) for place in (u, v))
    (by_u, slope_u), (by_v, slope_v) = weigh_three(u - column), weigh_three(v - row)
    near = np.array([[texture[row + down, column + right] for right in (-1, 0, 1)] for down in (-1, 0, 1)])
    pattern = np.einsum("ik,jk,ijk->k", by_v, by_u, near)
    across, down = np.einsum("ik,jk,ijk->k", by_v, slope_u, near), np.einsum("ik,jk,ijk->k", slope_v, by_u, near)
    (to_column, _, _), (_, to_row, _), _ = template.texture_grid
    seen = np.stack([to_column * across, to_row * down, pattern, np.ones_like(u)]) * weight
    seen = seen.reshape(4, *rows.shape)
    if moves:
        streak = find_streak(motion_px)
        seen = np.stack([correlate(plane, streak, mode="constant") for plane in seen])
        swept, whole = (streak > 0).astype(int), np.count_nonzero(streak > 0)
        inside = correlate(inside.reshape(rows.shape).astype(int), swept, mode="constant").ravel() == whole
        seen = seen * inside.reshape(rows.shape)
    return rows, columns, seen, inside.reshape(rows.shape), (left, top, right - left + 1, bottom - top + 1)


def refine_plainly(grey: np.ndarray, pose: np.ndarray, template: Template, motion_px: tuple[float, float]) -> dict:
    """Do what `refine` says it does, with every column of J written out."""
    rows, columns, seen, inside, (_, _, width, height) = see_plainly(grey, pose, template, motion_px)
    scale = template.scale_px
    x, y = pose[0, 2], pose[1, 2]
    local = np.array([[pose[0, 0] - x * pose[2, 0], pose[0, 1] - x * pose[2, 1]],
                      [pose[1, 0] - y * pose[2, 0], pose[1, 1] - y * pose[2, 1]]])  # fmt: skip
    by_x, by_y = scale * np.einsum("ji,jkl->ikl", np.linalg.inv(local), seen[:2])
    u, v = (columns - x) / scale, (rows - y) / scale
    inward = u * by_x + v * by_y
    design = [by_x, by_y, seen[2], seen[3], u * by_x, v * by_x, u * by_y, v * by_y, -u * inward, -v * inward]
    weighted = (grey[rows, columns] - 128.0) * seen[3]
    a, b = np.stack([part[inside] for part in design], axis=1), weighted[inside]
    normal = np.linalg.inv(a.T @ a)
    solution = normal @ (a.T @ b)
    gain = solution[2]
    dx, dy, xx, xy, yx, yy, p, q = np.delete(solution, [2, 3]) / gain
    about = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]]) @ np.diag([scale, scale, 1])
    move = about @ np.array([[xx, xy, dx], [yx, yy, dy], [p, q, 0]]) @ np.linalg.inv(about)
    moved = pose - move @ pose + move @ move @ pose
    wanted = np.zeros((3, 10))
    wanted[0, 0] = wanted[1, 1] = scale
    (cx, _), (cy, _) = local
    wanted[2, 4:8] = np.array([-cx * cy, -cy * cy, cx * cx, cx * cy]) / (cx**2 + cy**2)
    left = b - a @ solution
    count = (seen[3][inside] ** 2).sum()
    variance = left @ left / (count - 10)
    influence = wanted @ normal / gain
    parts = np.zeros((3, height, width))
    parts[:, inside] = (influence @ a.T) * left
    edges = (np.arange(BLOCKS) * height // BLOCKS, np.arange(BLOCKS) * width // BLOCKS)
    blocks = np.add.reduceat(np.add.reduceat(parts, edges[0], axis=1), edges[1], axis=2)
    covariance = variance / gain * influence @ wanted.T
    return {
        "homography": moved / moved[2, 2],
        "plain": (*np.diagonal(covariance), covariance[0, 1]),
        "sandwich": (blocks**2).sum(axis=(1, 2)) * BLOCKS**2 / (BLOCKS**2 - 10),
        "variance": variance,
        "gain": gain,
        "step_px": scale * np.abs(np.delete(solution, [2, 3]) / gain).max(),
    }


@pytest.mark.parametrize("motion_px", [STILL, MOVING, (0.0, 7.3)])
@pytest.mark.parametrize(
    ("family", "side", "centre", "angle", "tilt"),
    [
        ("tag36h11", 60.0, (70.33, 64.81), 0.0, (0.0, 0.0)),  # no pixel halfway between two texels
        ("tag36h11", 64.0, (74.1, 65.2), 0.7, (0.08, -0.05)),
        ("tag36h11", 15.0, (40.6, 50.2), -2.3, (0.02, 0.01)),
        ("tag36h11", 40.0, (20.4, 20.9), 0.1, (0.0, 0.0)),  # the white around it leaves the image on two sides ...
        ("tag36h11", 40.0, (128.8, 109.0), 0.1, (0.0, 0.0)),  # ... and on the other two
        ("tagCircle21h7", 60.0, (70.3, 64.8), 0.4, (0.0, 0.05)),
        ("tagStandard41h12", 50.0, (70.3, 64.8), -1.2, (0.05, 0.0)),
    ],
)
def test_the_step_is_that_of_the_plain_sums(family, side, centre, angle, tilt, motion_px) -> None:
    pose = make_pose(centre, side, angle, tilt)
    grey, template = look(pose, family=family, motion_px=motion_px), template_for(side, family)
    start = pose.copy()
    start[:2] += np.outer([0.15, -0.1], pose[2])
    found = refine(grey, start, template, motion_px=motion_px, with_blocks=True)
    assert found is not None
    plain = refine_plainly(grey, start, template, motion_px)
    # rounding: sums in single precision, some 1e-7 each; the variance is a difference of sums a thousand times as large
    for name in ("gain", "variance", "step_px"):
        assert getattr(found, name) == pytest.approx(plain[name], rel=5e-4), name
    np.testing.assert_allclose(found.plain[:3], plain["plain"][:3], rtol=5e-4)
    assert found.plain[3] == pytest.approx(plain["plain"][3], abs=5e-4 * max(found.plain[:2]))
    np.testing.assert_allclose(found.sandwich, plain["sandwich"], rtol=1e-3)
    sigma_px = math.sqrt(min(found.plain[:2]))
    np.testing.assert_allclose(found.homography[:2], plain["homography"][:2], atol=0.01 * sigma_px)
    np.testing.assert_allclose(found.homography[2], plain["homography"][2], atol=0.01 * sigma_px / side)


def test_the_image_may_be_a_part_of_another_and_not_to_be_written() -> None:
    pose = make_pose((70.3, 64.8), 60.0, 0.3)
    grey, template = look(pose), template_for(60.0)
    wide = np.zeros((SHAPE[0], 256), np.uint8)
    wide[:, 8 : 8 + SHAPE[1]] = grey
    part = wide[:, 8 : 8 + SHAPE[1]]
    part.flags.writeable = False
    turned = np.asfortranarray(grey)
    expected = refine(grey, pose, template)
    assert expected is not None
    for other in (part, turned):
        found = refine(other, np.asfortranarray(pose), template)
        assert found is not None
        np.testing.assert_array_equal(found.homography, expected.homography)


def test_a_pose_need_not_be_scaled() -> None:
    pose = make_pose((70.3, 64.8), 60.0, 0.3, (0.05, 0.02))
    grey, template = look(pose), template_for(60.0)
    one, other = refine(grey, pose, template), refine(grey, -3 * pose, template)
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one.homography, other.homography, rtol=1e-6)  # rounding


@pytest.mark.parametrize("grey", [np.zeros(SHAPE, np.uint8), np.full(SHAPE, 255, np.uint8)])
def test_a_flat_image_gives_no_step(grey) -> None:
    assert refine(grey, make_pose((70.3, 64.8), 60.0), template_for(60.0)) is None


@pytest.mark.parametrize(
    "pose",
    [
        make_pose((-500.0, 64.8), 60.0),
        make_pose((70.3, 900.0), 60.0),
        make_pose((70.3, 64.8), 60.0, 0.0, (1.2, 0.9)),  # the horizon goes through the tag
        make_pose((70.3, 64.8), 1e9),
        np.full((3, 3), math.nan),
        np.full((3, 3), math.inf),
    ],
)
@pytest.mark.parametrize("motion_px", [STILL, MOVING])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # infinity over infinity
def test_an_impossible_pose_gives_none_or_a_finite_one(pose, motion_px) -> None:
    found = refine(look(make_pose((70.3, 64.8), 60.0)), pose, template_for(60.0), motion_px=motion_px)
    assert found is None or np.isfinite(found.homography).all()
