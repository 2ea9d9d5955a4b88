"""What a decoder tells of coders that move blocks by whole or half pixels."""

from pathlib import Path

import av
import numpy as np
import pytest

from tagsway.video.quantiser import find_coarseness
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
        return [frame.coarse_step for frame in frames]


@pytest.mark.parametrize(
    ("encoder", "suffix", "expected"),
    [("mpeg4", ".avi", 10.0), ("mpeg2video", ".mkv", 5.0), ("flv", ".flv", 10.0)],
)
def test_the_step_of_coders_with_half_pixels_is_known(
    tmp_path: Path, encoder: str, suffix: str, expected: float
) -> None:
    found = steps(write(tmp_path / f"clip{suffix}", encoder, {}, 5))
    assert found[0] == 0  # nothing was predicted yet
    assert found[1:] == pytest.approx([expected] * 9)  # identity: twice the quantiser; half of it for MPEG-2


@pytest.mark.parametrize(("preset", "expected"), [("ultrafast", 0.625 * 2**5), ("superfast", 0.0)])
def test_whole_pixels_are_known_by_the_note_of_the_coder(tmp_path: Path, preset: str, expected: float) -> None:
    options = {"preset": preset, "qp": "30", "tune": "zerolatency"}
    found = steps(write(tmp_path / "clip.mp4", "libx264", options))
    assert found[1:] == pytest.approx([expected] * 9)  # identity: 0.625 grey levels, doubled every six quantisers


def test_coders_without_a_note_are_taken_for_fine_ones() -> None:
    assert find_coarseness("h264", b"\x00\x00\x01\x65 subme=0 ") == 0
    assert find_coarseness("hevc", b"") == 0
    assert find_coarseness("mpeg4", b"") == 1
