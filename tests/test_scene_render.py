"""The pictures are where the truth says, to a few thousandths of a pixel."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from scenes import released_scene, small_scene
from tagsway.scene.model import FixedTag, Occlusion, Tag, Tags, Tool
from tagsway.scene.motion import simulate_scene
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat
from tagsway.scene.render import draw_frame, expose_film, plan_film, pose_of, render_frames
from tagsway.scene.truth import describe_film
from tagsway.tags.draw import cover_tag
from tagsway.tags.families import tag_pattern

CLEAN = Picture(noise_grey=0.0, exposure_s=0.0)
TILTED = SceneCamera(
    width=320, height=320, distance_m=0.5, focal_px=700.0, yaw_deg=12, pitch_deg=-8, roll_deg=15, radial_k1=-0.12
)

ROLLED = SceneCamera(width=320, height=320, distance_m=1.5, focal_px=2200.0, roll_deg=3.0)


def still_scene(**changes):
    """Two frames of a payload held aside, the second like the first."""
    return released_scene(**{"duration_s": 0.01, "picture": CLEAN, "tool": Tool(start_s=0.1)} | changes)


def shift_between(image, reference, mask):
    """Return how far an image is shifted against another, by least squares on its gradients, in px."""
    rows, columns = np.gradient(reference.astype(float))
    design = np.stack([-columns[mask], -rows[mask], np.ones(np.count_nonzero(mask))], axis=1)
    shift, *_ = np.linalg.lstsq(design, image[mask].astype(float) - reference[mask], rcond=None)
    return shift[:2]


def brute_force(film, name, samples=12):
    """Return a tag drawn sample by sample without any interpolation, and where that is valid."""
    scene = film.scene
    tag = getattr(scene.tags, name)
    pose, pattern = pose_of(film, name, tag, 0, 0.0), tag_pattern(scene.tags.family, tag.id)
    width, height = scene.camera.width, scene.camera.height
    centre = film.view.project(pose.centre)
    reach = 45
    low = np.maximum(np.floor(centre).astype(int) - reach, 0)
    high = np.minimum(low + 2 * reach, (width, height))
    axes = [(np.arange(samples * (b - a)) + 0.5) / samples - 0.5 + a for a, b in zip(low, high, strict=True)]
    rays = film.view.cast(np.stack(np.meshgrid(*axes), axis=-1))
    rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1) @ film.view.axes
    normal = np.cross(pose.right, pose.up)
    distance = (pose.centre - film.view.centre_m) @ normal / (rays @ normal)
    place = film.view.centre_m + distance[..., None] * rays - pose.centre
    cell = tag.size_m / 8
    column, row = (
        np.floor(5 + sign * (place @ axis) / cell).astype(int) for sign, axis in ((1, pose.right), (-1, pose.up))
    )
    inside = (column >= 0) & (column < 10) & (row >= 0) & (row < 10)
    white = np.where(inside, pattern[np.clip(row, 0, 9), np.clip(column, 0, 9)], True)
    black, paper = scene.picture.black_grey, scene.picture.white_grey
    fine = gaussian_filter(black + (paper - black) * white, scene.picture.blur_px * samples, mode="nearest")
    shape = ((high - low)[1], samples, (high - low)[0], samples)
    image, mask = np.full((height, width), paper), np.zeros((height, width), dtype=bool)
    region = (slice(low[1], high[1]), slice(low[0], high[0]))
    image[region] = fine.reshape(shape).mean(axis=(1, 3))
    mask[region] = inside.reshape(shape).all(axis=(1, 3))
    return image, mask


@pytest.mark.parametrize("name", ["tcp", "pcp"])
@pytest.mark.parametrize("camera", [TILTED, ROLLED])
def test_a_tag_is_where_a_drawing_without_interpolation_has_it(camera, name):
    payload = replace(released_scene().payload, sideways_angle_rad=0.2)
    film = plan_film(still_scene(camera=camera, payload=payload))
    image = next(expose_film(film))
    reference, mask = brute_force(film, name)
    assert np.count_nonzero(mask) > 1000
    # discretisation: rounding to grey levels, and 1/16 of a texel of 1/8 px
    assert np.max(np.abs(shift_between(image, reference, mask))) < 0.003
    assert np.std((image - reference)[mask]) < 1.5


@pytest.mark.parametrize("phase", [0.0, 0.13, 0.37, 0.5, 0.81])
def test_doubling_the_supersampling_moves_nothing_by_half_of_the_promised_precision(phase):
    camera = SceneCamera(
        width=320, height=320, distance_m=1.5, focal_px=2200.0, target_m=(0.0, -0.05 + phase * 1.5 / 2200)
    )
    payload = replace(released_scene().payload, release_angle_rad=0.3 * phase)
    images = []
    for samples in (3, 6):
        picture = replace(CLEAN, supersampling=samples)
        images.append(next(render_frames(still_scene(camera=camera, payload=payload, picture=picture))))
    # discretisation: a look-up is good to 1/64 of a texel, 0.002 px; promised are 0.005 px
    assert np.max(np.abs(shift_between(images[0], images[1], np.ones(images[0].shape, dtype=bool)))) < 0.0025
    assert np.max(np.abs(images[0].astype(int) - images[1])) <= 4


@pytest.mark.parametrize("phase", [0.0, 0.13, 0.37, 0.5, 0.81])
def test_a_tag_along_the_pixels_is_where_its_exact_areas_have_it(phase):
    scale = 1.5 / 2200
    target = (0.3 * phase * scale, phase * scale)
    film = plan_film(still_scene(camera=replace(released_scene().camera, target_m=target)))
    image = draw_frame(film, 0, np.full((320, 320), 170, dtype=np.float32), {}).astype(float)
    centre, samples = np.array(describe_film(film).tags["tcp"].centre_px[0]), 10
    half = 0.015 / scale
    low = np.rint(centre).astype(int) - 35
    x, y = ((np.arange(70 * samples + 1) / samples - 0.5 + a - c) / half for a, c in zip(low, centre, strict=True))
    fine = gaussian_filter(35 + 180 * cover_tag("tag36h11", 0, x, -y), 0.6 * samples)
    reference = fine.reshape(70, samples, 70, samples).mean(axis=(1, 3))
    mask = np.zeros((70, 70), dtype=bool)
    mask[9:-9, 9:-9] = True
    part = image[low[1] : low[1] + 70, low[0] : low[0] + 70]
    # discretisation: a look-up is good to 1/64 of a texel, 0.002 px, and all edges share it here
    assert np.max(np.abs(shift_between(part, reference, mask))) < 0.002


def test_too_few_samples_would_be_noticed():
    images = []
    for samples in (1, 6):
        camera = SceneCamera(width=320, height=320, distance_m=1.5, focal_px=2200.0, target_m=(2e-4, -0.0502))
        picture = replace(CLEAN, supersampling=samples, blur_px=0.3)
        images.append(next(render_frames(still_scene(camera=camera, picture=picture))))
    assert np.max(np.abs(images[0].astype(int) - images[1])) > 4


def test_an_exposed_picture_is_the_mean_of_sharp_ones_and_centred_on_its_middle():
    camera = replace(released_scene().camera, target_m=(0.0, -0.04))
    scene = still_scene(
        camera=camera, duration_s=0.005, tool=Tool(start_s=0.0), picture=replace(CLEAN, exposure_s=0.004)
    )

    def film_at(middle, exposure):
        poses = simulate_scene(scene, middle + exposure * np.array([-0.5, 0.0, 0.5]))
        return replace(plan_film(scene), time_s=np.array([middle]), poses=poses)

    exposed = next(expose_film(film_at(0.1, 0.004)))
    sharp = [next(expose_film(film_at(0.1 + 0.004 * ((i + 0.5) / 10 - 0.5), 0.0))) for i in range(10)]
    assert np.max(np.abs(sharp[0].astype(float) - sharp[-1])) > 100
    centre = np.array(describe_film(film_at(0.1, 0.004)).tags["pcp"].centre_px[0])
    rows, columns = np.indices(exposed.shape)
    mask = np.hypot(columns - centre[0], rows - centre[1]) < 25
    # discretisation: rounding to grey levels
    assert np.max(np.abs(shift_between(exposed, np.mean(sharp, axis=0), mask))) < 0.003
    assert np.mean(np.abs(exposed - np.mean(sharp, axis=0))[mask]) < 0.6


def test_the_scale_and_the_tilt_of_the_camera_are_the_pinhole_s():
    camera = SceneCamera(width=640, height=360, distance_m=1.5, focal_px=2200.0, target_m=(0.0, 0.0))
    film = plan_film(small_scene(camera=camera, tags=Tags(tcp=Tag(id=0, depth_m=-0.1))))
    truth = describe_film(film)
    assert truth.tags["tcp"].mm_per_px == pytest.approx(1400 / 2200, rel=1e-9)
    first = truth.tags["tcp"].centre_px[0]
    assert first == pytest.approx((319.5 - 0.14 * 2200 / 1.4, 179.5), abs=1e-9)
    rolled = plan_film(small_scene(camera=replace(camera, roll_deg=90.0)))
    # The camera turned clockwise sees what was on its left below.
    assert describe_film(rolled).tags["tcp"].centre_px[0] == pytest.approx((319.5, 179.5 + 0.14 * 2200 / 1.5), abs=1e-9)


def test_shake_moves_every_tag_alike_and_has_its_rms():
    tags = Tags(reference=FixedTag(id=2, position_m=(0.05, 0.02)))
    camera = replace(released_scene().camera, shake_px=1.5)
    still, shaken = (
        describe_film(plan_film(released_scene(tags=tags, camera=c))) for c in (replace(camera, shake_px=0.0), camera)
    )
    shifts = {n: np.array(shaken.tags[n].centre_px) - np.array(still.tags[n].centre_px) for n in ("tcp", "reference")}
    np.testing.assert_allclose(shifts["tcp"], shifts["reference"], atol=1e-9)
    # statistics: twelve random waves over 2.6 s
    assert np.sqrt(np.mean(shifts["tcp"] ** 2)) == pytest.approx(1.5, rel=0.3)


def test_a_shaken_picture_is_the_still_one_shifted():
    camera = replace(released_scene().camera, shake_px=2.0)
    scene = still_scene(camera=camera)
    film = plan_film(scene)
    shaken, still = next(expose_film(film)), next(render_frames(still_scene()))
    expected = np.array(describe_film(film).tags["pcp"].centre_px[0])
    rows, columns = np.indices(still.shape)
    moved = np.rint(film.shake_px[0]).astype(int)
    mask = np.hypot(columns - expected[0], rows - expected[1]) < 30
    rolled = np.roll(still, moved[::-1], axis=(0, 1))
    # discretisation: the rest of the shift is up to half a pixel, beyond the gradients' linear range
    np.testing.assert_allclose(shift_between(shaken, rolled, mask), film.shake_px[0] - moved, atol=0.12)


def test_noise_has_its_deviation_and_the_same_film_gives_the_same_pictures():
    scene = still_scene(picture=replace(CLEAN, noise_grey=3.0))
    film = plan_film(scene)
    first, second = list(expose_film(film))
    # statistics: 100,000 pixels
    assert np.std(first.astype(float) - second) == pytest.approx(3.0 * np.sqrt(2), rel=0.02)
    np.testing.assert_array_equal(first, next(expose_film(film)))
    np.testing.assert_array_equal(first, next(render_frames(scene)))
    other = next(render_frames(scene, rng=np.random.default_rng(5)))
    assert np.any(other != first)


def test_an_occlusion_hides_its_share_of_a_tag_for_its_time():
    scene = still_scene(duration_s=0.02, occlusions=(Occlusion(tag="pcp", start_s=0.0049, end_s=0.0099, share=0.5),))
    film = plan_film(scene)
    assert describe_film(film).tags["pcp"].hidden == [1]
    free, covered, again, _ = (frame.astype(int) for frame in expose_film(film))
    np.testing.assert_array_equal(free, again)
    changed = np.abs(covered - free) > 5
    centre = np.array(describe_film(film).tags["pcp"].centre_px[0])
    columns = np.flatnonzero(changed.any(axis=0))
    assert columns[0] < centre[0] - 15
    assert columns[-1] < centre[0] + 20
    assert np.abs(covered - free)[:, : int(centre[0])].max() > 60


def test_clutter_stands_behind_the_tags():
    plain, cluttered = (
        next(render_frames(still_scene(picture=p))) for p in (CLEAN, replace(CLEAN, decoys=8, texture_grey=5.0))
    )
    x, y = np.rint(describe_film(plan_film(still_scene())).tags["tcp"].centre_px[0]).astype(int)
    np.testing.assert_array_equal(plain[y - 15 : y + 15, x - 15 : x + 15], cluttered[y - 15 : y + 15, x - 15 : x + 15])
    assert np.std(cluttered.astype(float) - plain) > 5


def test_what_leaves_the_picture_is_simply_not_seen():
    camera = replace(released_scene().camera, target_m=(5.0, 0.0))
    (first, _) = render_frames(still_scene(camera=camera))
    assert first.min() > 130


def test_lost_frames_are_missing_from_the_film_and_the_rest_keep_their_times():
    video = VideoFormat(lost=((3, 5), (40, 40)), lost_share=0.1)
    film = plan_film(released_scene(duration_s=1.0, video=video))
    assert not {3, 4, 5, 40} & set(film.frame.tolist())
    # statistics: 196 frames at 10 %, four deviations
    assert 196 - 37 <= len(film.frame) <= 196 - 3
    np.testing.assert_allclose(film.time_s, film.frame / 200.0, atol=1e-12)
