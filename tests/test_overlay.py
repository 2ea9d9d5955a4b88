"""The overlay: every frame once, what was seen where it was seen, nothing where it was not."""

import shutil
from pathlib import Path

import av
import numpy as np
import pytest

from scenes import released_scene, small_scene
from tagsway.cli.app import run
from tagsway.model import Settings
from tagsway.pipeline import Measurement, identify, write_measurement
from tagsway.report.overlay import write_overlay
from tagsway.scene import render_scene
from tagsway.scene.optics import SceneCamera, VideoFormat
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import write_video

HIDDEN = range(180, 190)
"""Frames of the film in which everything right of its middle is covered."""


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> Path:
    """A film of 2.2 s at 100 fps in which both tags are hidden for 0.1 s of the decay."""
    folder = tmp_path_factory.mktemp("film")
    scene = small_scene(duration_s=2.2, video=VideoFormat(fps_hz=100.0, quality=14.0))
    render_scene(scene, folder / "whole.mp4")
    with read_frames(folder / "whole.mp4", read_clock(folder / "whole.mp4")) as frames:
        greys = [frame.grey.copy() for frame in frames]
    for k in HIDDEN:
        greys[k][:, 320:] = 128
    write_video(folder / "film.mp4", greys, fps_hz=100.0, quality=14.0)
    return folder / "film.mp4"


@pytest.fixture(scope="module")
def folder(film) -> Path:
    """What `identify film.mp4 --overlay` wrote."""
    out = film.parent / "out"
    assert run([str(film), "--tag-size", "30", "--out", str(out), "--overlay", "--quiet"]) == 0
    return out


@pytest.fixture(scope="module")
def measured(film) -> Measurement:
    return identify(film, Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03))


def images(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def warm(image: np.ndarray) -> np.ndarray:
    """Return where an image is orange, as the product's marks are and the grey film is not."""
    return image[..., 0].astype(int) - image[..., 2] > 60


def test_an_overlay_has_every_frame_once_and_plays_in_a_browser(film, folder) -> None:
    with av.open(str(folder / "overlay.mp4")) as container:
        stream = container.streams.video[0]
        frames = [frame.time for frame in container.decode(video=0)]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.width % 2 == stream.height % 2 == 0
    assert len(frames) == 220
    # 100 fps are more than a screen shows: half as fast, no frame left out; identity of the time base
    np.testing.assert_allclose(np.diff(frames), 0.02, atol=1e-4)


def test_a_tag_is_outlined_where_it_was_seen_and_nowhere_else(measured, folder) -> None:
    pcp = measured.sightings.tag(1)
    drawn = images(folder / "overlay.mp4")
    scale = drawn[0].shape[1] / 640
    for k in (30, 100, 210):
        x, y = np.rint(scale * (pcp.corners_px[k] + np.roll(pcp.corners_px[k], 1, axis=0)) / 2).astype(int).T
        orange = warm(drawn[k])
        # the middles of the four edges, to the width of the line
        assert all(orange[b - 2 : b + 3, a - 2 : a + 3].any() for a, b in zip(x, y, strict=True)), k
    hidden = drawn[HIDDEN[5]][: round(360 * scale)]
    words = warm(hidden)[: round(60 * scale), : round(200 * scale)]
    assert words.any()  # "PCP lost"
    assert not warm(drawn[100])[: round(40 * scale), : round(200 * scale)].any()


def test_an_overlay_afterwards_does_not_track_again(film, folder, monkeypatch) -> None:
    import tagsway.pipeline.recording as recording

    copy = folder.with_name("again")
    shutil.copytree(folder, copy)
    (copy / "overlay.mp4").unlink()

    def refuse(*_, **__):
        raise AssertionError("tracked again")

    monkeypatch.setattr(recording, "track_video", refuse)
    assert run([str(film), "--tag-size", "30", "--out", str(copy), "--overlay", "--quiet"]) == 0
    first, second = images(folder / "overlay.mp4"), images(copy / "overlay.mp4")
    assert len(first) == len(second)
    assert all(np.abs(a.astype(int) - b).mean() < 0.1 for a, b in zip(first, second, strict=True))
    assert run([str(film), "--tag-size", "30", "--out", str(copy), "--quiet"]) == 0
    assert not (copy / "overlay.mp4").exists()  # no file of another run is left


def test_a_table_has_no_overlay(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("track.csv").write_text("time_s,x_mm\n0,1\n1,2\n")
    assert run(["track.csv", "--overlay"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "--overlay" in line
    assert "track.csv" in line
    assert [path.name for path in tmp_path.iterdir()] == ["track.csv"]


def test_an_interrupted_overlay_leaves_nothing(film, measured, tmp_path) -> None:
    def interrupt(done: int, total: int) -> None:
        assert total == 220
        if done == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_measurement(measured, tmp_path / "out", film=film, progress=interrupt)
    assert not list(tmp_path.rglob("*"))


def test_a_film_without_a_result_still_shows_what_was_seen(tmp_path) -> None:
    # odd sides, small, upright, slow: enlarged for the words, padded to even, at its own rate
    film = tmp_path / "film.mkv"
    scene = released_scene(camera=SceneCamera(width=180, height=320, distance_m=1.5, focal_px=1200.0), duration_s=0.4)
    render_scene(scene, tmp_path / "whole.mp4")
    with read_frames(tmp_path / "whole.mp4", read_clock(tmp_path / "whole.mp4")) as frames:
        greys = [frame.grey[:-1, :-1].copy() for frame in frames][::8]
    with av.open(str(film), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 179, 319, "gray"
        for grey in greys:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="gray")))
        container.mux(stream.encode(None))
    measured = identify(film, Settings())
    assert measured.not_determined is not None
    count = write_overlay(
        tmp_path / "overlay.mp4",
        film,
        result=measured.result,
        sightings=measured.sightings,
        track=measured.track,
    )
    drawn = images(tmp_path / "overlay.mp4")
    assert count == len(drawn) == len(greys)
    assert drawn[0].shape[1] == 480
