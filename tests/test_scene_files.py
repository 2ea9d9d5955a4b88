"""Scene files in, videos and their truth out."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from scenes import released_scene, small_scene
from tagsway.errors import InputError
from tagsway.scene import read_scene, read_truth, render_frames, render_scene, truth_path
from tagsway.scene.motion import simulate_scene
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat
from tagsway.video.writing import write_video

SAMPLES = Path(__file__).parents[1] / "sample_data"
SMALLEST = 'schema = "tagsway/scene/1"\nduration_s = 1.0\n[payload]\nlength_m = 0.05\n'


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def decode(path):
    """Return luma planes in full range, times in s, and the stream's rate."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        images, times = [], []
        for frame in container.decode(stream):
            plane = frame.planes[0]
            rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)[:, : plane.width]
            limited = frame.format.name == "yuv420p" and frame.color_range != 2
            images.append(np.clip((rows.astype(float) - 16) * 255 / 219, 0, 255) if limited else rows.astype(float))
            times.append(float(frame.pts * frame.time_base))
        return images, np.array(times), stream.average_rate


def ramp(count=12, width=64, height=48):
    rows, columns = np.indices((height, width))
    return [((rows * 3 + columns * 2 + 5 * i) % 256).astype(np.uint8) for i in range(count)]


def test_the_smallest_scene_file_has_defaults_for_the_rest(tmp_path):
    scene = read_scene(written(tmp_path / "a.toml", SMALLEST))
    assert scene.payload.pendulum().tag_radius_m == 0.05
    assert scene.tags.tcp is not None
    assert scene.move is None


def test_frequency_and_ratio_may_be_given_instead_of_spring_and_damper(tmp_path):
    scene = read_scene(written(tmp_path / "a.toml", SMALLEST + "natural_frequency_hz = 3.0\ndamping_ratio = 0.02\n"))
    pendulum = scene.payload.pendulum()
    assert pendulum.natural_frequency_hz == pytest.approx(3.0, rel=1e-12)
    assert pendulum.damping_ratio == pytest.approx(0.02, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("schema = ", "is not TOML"),
        ("duration_s = 1.0\n", 'expected the line schema = "tagsway/scene/1"'),
        (SMALLEST.replace("scene/1", "scene/2"), "schema"),
        (SMALLEST.replace("[payload]", "[payloads]"), "payload"),
        (SMALLEST + "lenght_m = 1\n", r"the key payload\.lenght_m is not known"),
        (SMALLEST.replace("0.05", "nan"), "length_m must be a positive number, not nan"),
        (SMALLEST.replace("0.05", "-0.05"), "length_m must be a positive number, not -0.05"),
        (SMALLEST.replace("1.0", "inf"), "duration_s"),
        (SMALLEST.replace("1.0", "0.0"), "duration_s"),
        (SMALLEST + "stiffness_n_m_per_rad = -1\n", "not stable"),
        (SMALLEST + "damping_ratio = 1.0\n", r"damping_ratio must lie in \[0, 1\)"),
        (SMALLEST + "stiffness_n_m_per_rad = 0.1\nnatural_frequency_hz = 3.0\n", "not both"),
        (SMALLEST + "release_angle_rad = 30\n", "radians"),
        (SMALLEST + "[camera]\nwidth = 641\n", "even number"),
        (SMALLEST + "[camera]\nradial_k1 = -40\n", "folds the picture"),
        (SMALLEST + "[picture]\nblur_px = 0.0\n", "blur_px must lie between"),
        (SMALLEST + "[picture]\nexposure_s = 0.1\n", "longer than a frame"),
        (SMALLEST + '[tags]\nfamily = "tag36h12"\n', "no tag family"),
        (SMALLEST + "[tags]\ntcp = { id = 1 }\n", "an id of its own"),
        (SMALLEST + "[tags]\ntcp = { id = 9999 }\n", "has no tag 9999"),
        (SMALLEST + "[tags]\ntcp = { id = 0, depth_m = -3.0 }\n", "behind the camera"),
        (SMALLEST + '[video]\ncodec = "av1"\n', "codec"),
        (SMALLEST + '[[occlusions]]\ntag = "pcp"\nstart_s = 2\nend_s = 1\n', "must end after it starts"),
        (SMALLEST.replace("[pay", 'trajectory = "none.csv"\n[pay'), "none.csv: cannot be read"),
        (SMALLEST.replace("[pay", 'trajectory = "../x.csv"\n[pay'), "outside the scene's folder"),
        (SMALLEST.replace("[pay", "trajectory = { time_s = [0, 0], x_m = [0, 1], z_m = [0, 0] }\n[pay"), "must rise"),
    ],
)
def test_a_scene_file_that_cannot_be_used_says_what_is_wrong(tmp_path, text, words):
    with pytest.raises(InputError, match=words) as caught:
        read_scene(written(tmp_path / "a.toml", text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["missing.toml", "."])
def test_a_scene_file_that_is_none_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"no such file|is a directory"):
        read_scene(tmp_path / name)


def test_a_table_beside_the_scene_file_moves_the_tool(tmp_path):
    written(tmp_path / "path.csv", "time_s,x_m,z_m\n0,0,0\n0.1,0.01,0\n0.2,0.03,0\n0.3,0.04,0\n")
    scene = read_scene(written(tmp_path / "a.toml", SMALLEST.replace("[pay", 'trajectory = "path.csv"\n[pay')))
    motion = simulate_scene(scene, scene.tool.start_s + np.array([0.0, 0.1, 0.2, 0.3, 0.5]))
    np.testing.assert_allclose(motion.tcp_m[:, 0], [0, 0.01, 0.03, 0.04, 0.04], atol=1e-12)
    written(tmp_path / "path.csv", "t,x_m,z_m\n0,0,0\n1,1,1\n")
    with pytest.raises(InputError, match="columns time_s, x_m, z_m"):
        read_scene(tmp_path / "a.toml")


@pytest.mark.parametrize("name", ["flexible", "stiff", "released", "bag"])
def test_a_sample_scene_swings_as_it_is_meant_to(name):
    scene = read_scene(SAMPLES / f"{name}.toml")
    motion = simulate_scene(scene)
    after = motion.time_s > motion.move_s[1]
    left = scene.payload.pendulum().tag_radius_m * np.abs(np.sin(motion.angle_rad[after]))
    assert scene.duration_s - motion.move_s[1] >= 2.5
    assert 0.3 < np.max(np.abs(motion.angle_rad)) < 0.9
    assert (0.005 < left.max() < 0.015) or name == "released"
    # published value: the two subsets' frequencies, half of the last digit
    published = {"flexible": 2.4727, "released": 2.4727, "stiff": 3.5906}
    if name in published:
        assert scene.payload.pendulum().natural_frequency_hz == pytest.approx(published[name], abs=0.5e-4)


def test_the_sample_videos_are_those_of_the_scene_files():
    videos = sorted(SAMPLES.glob("*.mp4"))
    if not videos:
        pytest.skip("the sample videos are not here: identify render makes them")
    assert sum(video.stat().st_size for video in videos) < 8e6
    for video in videos:
        scene, truth = read_scene(video.with_suffix(".toml")), read_truth(truth_path(video))
        assert truth.fps_hz == scene.video.fps_hz
        assert len(truth.frame) == round(scene.duration_s * scene.video.fps_hz)
        motion = simulate_scene(scene, np.array(truth.time_s))
        np.testing.assert_allclose(truth.angle_rad, motion.angle_rad, atol=1e-9)
        with av.open(str(video)) as container:
            assert container.streams.video[0].frames == len(truth.frame)


def test_a_rendered_video_comes_with_its_truth(tmp_path):
    scene = small_scene(duration_s=0.05)
    seen = []
    truth = render_scene(scene, tmp_path / "a.mp4", progress=lambda done, total: seen.append((done, total)))
    assert seen == [(i, 10) for i in range(1, 11)]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mp4", "a.truth.json"]
    assert read_truth(tmp_path / "a.truth.json") == truth
    assert json.loads((tmp_path / "a.truth.json").read_text())["schema"] == "tagsway/truth/1"
    images, times, rate = decode(tmp_path / "a.mp4")
    assert rate == 200
    np.testing.assert_allclose(times, truth.time_s, atol=1e-12)
    x, y = np.rint(truth.tags["tcp"].centre_px[0]).astype(int)
    assert np.ptp(images[0][y - 15 : y + 15, x - 15 : x + 15]) > 150


def test_a_film_that_breaks_off_leaves_nothing_behind(tmp_path):
    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_scene(released_scene(duration_s=0.1), tmp_path / "a.mp4", progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_place_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        render_scene(released_scene(duration_s=0.02), tmp_path / "none" / "a.mp4")


def test_the_header_may_claim_another_rate(tmp_path):
    video = VideoFormat(fps_hz=200.0, header_fps_hz=25.0)
    truth = render_scene(released_scene(duration_s=0.05, video=video), tmp_path / "a.mp4")
    _, times, rate = decode(tmp_path / "a.mp4")
    assert (rate, truth.header_fps_hz) == (25, 25.0)
    np.testing.assert_allclose(times, np.arange(10) / 25, atol=1e-9)
    np.testing.assert_allclose(truth.time_s, np.arange(10) / 200, atol=1e-12)


def test_the_file_has_the_true_times_of_jittered_and_lost_frames(tmp_path):
    video = VideoFormat(fps_hz=200.0, time_jitter_s=5e-4, lost=((4, 6),))
    truth = render_scene(released_scene(duration_s=0.1, video=video), tmp_path / "a.mp4")
    _, times, _ = decode(tmp_path / "a.mp4")
    assert len(times) == 17
    assert np.ptp(np.diff(truth.time_s)) > 1e-3
    # identity: half a unit of the file's clock
    np.testing.assert_allclose(times, truth.time_s, atol=0.5 / 90_000 + 1e-9)


def test_a_phone_s_clock_rounds_240_frames_a_second_to_two_periods(tmp_path):
    video = VideoFormat(fps_hz=240.0, time_rounding_s=1 / 600)
    render_scene(released_scene(duration_s=0.1, video=video), tmp_path / "a.mp4")
    _, times, _ = decode(tmp_path / "a.mp4")
    assert set(np.rint(np.diff(times) * 600).astype(int)) == {2, 3}
    np.testing.assert_allclose(times, np.arange(24) / 240, atol=0.5 / 600 + 1e-9)


@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("a.mp4", {"quality": 1.0}, 3),
        ("a.mp4", {"quality": 1.0, "full_range": False}, 3),
        ("a.mp4", {"codec": "hevc", "quality": 4.0}, 3),
        ("a.avi", {"codec": "mjpeg", "quality": 1.0}, 6),
        ("a.mkv", {"codec": "ffv1"}, 0),
        ("a.mp4", {"codec": "ffv1"}, 0),
        ("a.avi", {"codec": "raw"}, 0),
    ],
)
def test_every_codec_gives_the_grey_levels_back(tmp_path, name, options, error):
    frames = [np.kron(f[::8, ::8], np.ones((8, 8), np.uint8)) for f in ramp()]
    assert write_video(tmp_path / name, iter(frames), fps_hz=50.0, **options) == 12
    images, times, rate = decode(tmp_path / name)
    np.testing.assert_allclose(times, np.arange(12) / 50, atol=1e-9)
    assert rate == 50
    # discretisation: the codec's, at its best quality
    assert max(np.abs(a - b).max() for a, b in zip(images, frames, strict=True)) <= error


def test_the_same_images_give_the_same_bytes_whatever_was_in_memory(tmp_path):
    camera = SceneCamera(width=320, height=144, distance_m=1.5, focal_px=1000.0)
    images = [image.copy() for image in render_frames(small_scene(camera=camera, duration_s=0.2))]
    rng, files = np.random.default_rng(0), set()
    for _ in range(40):
        rng.random(int(rng.integers(1000, 300_000)))  # what is left of it is what uninitialised memory holds
        write_video(tmp_path / "film.mp4", images, fps_hz=120.0, quality=14.0)
        files.add((tmp_path / "film.mp4").read_bytes())
    assert len(files) == 1


def test_better_quality_costs_more_bytes(tmp_path):
    rng = np.random.default_rng(0)
    frames = [rng.integers(0, 256, (64, 64), dtype=np.uint8) for _ in range(5)]
    sizes = {}
    for codec, quality in (("h264", 10.0), ("h264", 35.0), ("mjpeg", 2.0), ("mjpeg", 25.0)):
        write_video(tmp_path / "a.mp4", iter(frames), fps_hz=50.0, codec=codec, quality=quality)
        sizes[codec, quality] = (tmp_path / "a.mp4").stat().st_size
    assert sizes["h264", 10.0] > 1.5 * sizes["h264", 35.0]
    assert sizes["mjpeg", 2.0] > 1.5 * sizes["mjpeg", 25.0]


def test_a_rate_that_is_no_whole_number_is_kept(tmp_path):
    write_video(tmp_path / "a.mp4", iter(ramp(30)), fps_hz=30000 / 1001)
    _, times, rate = decode(tmp_path / "a.mp4")
    assert rate == Fraction(30000, 1001)
    np.testing.assert_allclose(times, np.arange(30) * 1001 / 30000, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "frames", "options", "words"),
    [
        ("a.mp4", [], {}, "at least one frame"),
        ("a.mp4", ramp(2) + ramp(1, width=32), {}, "frame 2 is"),
        ("a.mp4", ramp(1, width=63), {}, "must be even"),
        ("a.mp4", ramp(2), {"fps_hz": float("nan")}, "frame rate must be positive"),
        ("a.mp4", ramp(2), {"fps_hz": 0.0}, "frame rate must be positive"),
        ("a.mp4", ramp(2), {"time_s": np.array([0.0, 0.0])}, "must rise from 0"),
        ("a.mp4", ramp(2), {"time_s": np.array([0.0, np.nan])}, "must rise from 0"),
        ("a.mp4", ramp(2), {"time_s": np.array([0.0, 1.0, 2.0])}, "2 frames, but 3 times"),
        ("a.mp4", ramp(2), {"time_s": np.array([0.0])}, "more frames than the 1 times"),
        ("a.avi", ramp(2), {"codec": "mjpeg", "time_s": np.array([0.0, 1.0])}, "holds no frame times"),
        ("a.mp4", ramp(2), {"codec": "raw"}, "raw goes into a file that ends in .mkv or .avi"),
        ("a.txt", ramp(2), {}, "goes into a file that ends in .mp4"),
        ("a.mp4", ramp(2), {"codec": "vp8"}, "no codec 'vp8'"),
        ("a.mp4", ramp(2), {"quality": -1.0}, "quality must be 0 or more"),
    ],
)
def test_a_video_that_cannot_be_written_says_why_and_leaves_nothing(tmp_path, name, frames, options, words):
    with pytest.raises(InputError, match=words):
        write_video(tmp_path / name, iter(frames), **{"fps_hz": 50.0} | options)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_in_another_codec_is_written_losslessly(tmp_path):
    scene = released_scene(duration_s=0.02, picture=Picture(noise_grey=2.0), video=VideoFormat(codec="ffv1"))
    scene = replace(scene, camera=SceneCamera(width=160, height=160, distance_m=1.5, focal_px=1000.0))
    render_scene(scene, tmp_path / "a.mkv")
    images, _, _ = decode(tmp_path / "a.mkv")
    for image, frame in zip(images, render_frames(scene), strict=True):
        np.testing.assert_array_equal(image, frame)
