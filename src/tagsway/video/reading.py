"""Read a film: first its stamps, then its images, decoded ahead in threads of their own."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np
from scipy.ndimage import percentile_filter

from tagsway.errors import InputError
from tagsway.model import BoolArray, Frame, GreyArray, Notice, VideoInfo
from tagsway.video.ahead import DecodedAhead
from tagsway.video.clock import Clock, count_clock, fit_clock
from tagsway.video.opening import open_source
from tagsway.video.runs import share_out
from tagsway.video.source import Stamps

_THINNED = (32, 80)  # rows and columns of pixels that tell whether an image is new
_REPEATED = 0.25  # of the usual change from image to image; a repeated one, coded again, has shown up to 0.13
_USUAL_PERCENT, _AROUND = 90, 21  # of the changes around, of which three in four may be repeated images'


def read_clock(path: Path | str, *, fps_hz: float | None = None) -> Clock:
    """Return when each frame of a film was taken, without decoding it.

    Parameters
    ----------
    path : Path or str
        What `tagsway.video.opening.open_source` reads.
    fps_hz : float or None
        Capture rate, where the file's is another: high-speed cameras write the rate of playback, images none.

    Returns
    -------
    Clock
        Of all frames that there are.

    Raises
    ------
    InputError
        Where there is nothing to read, with the reason.
    """
    stamps = open_source(path).read_stamps()
    if len(stamps.ticks) < 2:
        raise InputError(f"{path} holds {_count(len(stamps.ticks), 'frame')}: expected a video of at least two")
    try:
        clock = _make_clock(stamps, fps_hz)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return replace(clock, runs=stamps.runs, notices=(*clock.notices, *stamps.notices))


def _make_clock(stamps: Stamps, fps_hz: float | None) -> Clock:
    if stamps.is_count:
        return count_clock(stamps.ticks, tick_s=stamps.tick_s, fps_hz=fps_hz)
    return fit_clock(
        stamps.ticks,
        tick_s=stamps.tick_s,
        header_hz=stamps.header_hz,
        fps_hz=fps_hz,
        captured_hz=stamps.captured_hz,
        by_order=stamps.by_order,
    )


def read_frames(
    path: Path | str, clock: Clock, *, decoder_threads: int = 1, queue_frames: int = 32, full_range: bool = True
) -> "FrameReader":
    """Return an iterator over the grey images of a film.

    Parameters
    ----------
    path : Path or str
        As for `read_clock`.
    clock : Clock
        What that returned.
    decoder_threads : int
        Of the decoder, beside the thread that calls; or of as many decoders, where the film has runs of images that
        need no others (`tagsway.video.runs`).
    queue_frames : int
        How many images may wait, fewer where they are larger than 1.5 Mpx: with the decoders' own, and up to 512 MB of
        later runs, all the memory that a video of any length takes. They bridge the times at which a tag is looked for.
    full_range : bool
        False leaves luma of limited range (16..235) as it is coded, which saves a pass over each image; a tag's
        alignment fits gain and offset and does not mind.

    Returns
    -------
    FrameReader
        Its `info`, `repeated` and `notices` are complete after the last image. Close it, or use it in a `with`, where
        it may be left before.
    """
    return FrameReader(path, clock, decoder_threads=decoder_threads, queue_frames=queue_frames, full_range=full_range)


class FrameReader(Iterator[Frame]):
    """Iterates over the images of a film, decoded ahead; made by `read_frames`.

    Images are views of the decoder's memory where they can be: do not write to them.
    """

    def __init__(
        self, path: Path | str, clock: Clock, *, decoder_threads: int, queue_frames: int, full_range: bool
    ) -> None:
        self._path = path
        self._clock = clock
        self._full_range = full_range
        decoders = clock.runs.count_decoders(decoder_threads)
        sources = [open_source(path) for _ in range(decoders)]
        self._source = sources[0]
        self._decoded = DecodedAhead(
            sources,
            share_out(clock.runs, decoders),
            threads=decoder_threads,
            queue_frames=queue_frames,
            later_frames=(decoders - 1) * clock.runs.longest,
        )
        self._ended = False
        self._read = self._taken = 0
        self._size = (0, 0)
        self._last: GreyArray | None = None
        self._changes = np.full(len(clock.stamps), np.inf)

    def __iter__(self) -> Self:
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __next__(self) -> Frame:
        while not self._ended:
            entry = self._decoded.take()
            if entry is None:
                self._end()
            else:
                place = self._place(entry[0])
                if place is not None:
                    return self._make_frame(entry[1], place)
        raise StopIteration

    def close(self) -> None:
        """Stop decoding and wait for its threads; images that were handed out stay valid."""
        self._ended = True
        self._last = None
        self._decoded.close()

    @property
    def info(self) -> VideoInfo:
        """What is known of the video; of the images read so far."""
        clock = self._clock
        return VideoInfo(
            frames=self._read,
            fps_hz=clock.fps_hz,
            time_source=clock.time_source,
            pts_rounding_s=clock.pts_rounding_s,
            dropped=clock.dropped + self._taken - self._read,
            duplicated=clock.duplicated,
            width=self._size[0],
            height=self._size[1],
            duration_s=float(clock.time_s[self._taken - 1]) + 1 / clock.fps_hz if self._taken else 0.0,
        )

    @property
    def repeated(self) -> BoolArray:
        """Which frames of the clock seem to hold the image before them once more; shape (n,).

        So does a scene at rest: see `tagsway.tracks.repeats`.
        """
        read = np.isfinite(self._changes)
        repeated = np.zeros(len(read), dtype=bool)
        if read.any():
            usual = percentile_filter(self._changes[read], _USUAL_PERCENT, size=_AROUND)
            repeated[read] = self._changes[read] <= _REPEATED * usual
        return repeated

    @property
    def turns(self) -> int:
        """Quarter turns, counter-clockwise, from the sensor's image to the upright one."""
        return self._source.turns

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What the user should know of the film; complete after the last image."""
        notices = list(self._clock.notices)
        lost = len(self._clock.stamps) - self._read
        if self._ended and lost > 0 and not any(notice.code == "truncated" for notice in notices):
            words = f"{lost} of the video's {len(self._clock.stamps)} frames could not be decoded and were left out"
            notices.append(Notice(code="damaged_frames", message=words))
        return (*notices, *self._source.notices())

    def _end(self) -> None:
        self.close()
        if self._read < 2:
            raise InputError(
                f"{self._path}: {_count(self._read, 'image')} could be decoded: expected a video of at least two"
            )

    def _place(self, stamp: int | None) -> int | None:
        """Return an image's place in the clock; None for one whose stamp was there before."""
        stamps = self._clock.stamps
        place = self._taken
        is_next = place < len(stamps) and (self._clock.by_order or stamp is None or stamps[place] == stamp)
        if not is_next and stamp is not None and not self._clock.by_order:
            place = int(np.searchsorted(stamps, stamp))
            if place >= len(stamps) or stamps[place] != stamp:
                place = self._taken
        return place if self._taken <= place < len(stamps) else None

    def _make_frame(self, picture: Any, place: int) -> Frame:
        grey = self._source.read_grey(picture, full_range=self._full_range)
        size = (grey.shape[1], grey.shape[0])
        if self._read and size != self._size:
            self.close()
            raise InputError(
                f"{self._path}: the image size changes from {self._size[0]} x {self._size[1]} to {size[0]} x {size[1]} "
                f"at frame {place}: expected one size throughout; cut the video there"
            )
        if not self._read:
            self._decoded.allow(grey.size)
        self._size = size
        self._changes[place] = self._measure_change(grey)
        self._read += 1
        self._taken = place + 1
        time_s = float(self._clock.time_s[place])
        return Frame(
            index=place,
            time_s=time_s,
            grey=grey,
            predicted=self._source.predicted,
            coding=self._source.coding,
        )

    def _measure_change(self, grey: GreyArray) -> float:
        """Return by how much some pixels differ from the image before, on average; infinity for the first."""
        down, right = (max(side // count, 1) for side, count in zip(grey.shape, _THINNED, strict=True))
        thinned = np.ascontiguousarray(grey[::down, ::right])
        change = math.inf if self._last is None else cv2.norm(thinned, self._last, cv2.NORM_L1) / thinned.size
        self._last = thinned
        return change


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")
