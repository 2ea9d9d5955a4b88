"""Video files, through FFmpeg's libraries: every container and codec that they know."""

import math
import re
from array import array
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from av.video.frame import PictureType

from tagsway.errors import InputError
from tagsway.model import UNKNOWN_CODING, GreyArray, IntArray, Notice
from tagsway.video.quantiser import EXPORT, find_coder, read_step
from tagsway.video.runs import ONE_RUN, Runs, Share, cut_evenly, recognise_fresh_start
from tagsway.video.source import WHOLE, Entry, Stamps

_CAPTURE_RATE_KEYS = ("com.android.capture.fps", "com.android.capturefps", "capture_fps", "capturefps")
_LUMA_FIRST = re.compile(r"^(?:yuvj?a?\d{3}p|nv\d\d|gray)(?:\d+le)?$")
_FULL_RANGE = 2  # AVCOL_RANGE_JPEG
_BLACK, _WHITE = 16, 235  # of 8-bit luma in limited range
_SQUARE = 2e-3  # pixels whose sides differ by less count as square
_NO_STAMP = -(2**63)
_UNTIMED = 0x80  # AVFMT_NOTIMESTAMPS: a coder's bare stream, whose times FFmpeg makes up at 25 Hz
_BY_ITSELF = (PictureType.NONE, PictureType.I)  # how an image is coded that needs no other


class ContainerSource:
    """The film of a video file; see `Source`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._interlaced = 0
        self._aspect = 1.0
        self.turns = 0
        self.predicted = False
        self.coding = UNKNOWN_CODING
        self._codec, self._held = "", 0.0

    def read_stamps(self) -> Stamps:
        """Walk through the packets."""
        with _open(self._path) as container:
            stream = _video_stream(container, self._path)
            ticks, by_order, tick_s, runs = _read_ticks(container, stream)
            if container.format.flags & _UNTIMED:
                return Stamps(ticks=np.arange(len(ticks)), tick_s=math.nan, is_count=True, runs=runs)
            rate = stream.average_rate or stream.guessed_rate
            return Stamps(
                ticks=ticks,
                tick_s=tick_s,
                by_order=by_order,
                header_hz=float(rate) if rate else None,
                captured_hz=_captured_rate({**container.metadata, **stream.metadata}),
                runs=runs,
                notices=_notice_truncated(container, stream, ticks, tick_s),
            )

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        """Yield run by run stamp and picture of every frame that can be decoded."""
        with _open(self._path) as container:
            stream = _video_stream(container, self._path)
            self._aspect = float(stream.sample_aspect_ratio or 1) or 1.0
            untimed = bool(container.format.flags & _UNTIMED)
            packets = _packets(container, stream)
            first = next(packets, None)
            self._know_coder(stream.codec_context, first)
            # FFmpeg's threads tell the quantiser of images that another one is still decoding: not twice the same.
            stream.codec_context.thread_count = 1 if self._held else threads
            stream.codec_context.thread_type = "NONE" if self._held or threads == 1 else "AUTO"
            for run in share.pick(chain([] if first is None else [first], packets)):
                yield _decode_run(stream.codec_context, run, untimed=untimed)
                stream.codec_context.flush_buffers()

    def read_grey(self, picture: Any, *, full_range: bool) -> GreyArray:
        """Return a picture's luma with square pixels, upright, of one field where there are two."""
        grey: Any
        self._learn_coding(picture)
        if picture.planes[0].line_size < 0:
            # The last row comes first in memory, as in a bitmap: only a conversion knows where the first one is.
            converted = picture.reformat(format="yuvj444p" if picture.format.name == "gray" else "gray")
            grey = _read_luma(converted, full_range=full_range)
        elif _LUMA_FIRST.match(picture.format.name):
            grey = _read_luma(picture, full_range=full_range)
        else:
            grey = cv2.cvtColor(picture.to_ndarray(format="bgr24"), cv2.COLOR_BGR2GRAY)
        if picture.interlaced_frame:
            self._interlaced += 1
            grey = _take_field(grey)
        if abs(self._aspect - 1) > _SQUARE:
            grey = cv2.resize(grey, (round(grey.shape[1] * self._aspect), grey.shape[0]))
        self.turns = round(picture.rotation / 90) % 4  # counter-clockwise, as the display matrix has it
        if self.turns:
            codes = {1: cv2.ROTATE_90_COUNTERCLOCKWISE, 2: cv2.ROTATE_180, 3: cv2.ROTATE_90_CLOCKWISE}
            grey = cv2.rotate(grey, codes[self.turns])
        return np.asarray(grey, dtype=np.uint8)

    def _know_coder(self, context: Any, first: Any) -> None:
        """Learn the coder's family, and have the decoder tell its quantiser."""
        self._codec = context.name
        start = b"" if first is None else bytes(first)
        self.coding, self._held = find_coder(self._codec, bytes(context.extradata or b"") + start)
        if self._held:
            context.options = EXPORT

    def _learn_coding(self, picture: Any) -> None:
        kind = picture.pict_type
        self.predicted = kind not in _BY_ITSELF
        step = read_step(picture, self._codec) if self._held and self.predicted else None
        told = self.coding.step if step is None else self._held * step
        self.coding = replace(self.coding, step=told, between=kind == PictureType.B)

    def notices(self) -> tuple[Notice, ...]:
        """Say where images were interlaced, and where pixels were not square."""
        notices = []
        if self._interlaced:
            words = (
                "the video is interlaced: of each image only the upper field was used, all of whose rows are of one "
                "time; errors in the vertical direction are up to twice those of a progressive video"
            )
            notices.append(Notice(code="interlaced", message=words))
        if abs(self._aspect - 1) > _SQUARE:
            words = f"the video's pixels are {self._aspect:.4g} times as wide as high: the images were stretched"
            notices.append(Notice(code="pixels_not_square", message=words))
        return tuple(notices)


def _decode_run(context: Any, packets: Iterable[Any], *, untimed: bool) -> Iterator[Entry]:
    """Yield what packets hold, and then what the decoder still holds back."""
    for packet in chain((packet for packet in packets if packet.size), [None]):
        try:
            pictures = context.decode(packet)
        except av.error.FFmpegError:
            continue
        pictures.reverse()
        while pictures:  # none is held while the next one is decoded: its memory is what that is decoded into
            picture = pictures.pop()
            yield None if untimed else picture.pts, picture
            del picture


def _open(path: Path) -> Any:
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty: expected a video file; copy it again from the camera")
    try:
        # "file:" keeps a name with a colon or a percent sign from being taken for an address or a pattern.
        return av.open(f"file:{path}")
    except PermissionError:
        raise InputError(f"{path} may not be read: expected a video file that this user can open") from None
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            f"{path} is no video that can be read ({_reason(error)}): expected mp4, mov, mkv, avi, cine or the like, "
            "whole; an mp4 that was cut off while recording has no index and must be repaired first"
        ) from None


def _reason(error: BaseException) -> str:
    return str(getattr(error, "strerror", None) or error).lower()


def _video_stream(container: Any, path: Path) -> Any:
    """Return the largest moving picture: beside it there may be a cover, or a small preview."""
    streams = [s for s in container.streams.video if s.codec_context is not None and s.codec_context.name != "ansi"]
    moving = [s for s in streams if not s.disposition & av.stream.Disposition.attached_pic]
    if not moving:
        kinds = ", ".join(sorted({s.type if s not in streams else "a picture" for s in container.streams})) or "nothing"
        raise InputError(f"{path} holds no video stream but {kinds}: expected a video file")
    return max(moving, key=lambda stream: stream.codec_context.width * stream.codec_context.height)


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


def _read_ticks(container: Any, stream: Any) -> tuple[IntArray, bool, float, Runs]:
    """Return the stamps of all images, whether images go by order instead, the seconds to a tick, and the runs."""
    shown, decoded, starts = array("q"), array("q"), array("q", [0])
    is_fresh = recognise_fresh_start(stream.codec_context.name, bytes(stream.codec_context.extradata or b""))
    count, changes = 0, False
    for count, packet in enumerate(_packets(container, stream), 1):
        changes = changes or (count > 1 and packet.has_sidedata("new_extradata"))
        if packet.size and not packet.is_discard:
            shown.append(_NO_STAMP if packet.pts is None else packet.pts)
            decoded.append(_NO_STAMP if packet.dts is None else packet.dts)
        if count > 1 and is_fresh(packet):
            starts.append(count - 1)
    # a header that changes on the way is told to the decoder of its own packet alone
    runs = ONE_RUN if changes else _make_runs(stream.codec_context, np.array(starts), count)
    tick_s = float(stream.time_base)
    for column, by_order in ((shown, False), (decoded, True)):
        ticks = np.frombuffer(column, dtype=np.int64) if column else np.empty(0, dtype=np.int64)
        if not np.any(ticks == _NO_STAMP):
            return ticks, by_order, tick_s, runs
    rate = stream.average_rate or stream.guessed_rate or stream.base_rate
    return np.arange(len(shown)), True, 1 / float(rate) if rate else tick_s, runs


def _make_runs(context: Any, starts: IntArray, packets: int) -> Runs:
    """Return the runs of a stream: where images are coded by themselves any will do, but raw ones need no decoder."""
    if not context.format:
        return ONE_RUN
    planes = context.format.components
    image_bytes = sum(plane.width * plane.height * -(-plane.bits // 8) for plane in planes)
    if context.codec.intra_only and context.name != "rawvideo":
        return cut_evenly(packets, image_bytes=image_bytes)
    return Runs(starts=starts, packets=packets, image_bytes=image_bytes)


def _notice_truncated(container: Any, stream: Any, ticks: IntArray, tick_s: float) -> tuple[Notice, ...]:
    """Say so where the header promises more than there is."""
    if len(ticks) == 0:
        return ()
    end_s = float(np.ptp(ticks)) * tick_s
    if stream.frames:
        whole = len(ticks) >= int(stream.frames) - 1
        promised = f"{int(stream.frames)} frames"
    else:
        # A container without a count states its length; frames that were dropped on the way are not missing at its end.
        stated_s = float(container.duration or 0) / av.time_base if len(container.streams) == 1 else 0.0
        if container.format.name.startswith("matroska"):  # whose length counts from zero, wherever its stamps begin
            stated_s -= float(ticks.min()) * tick_s
        whole = end_s + 2 * end_s / max(len(ticks) - 1, 1) >= 0.98 * stated_s
        promised = f"{stated_s:.3f} s"
    if whole:
        return ()
    words = f"the file ends after {len(ticks)} frames, at {end_s:.3f} s, of {promised}: the rest is lost"
    return (Notice(code="truncated", message=words),)


def _captured_rate(metadata: dict[str, str]) -> float | None:
    """Return the capture rate that a phone wrote beside the stamps."""
    for key, value in metadata.items():
        if key.lower() in _CAPTURE_RATE_KEYS:
            with suppress(ValueError):
                return float(value)
    return None


def _read_luma(picture: Any, *, full_range: bool) -> GreyArray:
    form, plane = picture.format, picture.planes[0]
    bits = form.components[0].bits
    words = np.frombuffer(plane, "u1" if bits == 8 else "<u2")
    luma: GreyArray = words.reshape(-1, plane.line_size // words.itemsize)[: picture.height, : picture.width]
    limited = picture.color_range != _FULL_RANGE and not form.name.startswith(("yuvj", "gray"))
    stretch = limited and full_range
    if bits == 8 and not stretch:
        return luma
    unit = 2.0 ** (bits - 8)
    gain = 255 / (_WHITE - _BLACK) if stretch else 1.0
    black = _BLACK if stretch else 0
    above = np.maximum(luma, int(black * unit))
    return np.asarray(cv2.convertScaleAbs(above, alpha=gain / unit, beta=-gain * black), dtype=np.uint8)


def _take_field(grey: GreyArray) -> GreyArray:
    """Return the image of the upper field, rows 0, 2, 4 ..., with the rows between them interpolated.

    Always of the same field: were it now the one and now the other, the times would be uneven.
    """
    halve = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])  # from the image to the field
    shown = cv2.warpAffine(
        np.ascontiguousarray(grey[::2]),
        halve,
        grey.shape[::-1],
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(shown, dtype=np.uint8)
