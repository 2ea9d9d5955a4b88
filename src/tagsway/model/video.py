"""What comes out of a video file: grey images with their true times."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.arrays import GreyArray
from tagsway.model.estimate import FORBID_UNKNOWN

Progress = Callable[[int, int], None]
"""Called with how many frames are done, and how many there are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coding:
    """What is known of how an image was coded.

    Parameters
    ----------
    family : str
        "whole", "half": moves blocks by whole or half pixels only, and leaves each motion's rest to its corrections.
        "h264", "hevc", "vp8", "vp9": finer vectors; "x264_rd", "x265", "x265_rd", "x265_ultrafast" where the coder of
        H.264 or HEVC told its settings: rd where it weighs what a vector costs. "other" where it is none of these.
    step : float
        Change, in grey levels, below which nothing is corrected: this image's mean quantiser step. NaN where that is
        not known; 0 where nothing is lost.
    between : bool
        Whether it was made from images before and after it, as B-frames are.
    """

    family: Literal[
        "whole", "half", "h264", "x264_rd", "hevc", "x265", "x265_rd", "x265_ultrafast", "vp8", "vp9", "other"
    ] = "other"
    step: float = math.nan
    between: bool = False


UNKNOWN_CODING = Coding()
"""Of an image, if it was coded at all, of which nothing is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One grey image.

    Parameters
    ----------
    index : int
        Place in the file, from 0, in the order of presentation.
    time_s : float
        Time of the middle of the frame's exposure, as far as the file tells; 0 at the first frame.
    grey : ndarray of uint8, shape (height, width)
        Luma, upright as a player would show it; in full range (0..255) unless the reader was asked to leave it as it
        is coded.
    predicted : bool
        Whether a coder made it from other images, so that their errors may live on in it.
    coding : Coding
        How a coder did that.
    """

    index: int
    time_s: float
    grey: GreyArray
    predicted: bool = False
    coding: Coding = UNKNOWN_CODING


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoInfo:
    """What is known of a video once it was read."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    frames: int
    fps_hz: float
    time_source: Literal["container", "option", "metadata"]
    pts_rounding_s: float
    dropped: int
    duplicated: int
    width: int
    height: int
    duration_s: float
