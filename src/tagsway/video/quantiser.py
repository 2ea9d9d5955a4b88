"""How coarsely a coder corrects what it moves: the quantiser's step, where blocks are moved by whole or half pixels."""

import re
from typing import Any

import numpy as np
from av.sidedata.sidedata import Type

EXPORT = {"export_side_data": "venc_params"}
"""What the decoder must be asked for, before it is opened."""

_WHOLE_PIXELS = re.compile(rb"x264 - core .{0,600}subme=0 ", re.DOTALL)  # x264 writes its settings into the first image
# Coders that know half pixels only, and how much of a step they hold back, over the others: what MPEG-1 and 2 code at
# all they put into the middle of the step, hence nearer to the truth.
_HALF_PIXELS = {"mpeg1video": 0.5, "mpeg2video": 0.5} | dict.fromkeys(
    ("mpeg4", "h263", "h263p", "flv", "msmpeg4v1", "msmpeg4v2", "msmpeg4v3", "wmv1", "wmv2"), 1.0
)
_FIRST_STEP = 0.625  # of H.264, at quantiser 0; it doubles every six
_BLOCK_WORDS = 5  # of 32 bits, to a block: x, y, width, height, and what its quantiser is more than the image's


def find_coarseness(codec: str, start: bytes) -> float:
    """Return how much of a quantiser's step a coder holds back that moves blocks by whole or half pixels.

    Parameters
    ----------
    codec : str
        FFmpeg's name.
    start : bytes
        The codec's own header and the first packet.

    Returns
    -------
    float
        1 for most of them; 0 for a coder with finer vectors, or without any.
    """
    if codec == "h264":
        return 1.0 if _WHOLE_PIXELS.search(start) else 0.0
    return _HALF_PIXELS.get(codec, 0.0)


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
    told = picture.side_data.get(Type.VIDEO_ENC_PARAMS)
    if told is None or not told.nb_blocks:
        return None
    words = np.frombuffer(told, np.int32)[told.blocks_offset // 4 :][: _BLOCK_WORDS * told.nb_blocks]
    quantiser = told.qp + words[_BLOCK_WORDS - 1 :: _BLOCK_WORDS].astype(float)
    unit = 2.0 ** (picture.format.components[0].bits - 8)
    step = float(np.mean(_FIRST_STEP * 2 ** (quantiser / 6) / unit if codec == "h264" else quantiser))
    return step if step > 1 else 0.0
