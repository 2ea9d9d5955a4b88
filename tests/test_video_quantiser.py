"""What a film tells of its coder, and the decoder of its quantiser."""

import gc
import math
from pathlib import Path

import av
import numpy as np
import pytest

from tagsway.video.quantiser import find_coder
from tagsway.video.reading import read_clock, read_frames

SHAPE = (64, 96)


def write(path: Path, encoder: str, options: dict[str, str], quantiser: int = 0) -> Path:
    """Write a wall that moves, and is never the same."""
    rng = np.random.default_rng(0)
    wall = rng.uniform(60, 200, (SHAPE[0], SHAPE[1] + 20))
    with av.open(str(path), "w") as container:
        stream = container.add_stream(encoder, rate=50, options=options)
        stream.width, stream.height, stream.pix_fmt = SHAPE[1], SHAPE[0], "yuv420p"
        stream.codec_context.thread_count = 1
        if quantiser:
            stream.codec_context.qmin = stream.codec_context.qmax = quantiser
        for k in range(10):
            frame = av.VideoFrame(SHAPE[1], SHAPE[0], "yuv420p")
            for index, plane in enumerate(frame.planes):
                rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
                rows[:, : plane.width] = wall[:, k : k + SHAPE[1]] + rng.normal(size=SHAPE) if index == 0 else 128
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def steps(path: Path) -> list[float]:
    with read_frames(path, read_clock(path)) as frames:
        return [frame.coding.step for frame in frames]


@pytest.mark.parametrize(
    ("encoder", "suffix", "quantiser", "expected"),
    # identity: twice the quantiser, one less where that is odd; 0.46 of it for MPEG-2
    [("mpeg4", ".avi", 5, 9.0), ("mpeg4", ".avi", 6, 12.0), ("mpeg2video", ".mkv", 5, 4.6), ("flv", ".flv", 5, 9.0)],
)
def test_the_step_of_coders_with_half_pixels_is_known(
    tmp_path: Path, encoder: str, suffix: str, quantiser: int, expected: float
) -> None:
    found = steps(write(tmp_path / f"clip{suffix}", encoder, {}, quantiser))
    assert math.isnan(found[0])  # nothing was predicted yet
    assert found[1:] == pytest.approx([expected] * 9)


@pytest.mark.parametrize(
    ("preset", "family", "share"),
    [
        ("ultrafast", "whole", 1.0),
        ("superfast", "h264", 1.9),
        ("faster", "h264", 1.0),
        ("fast", "x264_rd", 1.0),
        ("slow", "x264_rd", 1.0),
    ],
)
def test_h264_is_known_by_the_note_of_the_coder(tmp_path: Path, preset: str, family: str, share: float) -> None:
    path = write(tmp_path / "clip.mp4", "libx264", {"preset": preset, "qp": "30", "tune": "zerolatency"})
    with read_frames(path, read_clock(path)) as frames:
        found = [frame.coding for frame in frames]
    assert {coding.family for coding in found} == {family}
    steps_told = [coding.step for coding in found[1:]]
    # identity: 0.625 grey levels, doubled every six quantisers
    assert steps_told == pytest.approx([share * 0.625 * 2**5] * 9)


def test_a_coder_that_loses_nothing_has_no_step(tmp_path: Path) -> None:
    assert steps(write(tmp_path / "clip.mkv", "libx264", {"preset": "faster", "qp": "0"}))[1:] == [0.0] * 9


@pytest.mark.parametrize(
    ("preset", "family"),
    [("ultrafast", "x265_ultrafast"), ("superfast", "x265"), ("fast", "x265"), ("medium", "x265_rd")],
)
def test_hevc_is_known_by_the_note_of_the_coder_and_tells_no_step(tmp_path: Path, preset: str, family: str) -> None:
    options = {"preset": preset, "x265-params": "log-level=none:pools=1:frame-threads=1"}
    path = write(tmp_path / "clip.mp4", "libx265", options)
    with read_frames(path, read_clock(path)) as frames:
        found = [frame.coding for frame in frames]
    assert {coding.family for coding in found} == {family}
    assert all(math.isnan(coding.step) for coding in found)


def test_hevc_without_a_note_is_of_an_unknown_coder(tmp_path: Path) -> None:
    options = {"preset": "medium", "x265-params": "log-level=none:pools=1:frame-threads=1:info=0"}
    path = write(tmp_path / "clip.mp4", "libx265", options)
    with read_frames(path, read_clock(path)) as frames:
        assert {frame.coding.family for frame in frames} == {"hevc"}


def test_each_image_tells_its_own_step_and_whether_it_was_made_from_both_sides(tmp_path: Path) -> None:
    options = {"preset": "faster", "qp": "24", "x264-params": "threads=1:b-adapt=0:bframes=2:scenecut=0:b-pyramid=none"}
    path = write(tmp_path / "clip.mp4", "libx264", options)
    with read_frames(path, read_clock(path)) as frames:
        found = [frame.coding for frame in frames]
    # identity: the first, then two between and one across, again and again
    assert [coding.between for coding in found] == [False, *([True, True, False] * 3)]
    steps_told = {between: {coding.step for coding in found[1:] if coding.between == between} for between in (0, 1)}
    # identity: 10 grey levels at a quantiser of 24; x264's images between have one that is coarser by a factor of 1.3
    assert steps_told[0] == {10.0}
    assert min(steps_told[1]) > 12
    assert max(steps_told[1]) < 14


def test_the_step_of_vp9_grows_with_its_quantiser(tmp_path: Path) -> None:
    fine, coarse = (
        steps(write(tmp_path / f"{crf}.mkv", "libvpx-vp9", {"crf": crf, "b": "0", "cpu-used": "8"}))[-1]
        for crf in ("10", "40")
    )
    assert 1 < fine < coarse / 2


def test_coders_without_a_note_are_taken_for_fine_ones() -> None:
    assert find_coder("h264", b"\x00\x00\x01\x65 subme=0 ")[0].family == "h264"
    assert find_coder("hevc", b"")[0].family == "hevc"
    assert find_coder("mpeg4", b"")[0].family == "half"
    assert find_coder("vp8", b"")[0].family == "vp8"
    assert find_coder("ffv1", b"")[0].family == "other"


def test_an_image_is_let_go_at_once_though_its_quantiser_was_read(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.avi", "mpeg4", {}, 5)
    gc.collect()
    gc.disable()
    try:
        assert not math.isnan(steps(path)[-1])
        kept = sum(isinstance(thing, av.VideoFrame) for thing in gc.get_objects())
    finally:
        gc.enable()
    assert kept == 0
