"""Several decoders that share out a film's runs: the images are those of one decoder, in their order."""

import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.model import GreyArray
from tagsway.video.ahead import DecodedAhead
from tagsway.video.opening import open_source
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.runs import Runs, Share, cut_evenly, share_out
from tagsway.video.source import WHOLE, Entry, Source
from test_video_reading import write

FRAMES = 50
CLOSED = {"g": "10", "keyint_min": "10", "bf": "3", "x264-params": "scenecut=0"}


def pan() -> list[GreyArray]:
    """A texture that moves: what is made from another image than the coder's comes out wrong."""
    rng = np.random.default_rng(3)
    wall = cv2.GaussianBlur(rng.normal(size=(140, 300)), (0, 0), 3)
    wall = np.clip(128 + 50 * wall / wall.std(), 0, 255).astype(np.uint8)
    return [wall[k : k + 66, 3 * k : 3 * k + 100] for k in range(FRAMES)]


def decode_plainly(path: Path) -> list[GreyArray]:
    with av.open(str(path)) as container:
        return [picture.to_ndarray()[:66, :100] for picture in container.decode(video=0)]


@pytest.mark.parametrize(
    ("name", "how", "decoders"),
    [
        ("closed.mp4", {"options": CLOSED}, 3),
        ("closed.mkv", {"options": CLOSED}, 3),
        ("closed.avi", {"options": CLOSED | {"bf": "0"}}, 3),
        ("closed.ts", {"options": CLOSED}, 3),
        # Images after a key image are made from some before it: nothing can begin there.
        ("open.mp4", {"options": CLOSED | {"x264-params": "scenecut=0:open-gop=1"}}, 1),
        ("intra_refresh.mkv", {"options": {"g": "10", "x264-params": "scenecut=0:intra-refresh=1"}}, 1),
        ("closed_hevc.mp4", {"codec": "libx265", "options": {"x265-params": "keyint=10:open-gop=0:log-level=1"}}, 3),
        ("open_hevc.mp4", {"codec": "libx265", "options": {"x265-params": "keyint=10:open-gop=1:log-level=1"}}, 1),
        ("jpeg.avi", {"codec": "mjpeg", "form": "yuvj420p", "range": "JPEG"}, 3),
        ("ffv1.mkv", {"codec": "ffv1", "form": "gray"}, 1),
        ("raw.avi", {"codec": "rawvideo", "form": "gray"}, 1),
        ("b_frames.avi", {"codec": "mpeg4", "options": {"bf": "2", "g": "10"}}, 1),
    ],
)
def test_several_decoders_give_what_one_does(tmp_path: Path, name: str, how: dict[str, Any], decoders: int) -> None:
    path = write(tmp_path / name, pan(), **how)
    clock = read_clock(path)
    assert clock.runs.count_decoders(3) == decoders
    with read_frames(path, clock, decoder_threads=3, full_range=False) as reader:
        frames = list(reader)
    wanted = decode_plainly(path)
    assert len(frames) == len(wanted) == FRAMES
    np.testing.assert_array_equal([frame.grey for frame in frames], wanted)
    np.testing.assert_allclose([frame.time_s for frame in frames], clock.time_s)
    assert reader.notices == ()


@pytest.mark.parametrize("gop", ["0", "1"])
def test_a_film_tells_its_quantiser_the_same_each_time(tmp_path: Path, gop: str) -> None:
    path = write(tmp_path / "a.mp4", pan(), options=CLOSED | {"x264-params": f"scenecut=0:open-gop={gop}"})
    told = set()
    for _ in range(12):
        with read_frames(path, read_clock(path), decoder_threads=4, full_range=False) as reader:
            told.add(tuple(frame.coding.step for frame in reader if frame.index > 9))
    assert len(told) == 1
    assert min(told.pop()) > 0


def test_numbered_images_are_shared_out(tmp_path: Path) -> None:
    for k, image in enumerate(pan()):
        cv2.imwrite(str(tmp_path / f"{k:04d}.png"), image)
    (tmp_path / "0007.png").unlink()
    (tmp_path / "0011.png").write_bytes(b"no image")
    clock = read_clock(tmp_path, fps_hz=100.0)
    assert clock.runs.count_decoders(3) == 3
    with read_frames(tmp_path, clock, decoder_threads=3) as reader:
        frames = list(reader)
    kept = [k for k in range(FRAMES) if k not in (7, 11)]
    np.testing.assert_allclose([frame.time_s for frame in frames], np.array(kept) / 100)
    np.testing.assert_array_equal([frame.grey for frame in frames], [pan()[k] for k in kept])


def test_runs_that_need_the_parameters_of_others_stay_together(tmp_path: Path) -> None:
    first = write(tmp_path / "first.h264", pan(), options=CLOSED)
    other = write(tmp_path / "other.h264", pan(), options=CLOSED | {"x264-params": "scenecut=0:cabac=0:ref=1"})
    path = tmp_path / "both.h264"
    content = other.read_bytes()
    units = [found.start() for found in re.finditer(b"\x00\x00\x01", content)]
    kinds = [content[place + 3] & 0x1F for place in units]
    seen, kept = set(), b""
    for place, end, kind in zip(units, [*units[1:], len(content)], kinds, strict=True):
        if kind not in (7, 8) or kind not in seen:  # of the second film the parameter sets come once
            kept += content[place:end]
        seen.add(kind)
    path.write_bytes(first.read_bytes() + kept)
    clock = read_clock(path, fps_hz=30.0)
    assert len(clock.runs.starts) == FRAMES // 10 + 1
    with read_frames(path, clock, decoder_threads=3, full_range=False) as reader:
        frames = list(reader)
    np.testing.assert_array_equal([frame.grey for frame in frames], decode_plainly(path))


def test_a_header_that_changes_on_the_way_is_told_to_every_decoder(tmp_path: Path) -> None:
    first = write(tmp_path / "first.flv", pan(), options=CLOSED)
    plainer = CLOSED | {"x264-params": "scenecut=0:cabac=0:ref=1"}
    later = write(tmp_path / "later.flv", pan(), options=plainer, stamps=list(range(2 * FRAMES, 3 * FRAMES)))
    path = tmp_path / "both.flv"
    path.write_bytes(first.read_bytes() + later.read_bytes()[13:])  # without the file's own header
    clock = read_clock(path)
    with read_frames(path, clock, decoder_threads=3, full_range=False) as reader:
        frames = list(reader)
    np.testing.assert_array_equal([frame.grey for frame in frames], decode_plainly(path))
    assert len(frames) == 2 * FRAMES


def test_a_run_that_is_damaged_costs_itself_alone(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", pan(), options=CLOSED)
    content = bytearray(path.read_bytes())
    with av.open(str(path)) as container:
        packets = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    for place, size in packets[20:30]:
        content[place + 5 : place + size] = bytes(size - 5)
    path.write_bytes(content)
    with read_frames(path, read_clock(path), decoder_threads=2, full_range=False) as reader:
        frames = {frame.index: frame.grey for frame in reader}
    wanted = decode_plainly(write(tmp_path / "whole.mp4", pan(), options=CLOSED))
    for index in [*range(20), *range(30, FRAMES)]:
        np.testing.assert_array_equal(frames[index], wanted[index])


def test_decoders_without_a_place_to_spare_come_to_the_end(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", pan(), options=CLOSED)
    shares = share_out(read_clock(path).runs, 3)
    ahead = DecodedAhead([open_source(path) for _ in shares], shares, threads=3, queue_frames=1, later_frames=0)
    stamps = []
    while (entry := ahead.take()) is not None:
        stamps.append(entry[0])
    assert len(stamps) == FRAMES
    assert stamps == sorted(stamps)


def test_what_waits_of_later_runs_is_bounded(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", pan(), options=CLOSED)
    shares = share_out(read_clock(path).runs, 2)
    ahead = DecodedAhead([open_source(path) for _ in shares], shares, threads=2, queue_frames=4, later_frames=3)
    taken: Any = [ahead.take()]
    ahead.allow(1)
    for _ in range(500):
        if ahead._shared.empty() and all(own.empty() for own in ahead._own):
            break
        time.sleep(0.02)
    time.sleep(0.1)
    assert ahead._shared.empty()
    assert all(own.empty() for own in ahead._own)
    assert all(thread.is_alive() for thread in ahead._threads)  # they wait for places: the film is longer
    while (entry := ahead.take()) is not None:
        taken.append(entry)
    assert len(taken) == FRAMES


def test_leaving_early_leaves_none_of_the_threads(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", pan(), options=CLOSED)
    before = threading.active_count()
    with read_frames(path, read_clock(path), decoder_threads=3, queue_frames=2) as reader:
        next(reader)
        assert threading.active_count() == before + 3
    assert threading.active_count() == before


class _Stopping:
    """A film whose images cannot be read on from a place."""

    def __init__(self, source: Source, stops_at: int) -> None:
        self._source, self._stops_at = source, stops_at

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        for run in self._source.decode(threads, share):
            yield self._read(run)

    def _read(self, run: Iterator[Entry]) -> Iterator[Entry]:
        for entry in run:
            if entry[0] == self._stops_at:
                raise InputError("the disk is gone")
            yield entry


def test_what_stops_a_decoder_is_raised_where_its_images_would_come(tmp_path: Path) -> None:
    for k, image in enumerate(pan()):
        cv2.imwrite(str(tmp_path / f"{k:04d}.png"), image)
    shares = share_out(cut_evenly(FRAMES), 2)
    sources: Any = [_Stopping(open_source(tmp_path), 13) for _ in shares]
    ahead = DecodedAhead(sources, shares, threads=2, queue_frames=8, later_frames=8)
    for number in range(13):
        entry = ahead.take()
        assert entry is not None
        assert entry[0] == number
    with pytest.raises(InputError, match="the disk is gone"):
        ahead.take()
    assert ahead.take() is None


class _Slow:
    """A film whose images take longer than the reader looks for them without being woken."""

    def __init__(self, source: Source) -> None:
        self._source = source

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        for run in self._source.decode(threads, share):
            yield self._read(run)

    def _read(self, run: Iterator[Entry]) -> Iterator[Entry]:
        for entry in run:
            time.sleep(0.03)
            yield entry


def test_slow_images_are_waited_for(tmp_path: Path) -> None:
    for k, image in enumerate(pan()[:6]):
        cv2.imwrite(str(tmp_path / f"{k:04d}.png"), image)
    sources: Any = [_Slow(open_source(tmp_path))]
    ahead = DecodedAhead(sources, [WHOLE], threads=1, queue_frames=8, later_frames=0)
    taken = [ahead.take() for _ in range(7)]
    assert [None if entry is None else entry[0] for entry in taken] == [0, 1, 2, 3, 4, 5, None]


@pytest.mark.parametrize(
    ("runs", "threads", "decoders"),
    [
        (Runs(), 4, 1),
        (Runs(starts=np.array([0, 250, 500]), packets=750, image_bytes=2_000_000), 1, 1),
        (Runs(starts=np.array([0, 250, 500]), packets=750, image_bytes=2_000_000), 4, 2),  # 500 MB lie ready
        (Runs(starts=np.array([0, 250, 500]), packets=750, image_bytes=20_000_000), 4, 1),  # 5 GB would
        (Runs(starts=np.array([0, 30, 60]), packets=90, image_bytes=3_000_000), 4, 3),  # no more than there are runs
        (cut_evenly(100, image_bytes=2_000_000), 4, 4),
        (cut_evenly(0), 4, 1),
    ],
)
def test_there_are_as_many_decoders_as_memory_and_runs_allow(runs: Runs, threads: int, decoders: int) -> None:
    assert runs.count_decoders(threads) == decoders


def test_shares_take_every_packet_once() -> None:
    runs = Runs(starts=np.array([0, 3, 4, 9]), packets=12)
    parts = [[list(run) for run in share.pick(range(12))] for share in share_out(runs, 3)]
    assert parts == [[[0, 1, 2], [9, 10, 11]], [[3]], [[4, 5, 6, 7, 8]]]
