"""What is known of a film's coder: its family, and how coarsely it corrects what it moves."""

import re
from typing import Any

import numpy as np
from av.sidedata.sidedata import SideDataContainer, Type

from tagsway.model import UNKNOWN_CODING, Coding

EXPORT = {"export_side_data": "venc_params"}
"""What the decoder must be asked for, before it is opened."""

# x264 writes its settings into the first image: 0 moves by whole pixels, 1 corrects little.
_X264 = re.compile(rb"x264 - core .{0,600}subme=([01]) ", re.DOTALL)
# How much of a step is held back: what MPEG-1 and 2 code at all they put into the middle of the step, hence nearer to
# the truth.
_HALF_PIXELS = {"mpeg1video": 0.46, "mpeg2video": 0.46} | dict.fromkeys(
    ("mpeg4", "h263", "h263p", "flv", "msmpeg4v1", "msmpeg4v2", "msmpeg4v3", "wmv1", "wmv2"), 1.0
)
_SUPERFAST = 2.2
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
    if codec == "h264":
        known = _X264.search(start)
        whole = known is not None and known[1] == b"0"
        share = _SUPERFAST if known is not None and not whole else 1.0
        return Coding(family="whole" if whole else "h264"), share
    if codec == "hevc":
        return Coding(family="hevc"), 0.0
    if codec.endswith("vp9"):
        return Coding(family="vp9"), 1.0 if codec == "vp9" else 0.0
    share = _HALF_PIXELS.get(codec, 0.0)
    return (Coding(family="half"), share) if share else (UNKNOWN_CODING, 0.0)


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
    return quantiser
