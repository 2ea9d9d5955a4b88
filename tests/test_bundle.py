"""The camera from the tags' own corners: found within its errors, left alone where the motion does not tell it."""

from dataclasses import replace

import numpy as np
import pytest

from camera_scenes import HEIGHT, RADIUS_M, SETTINGS, WIDTH, Lens, draw_lens, film, rotate
from tagsway.camera import find_view, straighten_sightings
from tagsway.camera.projection import LENS, OF_A_TAG, POSE, differentiate, project_tags
from tagsway.camera.view import MOST_FRAMES, choose_frames, share_places
from tagsway.model import Camera, PlaneView, Settings, Sightings
from tagsway.tracks import join_tags


def radius_error(sightings: Sightings, view: PlaneView | None) -> float:
    track = join_tags(sightings if view is None else straighten_sightings(sightings, view), SETTINGS, view=view)[0]
    assert track.tcp is not None
    return float(np.mean(np.linalg.norm(track.pcp.position - track.tcp.position, axis=1))) / RADIUS_M - 1


def test_the_slopes_are_those_of_the_projection() -> None:
    rng = np.random.default_rng(0)
    focal = 1500.0
    lens = [np.log(focal), 0.1 / focal**2, 0.1 / focal, -0.08 / focal, np.log(0.8 / focal)]
    own = 0.02 * rng.normal(size=(2, OF_A_TAG)) * [1, 1 / focal, 1 / focal, 1]
    shared = np.concatenate([lens, own.ravel()])
    pose = rng.normal(size=(10, POSE)) * [200, 200, 0.5]
    tag, side = np.arange(10) % 2, np.array([0.03, 0.04])
    shared_slope, pose_slope, _ = differentiate(project_tags(shared, pose, tag, side), shared, pose, tag)
    for index in range(LENS + 2 * OF_A_TAG):
        step = 1e-6 * abs(shared[index]) * (np.arange(len(shared)) == index)
        ahead, behind = (project_tags(shared + s, pose, tag, side).corners_px for s in (step, -step))
        slope = (ahead - behind).reshape(-1, 8) / (2 * step.sum())
        # discretisation: a central difference, and what is left of its digits
        np.testing.assert_allclose(shared_slope[index], slope, atol=1e-5 * np.abs(slope).max())
    for index in range(POSE):
        step = 1e-4 * (np.arange(POSE) == index)
        ahead, behind = (project_tags(shared, pose + s, tag, side).corners_px for s in (step, -step))
        slope = (ahead - behind).reshape(-1, 8) / 2e-4
        np.testing.assert_allclose(pose_slope[..., index], slope, atol=1e-5 * np.abs(slope).max())


def test_radius_and_camera_are_found_within_their_errors() -> None:
    found, plain, z = [], [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        lens = draw_lens(rng)
        sightings = film(lens, rng)
        view, (notice,) = find_view(sightings, SETTINGS)
        assert notice.code == "camera_from_motion"
        assert view is not None
        found.append(radius_error(sightings, view))
        plain.append(radius_error(sightings, None))
        yaw = -np.arcsin(lens.axes[2, 0])
        scale = view.scale(1)
        z.append(
            [
                (view.yaw_rad.value - yaw) / view.yaw_rad.std,
                (view.radial_k1.value - lens.radial_k1) / view.radial_k1.std,
                (view.focal_px.value - lens.focal_px) / view.focal_px.std,
                found[-1] / (scale.std / scale.value),
            ]
        )
    # Statistics: the study that came before reached 0.16 to 0.26 %.
    assert np.sqrt(np.mean(np.square(found))) < 0.004
    assert np.sqrt(np.mean(np.square(plain))) > 0.012
    assert np.abs(z).max() < 4
    assert np.all(np.sqrt(np.mean(np.square(z), axis=0)) < 1.8)


def test_a_frontal_view_returns_the_prior_of_the_focal_length_and_says_so() -> None:
    rng = np.random.default_rng(0)
    lens = Lens(focal_px=1500.0, radial_k1=0.0, axes=np.eye(3), distance_m=0.75)
    sightings = film(lens, rng, stuck_deg=0.0)  # a tag that is stuck on askew is no frontal view
    view, (notice,) = find_view(sightings, SETTINGS)
    assert view is not None
    assert "assumed" in notice.message
    assert view.focal_px.std > 0.2 * view.focal_px.value
    assert abs(radius_error(sightings, view)) < 3 * view.scale(1).std / view.scale(1).value  # statistics


def test_a_product_that_leaves_the_plane_widens_the_errors() -> None:
    errors = []
    for leaving in (0.0, 0.06):
        rng = np.random.default_rng(7)
        lens = draw_lens(rng)
        view, _ = find_view(film(lens, rng, leaving_rad=leaving), SETTINGS)
        assert view is not None
        errors.append(view.pitch_rad.std)
    assert errors[1] > 1.3 * errors[0]


def test_a_small_motion_falls_back_to_plain_scale() -> None:
    rng = np.random.default_rng(1)
    view, (notice,) = find_view(film(draw_lens(rng), rng, span=0.0), SETTINGS)
    assert view is None
    assert notice.code == "plain_scale"
    assert "% of the image" in notice.message


def test_a_known_lens_is_kept_and_the_tilt_found() -> None:
    rng = np.random.default_rng(2)
    lens = replace(draw_lens(rng, tilt_deg=0.0), axes=rotate(1, np.radians(6.0)), radial_k1=0.0)
    camera = Camera(
        width=WIDTH, height=HEIGHT, fx=lens.focal_px, fy=lens.focal_px, cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2
    )
    view, (notice,) = find_view(film(lens, rng), SETTINGS, camera=camera)
    assert view is not None
    assert view.focal_px.value == pytest.approx(lens.focal_px)
    assert view.focal_px.std == 0
    assert abs(view.yaw_rad.value - np.radians(6.0)) < 4 * view.yaw_rad.std  # statistics
    assert "known camera" in notice.message


def test_without_sizes_the_picture_is_straightened_in_pixels() -> None:
    rng = np.random.default_rng(3)
    sightings = film(draw_lens(rng), rng)
    settings = Settings()
    view, _ = find_view(sightings, settings)
    assert view is not None
    assert view.scale(0).value == pytest.approx(1, rel=0.1)
    track, _, _ = join_tags(straighten_sightings(sightings, view), settings, view=view)
    assert track.length_unit == "px"
    assert track.tcp is not None
    apart = np.linalg.norm(track.pcp.position - track.tcp.position, axis=1)
    assert np.std(apart) < 0.01 * np.mean(apart)


def test_wrong_corners_in_some_frames_do_not_change_the_view() -> None:
    rng = np.random.default_rng(4)
    sightings = film(draw_lens(rng), rng)
    good, _ = find_view(sightings, SETTINGS)
    sightings.tags[1].corners_px[::40] += 15 * rng.normal(size=sightings.tags[1].corners_px[::40].shape)
    bad, _ = find_view(sightings, SETTINGS)
    assert good is not None
    assert bad is not None
    assert abs(bad.scale(1).value / good.scale(1).value - 1) < 3 * good.scale(1).std / good.scale(1).value


def test_tags_hardly_seen_or_never_make_no_view() -> None:
    rng = np.random.default_rng(5)
    sightings = film(draw_lens(rng), rng)
    for tag in sightings.tags:
        tag.correlation[15:] = np.nan
        for values in (tag.centre_px, tag.corners_px, tag.angle_rad):
            values[15:] = np.nan
    assert find_view(sightings, SETTINGS)[0] is None
    assert find_view(replace(sightings, tags=()), SETTINGS) == (None, ())


def test_frames_are_spread_and_bounded() -> None:
    rng = np.random.default_rng(6)
    sightings = film(draw_lens(rng), rng)
    sightings.tags[0].correlation[100] = 0.9
    chosen = choose_frames(sightings.time_s, sightings.tags, width=WIDTH)
    assert len(chosen) == MOST_FRAMES
    assert np.all(np.diff(chosen) > 0)
    assert 100 not in chosen
    seen = sightings.tags[0].centre_px
    assert np.ptp(seen[chosen], axis=0) == pytest.approx(np.ptp(seen, axis=0), rel=0.02)


def test_a_tag_that_stands_still_counts_once() -> None:
    corners = np.concatenate([np.zeros((8, 4, 2)), np.full((1, 4, 2), 9.0)])
    np.testing.assert_allclose(share_places(corners), [1 / 8] * 8 + [1])  # identity
