"""Write grey or coloured images as a video file, with exact times."""

import math
import platform
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

from tagsway.errors import InputError
from tagsway.files import whole_file
from tagsway.model import FloatArray, GreyArray

Codec = Literal["h264", "hevc", "mjpeg", "ffv1", "raw"]

_ENCODERS: dict[str, tuple[str, str]] = {
    "h264": ("libx264", "yuv420p"),
    "hevc": ("libx265", "yuv420p"),
    "mjpeg": ("mjpeg", "yuvj420p"),
    "ffv1": ("ffv1", "gray"),
    "raw": ("rawvideo", "gray"),
}
_CONTAINERS = {
    "h264": (".mp4", ".mov", ".mkv"),
    "hevc": (".mp4", ".mov", ".mkv"),
    "mjpeg": (".mp4", ".mov", ".mkv", ".avi"),
    "ffv1": (".mp4", ".mkv", ".avi"),
    "raw": (".mkv", ".avi"),
}
# Of x264's code for the processors that have AVX-512, some reads memory that nobody has written: one encoding in ten
# differs from the others in some pixels. What is named here every processor has that the wheels run on.
REPEATABLE_X264 = (
    {"x264-params": "asm=MMX2,SSE2Fast,SSSE3,SSE4.2"} if platform.machine().lower() in ("x86_64", "amd64") else {}
)
"""Options with which x264 gives the same bytes for the same images, on every machine."""

_FINE_TIME_BASE = Fraction(1, 90_000)
_FINEST_NEEDED = 10_000


def write_video(
    path: Path,
    frames: Iterable[GreyArray],
    *,
    fps_hz: float,
    time_s: FloatArray | None = None,
    time_rounding_s: float | None = None,
    codec: Codec = "h264",
    quality: float = 18.0,
    full_range: bool = True,
) -> int:
    """Write a video, whole or not at all.

    Parameters
    ----------
    path : Path
        The file; its suffix chooses the container.
    frames : iterable of ndarray of uint8, shape (height, width) or (height, width, 3)
        Grey, or red, green and blue, which h264 in limited range alone takes; all of one size, both sides even; they
        may be made one by one.
    fps_hz : float
        Rate that the header claims.
    time_s : ndarray, shape (n,), optional
        Time of each frame, rising from 0; by default one frame after the other at `fps_hz`.
    time_rounding_s : float, optional
        Unit to which the file rounds its times; by default a divisor of the frame's period below 0.1 ms, or 1/90000 s
        where `time_s` is given. A Matroska file always rounds to 1 ms; an AVI file knows one rate only, and no times.
    codec : {"h264", "hevc", "mjpeg", "ffv1", "raw"}
        The last two lose nothing.
    quality : float
        The crf of h264 and hevc, the quantiser of mjpeg.
    full_range : bool
        Luma in 0..255, marked so; else in 16..235.

    Returns
    -------
    int
        How many frames were written.

    Raises
    ------
    InputError
        Where the container cannot hold what was asked for, or the images do not fit.
    """
    path = Path(path)
    if time_s is not None and not (len(time_s) and time_s[0] == 0 and np.all(np.diff(time_s) > 0)):
        raise InputError("the times of a video's frames must rise from 0")
    base = _time_base(fps_hz, time_s is not None, time_rounding_s)
    if path.suffix.lower() == ".avi":
        base = 1 / _rate(fps_hz)
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written (there is no folder {path.parent})")
    _check(path, codec, quality, has_times=time_s is not None, full_range=full_range)
    try:
        with whole_file(path) as part:
            count = _encode(part, _stamp(frames, fps_hz, time_s, base), fps_hz, base, codec, quality, full_range)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return count


def _encode(
    part: Path,
    frames: Iterator[tuple[GreyArray, int]],
    fps_hz: float,
    base: Fraction,
    codec: Codec,
    quality: float,
    full_range: bool,
) -> int:
    name, pixels = _ENCODERS[codec]
    first, stamp = next(frames)
    height, width = first.shape[:2]
    if height % 2 or width % 2:
        raise InputError(f"a video's sides must be even, not {width} x {height}")
    if first.ndim == 3 and (codec != "h264" or full_range):
        raise InputError("coloured images are written with h264 and in limited range alone, as every player shows them")
    options = {"video_track_timescale": str(base.denominator)} if part.suffix in (".mp4", ".mov") else {}
    with av.open(str(part), "w", options=options) as container:
        stream: Any = container.add_stream(name, rate=_rate(fps_hz), options=_options(codec, quality))
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        context = stream.codec_context
        context.time_base = base
        context.thread_count = 1
        context.color_range = ColorRange.JPEG if full_range else ColorRange.MPEG
        if first.ndim == 3:
            context.colorspace = Colorspace.SMPTE170M  # what OpenCV's conversion is
        if codec == "mjpeg":
            context.qmin = context.qmax = max(1, round(quality))
        count, image = 0, first
        while True:
            if image.shape != first.shape:
                raise InputError(f"frame {count} is of shape {image.shape}: expected {first.shape}, as the first")
            picture = _picture(image, pixels, full_range)
            picture.pts, picture.time_base = stamp, base
            container.mux(stream.encode(picture))
            count += 1
            following = next(frames, None)
            if following is None:
                break
            image, stamp = following
        container.mux(stream.encode(None))
    return count


def _picture(image: GreyArray, pixels: str, full_range: bool) -> Any:
    if image.ndim == 3:
        planes: GreyArray = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        return av.VideoFrame.from_ndarray(planes, format=pixels)
    luma = image if full_range else _LIMITED[image]
    height, width = image.shape
    picture: Any = av.VideoFrame(width, height, pixels)
    for index, plane in enumerate(picture.planes):
        rows = np.frombuffer(plane, dtype=np.uint8).reshape(plane.height, plane.line_size)
        rows[:, : plane.width] = luma if index == 0 else 128
    picture.color_range = ColorRange.JPEG if full_range else ColorRange.MPEG
    return picture


_LIMITED: GreyArray = np.rint(16 + np.arange(256) * (219 / 255)).astype(np.uint8)


def _options(codec: Codec, quality: float) -> dict[str, str]:
    if codec == "h264":
        return {"crf": f"{quality:g}", "preset": "faster", "threads": "1", **REPEATABLE_X264}
    if codec == "hevc":
        return {"crf": f"{quality:g}", "preset": "fast", "x265-params": "log-level=none:pools=1:frame-threads=1"}
    if codec == "mjpeg":
        scale = max(1, round(quality))
        return {"flags": "+qscale", "global_quality": str(118 * scale), "qmin": str(scale), "qmax": str(scale)}
    return {}


def _stamp(
    frames: Iterable[GreyArray], fps_hz: float, time_s: FloatArray | None, base: Fraction
) -> Iterator[tuple[GreyArray, int]]:
    """Yield each frame with its time in units of the file."""
    count = 0
    last = -1
    for image in frames:
        if time_s is not None and count >= len(time_s):
            raise InputError(f"there are more frames than the {len(time_s)} times given")
        time = count / fps_hz if time_s is None else float(time_s[count])
        # Two frames cannot have the same time: a coarse clock moves the second on by one unit.
        last = max(round(time / float(base)), last + 1)
        yield image, last
        count += 1
    if count == 0:
        raise InputError("a video needs at least one frame")
    if time_s is not None and count < len(time_s):
        raise InputError(f"there are {count} frames, but {len(time_s)} times")


def _time_base(fps_hz: float, has_times: bool, rounding_s: float | None) -> Fraction:
    if not (fps_hz > 0 and math.isfinite(fps_hz)):
        raise InputError(f"a video's frame rate must be positive, not {fps_hz:g} Hz")
    if rounding_s is not None:
        if not 1e-6 <= rounding_s <= 1:
            raise InputError(f"times are rounded to something between 1e-6 and 1 s, not {rounding_s:g} s")
        return Fraction(1, round(1 / rounding_s))
    if has_times:
        return _FINE_TIME_BASE
    rate = _rate(fps_hz)
    if abs(float(rate) - fps_hz) > 1e-9 * fps_hz:
        return _FINE_TIME_BASE
    return Fraction(1, rate.numerator << max(0, math.ceil(math.log2(_FINEST_NEEDED / rate.numerator))))


def _rate(fps_hz: float) -> Fraction:
    """Return a rate as containers write it, 30000/1001 for 29.97..."""
    return Fraction(fps_hz).limit_denominator(1001)


def _check(path: Path, codec: str, quality: float, *, has_times: bool, full_range: bool) -> None:
    if codec not in _ENCODERS:
        raise InputError(f"there is no codec {codec!r}: expected one of {', '.join(_ENCODERS)}")
    if path.suffix.lower() not in _CONTAINERS[codec]:
        raise InputError(f"{path}: {codec} goes into a file that ends in {' or '.join(_CONTAINERS[codec])}")
    if path.suffix.lower() == ".avi" and has_times:
        raise InputError(f"{path}: an .avi file holds no frame times: choose .mkv or .mp4")
    if codec == "mjpeg" and not full_range:
        raise InputError("mjpeg is always of full range")
    if not quality >= 0:
        raise InputError(f"a quality must be 0 or more, not {quality:g}")
