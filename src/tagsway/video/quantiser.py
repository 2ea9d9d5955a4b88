"""What is known of a film's coder: its family, and how coarsely it corrects what it moves."""

import re
from typing import Any

import numpy as np
from av.sidedata.sidedata import SideDataContainer, Type

from tagsway.model import UNKNOWN_CODING, Coding

EXPORT = {"export_side_data": "venc_params"}
"""What the decoder must be asked for, before it is opened."""

# x264 and x265 write their settings into the first image or the header. `subme` is how they refine vectors: 0 leaves
# whole pixels (x264) or nearly so (x265), and x264's 1 is quick. From 6 on it weighs what a vector costs, as x265 does
# from an `rd` of 3 on.
_NOTE = {
    "h264": re.compile(rb"x264 - core .{0,1600}", re.DOTALL),
    "hevc": re.compile(rb"x265 \(build .{0,1600}", re.DOTALL),
}
_SETTING = re.compile(rb" (subme|rd)=(\d+)")
_WEIGHS = {"h264": 6, "hevc": 3}
# How much of a step is held back: what MPEG-1 and 2 code at all they put into the middle of the step, hence nearer to
# the truth.
_MPEG = dict.fromkeys(("mpeg1video", "mpeg2video"), 0.46)
_H263 = dict.fromkeys(("mpeg4", "h263", "h263p", "flv", "msmpeg4v1", "msmpeg4v2", "msmpeg4v3", "wmv1", "wmv2"), 1.0)
_SUPERFAST = 1.9
_FIRST_STEP = 0.625  # of H.264, at quantiser 0; it doubles every six
# Of VP9: the step of the coefficients by index, in eighths; it grows ever faster.
_INDICES = (0, 1, 95, 120, 137, 150, 180, 215, 255)
_EIGHTHS = (4, 8, 102, 152, 203, 255, 448, 864, 1828)
_BLOCK_WORDS = 5  # of 32 bits, to a block: x, y, width, height, and what its quantiser is more than the image's
_READ = 160  # blocks of an image, about: their quantisers' mean is known to a quarter then


def find_coder(codec: str, start: bytes) -> tuple[Coding, float]:
    """Return a coder's family, and how much of a quantiser's step it holds back.

    Parameters
    ----------
    codec : str
        FFmpeg's name of the decoder.
    start : bytes
        The codec's own header and the first packet.

    Returns
    -------
    Coding
        Without a step.
    float
        1 for most of them; 0 where the decoder tells no step.
    """
    settings = _read_note(codec, start)
    if codec == "h264":
        refined = settings.get("subme", 2)
        if refined == 0:
            return Coding(family="whole"), 1.0
        return Coding(family="x264_rd" if refined >= _WEIGHS[codec] else "h264"), _SUPERFAST if refined == 1 else 1.0
    if codec == "hevc":
        if not settings:
            return Coding(family="hevc"), 0.0
        if settings.get("subme") == 0:
            return Coding(family="x265_ultrafast"), 0.0
        return Coding(family="x265_rd" if settings.get("rd", 0) >= _WEIGHS[codec] else "x265"), 0.0
    if codec.endswith("vp9"):
        return Coding(family="vp9"), 1.0 if codec == "vp9" else 0.0
    if codec in ("vp8", "libvpx"):
        return Coding(family="vp8"), 0.0
    share = (_MPEG | _H263).get(codec, 0.0)
    return (Coding(family="half"), share) if share else (UNKNOWN_CODING, 0.0)


def _read_note(codec: str, start: bytes) -> dict[str, int]:
    """Return the settings of x264 and x265 that tell of their vectors; nothing where another coder was at work."""
    pattern = _NOTE.get(codec)
    note = pattern.search(start) if pattern else None
    return {name.decode(): int(value) for name, value in _SETTING.findall(note[0])} if note else {}


def read_step(picture: Any, codec: str) -> float | None:
    """Return the mean quantiser's step of a picture.

    Parameters
    ----------
    picture : av.VideoFrame
        Decoded with `EXPORT`.
    codec : str
        FFmpeg's name.

    Returns
    -------
    float or None
        In grey levels of 0..255, for a transform that keeps lengths; 0 where it is finer than these, as of a coder that
        loses nothing; None where the decoder does not tell.
    """
    # The picture's own `side_data` refers back to it: its memory would wait for the garbage collector.
    told = SideDataContainer(picture).get(Type.VIDEO_ENC_PARAMS)  # type: ignore[call-arg]  # its stub takes none
    if told is None or not (told.nb_blocks or codec == "vp9"):
        return None
    quantiser = np.array([float(told.qp)])
    if told.nb_blocks:
        words = np.frombuffer(told, np.int32)[told.blocks_offset // 4 :][: _BLOCK_WORDS * told.nb_blocks]
        thinned = max(told.nb_blocks // _READ, 1) | 1  # odd: not always blocks of the same columns
        quantiser = told.qp + words[_BLOCK_WORDS - 1 :: _BLOCK_WORDS * thinned].astype(float)
    unit = 2.0 ** (picture.format.components[0].bits - 8)
    step = float(np.mean(_measure_steps(quantiser, codec, unit)))
    return step if step > 1 else 0.0


def _measure_steps(quantiser: Any, codec: str, unit: float) -> Any:
    if codec == "h264":
        return _FIRST_STEP * 2 ** (quantiser / 6) / unit
    if codec == "vp9":
        return np.interp(quantiser, _INDICES, _EIGHTHS) / 8 / unit
    # These are twice the quantiser. H.263's odd ones put a level one farther out, nearer to what it stands for.
    return quantiser - (quantiser % 4 == 2) if codec in _H263 else quantiser
