"""Read a video: first its stamps, then its images, decoded in a thread of their own."""

import queue
import re
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import av
import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import Frame, GreyArray, IntArray, Notice, VideoInfo
from tagsway.video.clock import Clock, fit_clock

_CAPTURE_RATE_KEYS = ("com.android.capture.fps", "com.android.capturefps", "capture_fps", "capturefps")
_LUMA_FIRST = re.compile(r"^(?:yuvj?a?\d{3}p|nv\d\d|gray)(?:\d+le)?$")
_FULL_RANGE = 2  # AVCOL_RANGE_JPEG
_BLACK, _WHITE = 16, 235  # of 8-bit luma in limited range


def read_clock(path: Path | str, *, fps_hz: float | None = None) -> Clock:
    """Return when each frame of a video was taken, without decoding it.

    Parameters
    ----------
    path : Path or str
        A video file, or a pattern of images such as ``frames/%06d.png``.
    fps_hz : float or None
        Capture rate, where the file's is another: high-speed cameras write the rate of playback.

    Returns
    -------
    Clock
        Of all frames that the container holds.

    Raises
    ------
    InputError
        Where there is nothing to read, with the reason.
    """
    with _open(path) as container:
        stream = _video_stream(container, path)
        stamps, by_order, tick_s = _read_stamps(container, stream)
        if len(stamps) < 2:
            raise InputError(f"{path} holds {_count(len(stamps), 'frame')}: expected a video of at least two")
        rate = stream.average_rate or stream.guessed_rate
        header_hz = float(rate) if rate else None
        cut_off = _notice_truncated(container, stream, stamps, tick_s)
        captured_hz = _captured_rate({**container.metadata, **stream.metadata})
    try:
        clock = fit_clock(
            stamps, tick_s=tick_s, header_hz=header_hz, fps_hz=fps_hz, captured_hz=captured_hz, by_order=by_order
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return replace(clock, notices=(*clock.notices, *cut_off))


def read_frames(
    path: Path | str, clock: Clock, *, decoder_threads: int = 1, queue_frames: int = 8, full_range: bool = True
) -> "FrameReader":
    """Return an iterator over the grey images of a video.

    Parameters
    ----------
    path : Path or str
        As for `read_clock`.
    clock : Clock
        What that returned.
    decoder_threads : int
        Of the decoder, beside the thread that calls.
    queue_frames : int
        How many images may wait: with the decoder's own, all the memory that a video of any length takes.
    full_range : bool
        False leaves luma of limited range (16..235) as it is coded, which saves a pass over each image; a tag's
        alignment fits gain and offset and does not mind.

    Returns
    -------
    FrameReader
        Its `info` and `notices` are complete after the last image. Close it, or use it in a `with`, where it may be
        left before.
    """
    return FrameReader(path, clock, decoder_threads=decoder_threads, queue_frames=queue_frames, full_range=full_range)


class FrameReader(Iterator[Frame]):
    """Iterates over the images of a video, decoded ahead in a thread; made by `read_frames`.

    Images are views of the decoder's memory where they can be: do not write to them.
    """

    def __init__(
        self, path: Path | str, clock: Clock, *, decoder_threads: int, queue_frames: int, full_range: bool
    ) -> None:
        self._path = path
        self._clock = clock
        self._full_range = full_range
        self._queue: queue.Queue[Any] = queue.Queue(maxsize=max(queue_frames, 1))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._decode, args=(decoder_threads,), name="decoder", daemon=True)
        self._started = self._ended = False
        self._read = self._taken = 0
        self._size = (0, 0)
        self._interlaced = False

    def __iter__(self) -> Self:
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __next__(self) -> Frame:
        if not self._started:
            self._started = True
            self._thread.start()
        while not self._ended:
            image = self._queue.get()
            if image is None:
                self._end()
            elif isinstance(image, BaseException):
                self.close()
                raise image
            else:
                place = self._place(image)
                if place is not None:
                    return self._make_frame(image, place)
        raise StopIteration

    def close(self) -> None:
        """Stop decoding and wait for the thread; images that were handed out stay valid."""
        self._stop.set()
        self._ended = True
        if self._started:
            while self._thread.is_alive():
                with suppress(queue.Empty):
                    self._queue.get(timeout=0.01)
            self._thread.join()

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
    def notices(self) -> tuple[Notice, ...]:
        """What the user should know of the file; complete after the last image."""
        notices = list(self._clock.notices)
        lost = len(self._clock.stamps) - self._read
        if self._ended and lost > 0 and not any(notice.code == "truncated" for notice in notices):
            words = f"{lost} of the video's {len(self._clock.stamps)} frames could not be decoded and were left out"
            notices.append(Notice(code="damaged_frames", message=words))
        if self._interlaced:
            words = "the video is interlaced: the two halves of each image are half a period apart in time"
            notices.append(Notice(code="interlaced", message=words))
        return tuple(notices)

    def _end(self) -> None:
        self.close()
        if self._read < 2:
            raise InputError(
                f"{self._path}: {_count(self._read, 'image')} could be decoded: expected a video of at least two"
            )

    def _place(self, image: Any) -> int | None:
        """Return the image's place in the clock; None for one whose stamp was there before."""
        stamps = self._clock.stamps
        place = self._taken
        if not self._clock.by_order and image.pts is not None:
            place = int(np.searchsorted(stamps, image.pts))
            if place >= len(stamps) or stamps[place] != image.pts:
                place = self._taken
        return place if self._taken <= place < len(stamps) else None

    def _make_frame(self, image: Any, place: int) -> Frame:
        grey = _read_grey(image, full_range=self._full_range)
        size = (grey.shape[1], grey.shape[0])
        if self._read and size != self._size:
            self.close()
            raise InputError(
                f"{self._path}: the image size changes from {self._size[0]} x {self._size[1]} to {size[0]} x {size[1]} "
                f"at frame {place}: expected one size throughout; cut the video there"
            )
        self._size = size
        self._interlaced = self._interlaced or bool(image.interlaced_frame)
        self._read += 1
        self._taken = place + 1
        return Frame(index=place, time_s=float(self._clock.time_s[place]), grey=grey)

    def _decode(self, decoder_threads: int) -> None:
        """Decode into the queue until the end, or until told to stop; the last entry is None or an error."""
        try:
            with _open(self._path) as container:
                stream = _video_stream(container, self._path)
                stream.codec_context.thread_count = decoder_threads
                stream.codec_context.thread_type = "AUTO" if decoder_threads > 1 else "NONE"
                for packet in _packets(container, stream):
                    try:
                        images = packet.decode()
                    except av.error.FFmpegError:
                        continue
                    for image in images:
                        if not self._put(image):
                            return
            self._put(None)
        except Exception as error:
            self._put(error)

    def _put(self, entry: Any) -> bool:
        while not self._stop.is_set():
            with suppress(queue.Full):
                self._queue.put(entry, timeout=0.1)
                return True
        return False


def _open(path: Path | str) -> Any:
    name = str(path)
    if "%" not in name:
        file = Path(name)
        if not file.exists():
            raise InputError(f"{name} does not exist: expected a video file")
        if file.is_dir():
            raise InputError(f"{name} is a folder: expected a video file")
        if file.stat().st_size == 0:
            raise InputError(f"{name} is empty: expected a video file; copy it again from the camera")
    try:
        return av.open(name)
    except PermissionError:
        raise InputError(f"{name} may not be read: expected a video file that this user can open") from None
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            f"{name} is no video that can be read ({_reason(error)}): expected mp4, mov, mkv, avi or the like, whole; "
            "an mp4 that was cut off while recording has no index and must be repaired first"
        ) from None


def _reason(error: BaseException) -> str:
    return str(getattr(error, "strerror", None) or error).lower()


def _video_stream(container: Any, path: Path | str) -> Any:
    streams = [s for s in container.streams.video if s.codec_context is not None and s.codec_context.name != "ansi"]
    if not streams:
        kinds = ", ".join(sorted({s.type for s in container.streams})) or "nothing"
        raise InputError(f"{path} holds no video stream but {kinds}: expected a video file")
    return streams[0]


def _packets(container: Any, stream: Any) -> Iterator[Any]:
    """Return the stream's packets up to the end or the first that cannot be read; the last one is the flush."""
    packets = container.demux(stream)
    while True:
        try:
            yield next(packets)
        except StopIteration:
            return
        except av.error.FFmpegError:
            return


def _read_stamps(container: Any, stream: Any) -> tuple[IntArray, bool, float]:
    """Return the stamps of all images, whether images go by order instead, and the seconds to a tick."""
    packets = [
        (packet.pts, packet.dts) for packet in _packets(container, stream) if packet.size and not packet.is_discard
    ]
    tick_s = float(stream.time_base)
    for k, by_order in ((0, False), (1, True)):
        stamps = [packet[k] for packet in packets if packet[k] is not None]
        if len(stamps) == len(packets):
            return np.array(stamps, dtype=np.int64), by_order, tick_s
    rate = stream.average_rate or stream.guessed_rate or stream.base_rate
    return np.arange(len(packets)), True, 1 / float(rate) if rate else tick_s


def _notice_truncated(container: Any, stream: Any, stamps: IntArray, tick_s: float) -> tuple[Notice, ...]:
    """Say so where the header promises more than there is."""
    end_s = float(np.ptp(stamps)) * tick_s
    if stream.frames:
        whole = len(stamps) >= int(stream.frames) - 1
        promised = f"{int(stream.frames)} frames"
    else:
        # A container without a count states its length; frames that were dropped on the way are not missing at its end.
        stated_s = float(container.duration or 0) / av.time_base if len(container.streams) == 1 else 0.0
        whole = end_s + 2 * end_s / max(len(stamps) - 1, 1) >= 0.98 * stated_s
        promised = f"{stated_s:.3f} s"
    if whole:
        return ()
    words = f"the file ends after {len(stamps)} frames, at {end_s:.3f} s, of {promised}: the rest is lost"
    return (Notice(code="truncated", message=words),)


def _captured_rate(metadata: dict[str, str]) -> float | None:
    """Return the capture rate that a phone wrote beside the stamps."""
    for key, value in metadata.items():
        if key.lower() in _CAPTURE_RATE_KEYS:
            with suppress(ValueError):
                return float(value)
    return None


def _read_grey(image: Any, *, full_range: bool) -> GreyArray:
    """Return an image's luma, upright."""
    grey: Any
    if _LUMA_FIRST.match(image.format.name):
        grey = _read_luma(image, full_range=full_range)
    else:
        grey = cv2.cvtColor(image.to_ndarray(format="bgr24"), cv2.COLOR_BGR2GRAY)
    turns = round(image.rotation / 90) % 4  # counter-clockwise, as the display matrix has it
    if turns:
        codes = {1: cv2.ROTATE_90_COUNTERCLOCKWISE, 2: cv2.ROTATE_180, 3: cv2.ROTATE_90_CLOCKWISE}
        grey = cv2.rotate(grey, codes[turns])
    return np.asarray(grey, dtype=np.uint8)


def _read_luma(image: Any, *, full_range: bool) -> GreyArray:
    form, plane = image.format, image.planes[0]
    bits = form.components[0].bits
    words = np.frombuffer(plane, "u1" if bits == 8 else "<u2")
    luma: GreyArray = words.reshape(-1, plane.line_size // words.itemsize)[: image.height, : image.width]
    limited = image.color_range != _FULL_RANGE and not form.name.startswith(("yuvj", "gray"))
    stretch = limited and full_range
    if bits == 8 and not stretch:
        return luma
    unit = 2.0 ** (bits - 8)
    gain = 255 / (_WHITE - _BLACK) if stretch else 1.0
    black = _BLACK if stretch else 0
    above = np.maximum(luma, int(black * unit))
    return np.asarray(cv2.convertScaleAbs(above, alpha=gain / unit, beta=-gain * black), dtype=np.uint8)


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")
