"""A lens that is known is a lens that is gone."""

import numpy as np
import pytest

from tagsway.camera import undistort, undistort_sightings
from tagsway.errors import InputError
from tagsway.model import Camera, FloatArray, Sightings, TagSightings, VideoInfo

LENS = Camera(width=1280, height=1024, fx=1400, fy=1380, cx=650, cy=500, distortion=(-0.2, 0.05, 1e-3, -5e-4, 0.01))


def show(plane: FloatArray, camera: Camera) -> FloatArray:
    """Return the pixels of points X/Z, Y/Z: the Brown-Conrady model, written out."""
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = plane[..., 0], plane[..., 1]
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.stack([camera.fx * u + camera.cx, camera.fy * v + camera.cy], axis=-1)


def test_undistorted_points_are_those_of_a_pinhole() -> None:
    plane = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.3, 0.3, 7)), axis=-1)
    ideal = undistort(show(plane, LENS), LENS)
    np.testing.assert_allclose(ideal, 1400 * plane + [650, 500], atol=1e-6)  # identity, after the iteration


def test_points_not_seen_stay_nan() -> None:
    points = np.array([[np.nan, np.nan], [650.0, 500.0]])
    np.testing.assert_allclose(undistort(points, LENS), [[np.nan, np.nan], [650, 500]], atol=1e-9)
    assert undistort(np.full((3, 4, 2), np.nan), LENS).shape == (3, 4, 2)


def sightings_of(plane: FloatArray, direction: FloatArray, size: tuple[int, int]) -> Sightings:
    """Return one tag at points of the plane, its x axis along a direction there."""
    step = 1e-4 * direction / np.linalg.norm(direction)
    along = show(plane + step, LENS) - show(plane - step, LENS)
    corners = np.stack([show(plane + 0.02 * np.array(c), LENS) for c in ((-1, 1), (1, 1), (1, -1), (-1, -1))], axis=1)
    tag = TagSightings(
        tag_id=1,
        centre_px=show(plane, LENS),
        covariance_px2=np.tile(0.01 * np.eye(2), (len(plane), 1, 1)),
        corners_px=corners,
        angle_rad=-np.arctan2(along[:, 1], along[:, 0]),
        angle_std_rad=np.full(len(plane), 1e-3),
        correlation=np.ones(len(plane)),
    )
    video = VideoInfo(
        frames=len(plane),
        fps_hz=200.0,
        time_source="container",
        pts_rounding_s=0.0,
        dropped=0,
        duplicated=0,
        width=size[0],
        height=size[1],
        duration_s=1.0,
    )
    return Sightings(
        video=video, frame=np.arange(len(plane)), time_s=np.arange(len(plane)) / 200, tags=(tag,), detector_calls=1
    )


def test_sightings_lose_the_lens_in_place_direction_and_corners() -> None:
    plane = np.array([[0.3, 0.2], [-0.35, 0.1], [0.0, 0.0]])
    direction = np.array([np.cos(0.4), -np.sin(0.4)])
    (tag,) = undistort_sightings(sightings_of(plane, direction, (1280, 1024)), LENS).tags
    np.testing.assert_allclose(tag.centre_px, 1400 * plane + [650, 500], atol=1e-6)  # identity
    np.testing.assert_allclose(tag.angle_rad, 0.4, atol=1e-5)  # discretisation: half a pixel's difference
    np.testing.assert_allclose(np.linalg.norm(np.diff(tag.corners_px, axis=1), axis=2), 56.0, atol=1e-5)
    assert np.all(np.diagonal(tag.covariance_px2, axis1=1, axis2=2)[:2] > 0.0102)  # a barrel lens shows it smaller


def test_a_camera_of_another_image_size_is_refused() -> None:
    sightings = sightings_of(np.zeros((2, 2)), np.array([1.0, 0.0]), (640, 512))
    with pytest.raises(InputError, match="1280×1024, the video is 640×512"):
        undistort_sightings(sightings, LENS)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fx": 0.0}, "fx is 0"),
        ({"fy": float("nan")}, "fy is nan"),
        ({"width": -3}, "width is -3"),
        ({"cx": 2000.0}, "principal point"),
        ({"distortion": (0.1, float("nan"), 0.0, 0.0, 0.0)}, "distortion"),
        ({"readout_s": -1.0}, "readout_s is -1"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(change: dict[str, float], words: str) -> None:
    good: dict[str, float] = {"width": 1280, "height": 1024, "fx": 1400, "fy": 1400, "cx": 640, "cy": 512}
    with pytest.raises(InputError, match=words):
        Camera(**{**good, **change})  # type: ignore[arg-type]


def test_the_error_of_a_direction_goes_through_the_lens_as_the_direction_does() -> None:
    place, turn = np.array([[0.38, -0.28]]), 1e-4
    before, after = (
        sightings_of(place, np.array([np.cos(angle), np.sin(angle)]), (1280, 1024)).tags[0]
        for angle in (0.4, 0.4 + turn)
    )
    seen = after.angle_rad - before.angle_rad
    sightings = sightings_of(place, np.array([np.cos(0.4), np.sin(0.4)]), (1280, 1024))
    undistorted = undistort_sightings(sightings, LENS).tags[0]
    # discretisation: a difference over 1e-4 rad
    ratio = undistorted.angle_std_rad / sightings.tags[0].angle_std_rad
    np.testing.assert_allclose(np.abs(ratio * seen), turn, rtol=1e-2)
