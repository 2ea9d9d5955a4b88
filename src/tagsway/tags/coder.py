"""What a coder leaves of a tag's motion: images that are made from others keep the others' errors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tagsway.model import UNKNOWN_CODING, Coding
from tagsway.tags.scatter import Scatter

_UNEVEN = math.exp(0.1)  # the blocks of raw images stay below, by chance
_HIDDEN = 0.05  # of white noise's variance: so much of what blocks have apart hides in it, at least
# Where the laws below are 1, but for their `px`: a tag's side, a quantiser's step of 20 grey levels over the contrast,
# what its blocks have apart, and how strong its noise is, as a variance times the side.
_SIDE_PX, _STEP, _APART_PX2, _GRAIN_PX3 = 40.0, 0.125, 2e-5, 4e-4
_MOST_STEP = 4.0  # times that: the step of a pale tag may be coarser, but holds back no more
_LEAST_GRAIN, _MOST_GRAIN = 0.1, 12.5  # times that: beyond nothing was measured
_FAST_PX, _TURNED_PX, _CREEP_PX = 0.4, 0.2, 0.07  # an image; the second of them at an edge
_SLOWEST = 0.1  # of a creep
LONGEST_PX = 0.3  # no vector is farther off
_ANGLE_TOGETHER = 2.5  # variance of the angle that all blocks share, over what their differences show
_FRESH = 0.3  # of what blocks have apart, in an image that was coded by itself
_SPEED_MEMORY = 4  # images
_REST_MEMORY = 40  # images: after so many at rest a coder has corrected what it left
_NO_WAY = 4.0  # variances of the place: by so much it seems to have moved at rest


class Powers(NamedTuple):
    """The powers of what tells a coder's pull, in the variance of a tag's place; see `CoderPull`."""

    step: float
    side: float
    apart: float
    grain: float
    fast: float
    along: float
    turned: float
    creep: float


@dataclass(frozen=True, slots=True)
class _Law:
    """How much of a tag's place coders hold back."""

    px: float
    """Standard error where all that has a power is 1."""
    least: float
    """Variance that is there in any case, of what the blocks have apart."""
    powers: Powers


_LAWS = {
    # px, least; step, side, apart, grain, fast, along, turned, creep
    "whole": _Law(0.1242, 1.67, Powers(2.98, -0.49, 0.27, -0.66, -0.15, -0.15, -0.78, 0.83)),
    "half": _Law(0.1226, 0.05, Powers(2.22, -0.59, 0.29, -0.75, -0.46, -0.11, -0.72, 0.88)),
    "h264": _Law(0.0233, 2.35, Powers(0.42, -0.61, 0.83, -0.58, -0.14, -0.01, -1.72, -0.38)),
    "x264_rd": _Law(0.0379, 1.46, Powers(2.22, -0.72, 0.32, -0.66, -0.03, 0.01, -1.18, -0.36)),
    "hevc": _Law(0.0185, 0.44, Powers(0.00, -0.02, 0.85, -0.05, -0.13, 0.11, -1.65, -0.42)),
    "x265_ultrafast": _Law(0.0357, 0.09, Powers(0.00, 0.24, 0.44, 0.58, -0.25, -0.05, -1.33, 0.51)),
    "x265": _Law(0.0185, 0.26, Powers(0.00, -0.02, 0.74, -0.05, -0.12, 0.08, -1.49, -0.43)),
    "x265_rd": _Law(0.0195, 0.45, Powers(0.00, -0.02, 0.82, -0.09, -0.15, 0.14, -1.37, -0.39)),
    "vp8": _Law(0.0253, 0.08, Powers(0.00, 0.41, 0.59, 0.23, -0.30, 0.08, -1.11, 0.62)),
    "vp9": _Law(0.0476, 0.40, Powers(4.38, -1.67, 0.09, -1.70, -0.20, 0.00, -0.50, 0.12)),
    "other": _Law(0.0227, 0.34, Powers(0.00, 0.15, 0.65, 0.22, -0.12, 0.11, -0.47, 0.47)),
}
_LAWS_ACROSS = {
    "h264": _Law(0.0321, 1.72, Powers(1.99, -1.11, 0.55, -0.98, -0.02, 2.52, -2.98, -0.38)),
    "x264_rd": _Law(0.0391, 1.72, Powers(3.12, -1.35, 0.48, -1.26, 0.07, 4.16, -1.86, -0.43)),
    "hevc": _Law(0.0233, 0.49, Powers(0.00, 0.28, 0.59, 0.48, -0.05, 0.38, -4.17, -0.06)),
    "x265_ultrafast": _Law(0.0305, 0.39, Powers(0.00, 0.25, 0.48, 0.44, -0.14, 0.10, -2.41, -0.01)),
    "x265": _Law(0.0176, 0.22, Powers(0.00, -0.15, 0.76, -0.08, 0.02, 0.11, -6.22, -0.14)),
    "x265_rd": _Law(0.0163, 0.39, Powers(0.00, -0.20, 1.13, -0.19, -0.03, 1.43, -5.88, -0.07)),
}
_LAWS_BETWEEN = {
    "h264": _Law(0.0179, 2.78, Powers(0.70, -0.75, 0.72, -0.55, 0.14, 0.15, 0.07, -0.28)),
    "x264_rd": _Law(0.0173, 2.49, Powers(0.15, -0.34, 0.31, 0.18, 0.17, 0.10, -0.17, -0.27)),
    "hevc": _Law(0.0317, 0.66, Powers(0.00, 0.19, 0.33, 0.60, 0.02, 0.21, -0.19, 0.10)),
    "x265_ultrafast": _Law(0.0292, 0.27, Powers(0.00, 0.04, 0.54, 0.36, -0.04, 0.21, -0.28, -0.14)),
    "x265": _Law(0.0279, 0.59, Powers(0.00, -0.30, 0.11, 0.18, 0.05, 0.12, -0.14, 0.07)),
    "x265_rd": _Law(0.0368, 0.47, Powers(0.00, 0.11, 0.27, 0.51, -0.01, 0.19, -0.08, 0.52)),
}


class CoderPull:
    """How far a coder may hold a tag back.

    Notes
    -----
    H.264, HEVC and their like make an image from others: blocks are moved by a vector and corrected only where that is
    worth the bits. What is not worth them stays as an error of the place, up to some hundredths of a pixel, and lasts:
    a tag that starts lags behind its motion, one that stops is drawn short of its place. Neighbouring blocks share
    their vectors, so most of that error is common to all of a tag, where no residual of the image shows it.

    What tells it is a product of powers, for x and y each:

        σ² = px² Δᵃ uᵇ nᶜ Lᵈ (1 + v²)ᵉ ((1 + v_i²) / (1 + v_x² + v_y²))ᶠ (1 + w²)ᵍ min(v_i, 1)ʰ

    with the quantiser's step Δ over the contrast, where the decoder tells it, as Δ / (1 + Δ / 4Δ₀), so that one beyond
    half the contrast holds back little more; how the blocks differ, u: the variance of the place from the residual's
    sums over blocks, beyond the one of white noise; that noise, n, which helps corrections over the quantiser's step;
    the tag's side L; and its speed v, by axis v_i, and turning w, from image to image, each over its own scale.

    A coder that moves blocks by whole or half pixels (x264's preset "ultrafast", MPEG-4 Part 2) leaves the rest of each
    motion to its corrections, so there Δ tells most. H.264 and HEVC have three laws each. An image that is made from
    those before and after it (a B-frame) gets few corrections, and the one after such images, made across them, many: a
    fast or turning tag is off by three times as much in the first. Where each image is made from the one before, as
    cameras do, it is in between. Where x264 or x265 told in the film how they choose vectors, that has laws of its own.

    An axis that does not move is not held back: the error is no larger than the way of late. What goes beyond all of
    that for some images, `Scatter` sees; it makes the stated errors larger by a factor. Where each image was coded by
    itself the blocks show all, unless it was taken from a film that was not: then the scatter alone counts.

    The powers are from rendered films of 20 to 90 px, with noise of 1 to 8 grey levels (H.264 from "ultrafast" to
    "slow" at crf 12 to 28, HEVC from "ultrafast" to "slow" at 18 to 28, both with and without B-frames, VP8, VP9,
    MPEG-2 and MPEG-4 Part 2; VP8 and AV1 for those of which nothing is known), by the likelihood of their errors;
    benchmarks/accuracy.py holds them against others.
    """

    def __init__(self) -> None:
        self._scatter = Scatter()
        self._last: tuple[float, ...] | None = None
        self._ways = (_Way(), _Way())
        self._speed_px = 0.0
        self._velocity, self._squares = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        self._since_between = _REST_MEMORY
        self.is_at_work = False

    def measure(
        self,
        time_s: float,
        place: Sequence[float],
        *,
        white: Sequence[float],
        blocks: Sequence[float],
        predicted: bool,
        coding: Coding = UNKNOWN_CODING,
        gain: float = 1.0,
        side_px: float = _SIDE_PX,
    ) -> list[float]:
        """Return the variances of x, y and angle that a coder adds to those that the image shows.

        Parameters
        ----------
        time_s : float
            When the image was taken; later than the one before.
        place : sequence of 3 float
            Centre (x, y in px) and angle (rad).
        white, blocks : sequence of 3 float
            Variances of these for white noise of the residual's size, and from the residual's sums over blocks.
        predicted : bool
            Whether the image was made from others.
        coding : Coding
            How it was.
        gain : float
            Grey levels from the tag's black to its white.
        side_px : float
            Of the tag.
        """
        self.is_at_work = self.is_at_work or predicted
        uneven = [max(one - _UNEVEN * even, 0.0) for one, even in zip(blocks, white, strict=True)]
        if not (self.is_at_work or (uneven[0] > 0 and uneven[1] > 0)):
            return [0.0, 0.0, 0.0]
        held = [0.0, 0.0, 0.0]
        if self.is_at_work:
            self._move((float(place[0]), float(place[1]), float(place[2])))
            held = self._measure_held(predicted, coding, gain, side_px, white, uneven)
            held[2] = _ANGLE_TOGETHER * (uneven[2] + math.sqrt(uneven[2] * white[2]))
        stated = [one + more for one, more in zip(blocks, held, strict=True)]
        self._scatter.add(time_s, place, stated)
        excess = self._scatter.excess.tolist()
        return [max(times, 1.0) * whole - shown for times, whole, shown in zip(excess, stated, blocks, strict=True)]

    def interrupt(self) -> None:
        """Forget the last places, after a gap."""
        self._scatter.interrupt()
        self._last = None

    def _measure_held(
        self,
        predicted: bool,
        coding: Coding,
        gain: float,
        side_px: float,
        white: Sequence[float],
        uneven: Sequence[float],
    ) -> list[float]:
        """Return the variances of x and y that all blocks share, and none of the angle."""
        if not predicted:
            return [_FRESH * uneven[0], _FRESH * uneven[1], 0.0]
        self._since_between = 0 if coding.between else self._since_between + 1
        law = _find_law(coding, across=self.is_across)
        held = [0.0, 0.0, 0.0]
        for axis in range(2):
            even, apart = white[axis], uneven[axis]
            factors = self.list_factors(axis, coding.step / gain, side_px, even, apart)
            pull = law.px**2 * math.prod(map(pow, factors, law.powers))
            held[axis] = max(min(pull, self.reach(axis, even, apart), LONGEST_PX**2), law.least * apart)
        return held

    @property
    def is_across(self) -> bool:
        """Whether images were lately made from both sides, so that the others are made across them."""
        return self._since_between < _REST_MEMORY

    def reach(self, axis: int, even: float, apart: float) -> float:
        """Return the square of an axis' way of late, beyond what noise of these variances makes of it."""
        return max(self._ways[axis].square - _NO_WAY * (even + apart), 0.0)

    def list_factors(self, axis: int, step: float, side_px: float, even: float, apart: float) -> Powers:
        """Return what tells the pull of an axis, each over where it is 1: the step over the contrast, and so on."""
        squares = self._squares
        both = 1 + (squares[0] + squares[1]) / _FAST_PX**2
        return Powers(
            step=1.0 if math.isnan(step) else step / (_STEP + step / _MOST_STEP),
            side=side_px / _SIDE_PX,
            apart=(apart + math.sqrt(apart * even) + _HIDDEN * even) / _APART_PX2,
            grain=min(max(even * side_px / _GRAIN_PX3, _LEAST_GRAIN), _MOST_GRAIN),
            fast=1 + (self._speed_px / _FAST_PX) ** 2,
            along=(1 + squares[axis] / _FAST_PX**2) / both,
            turned=1 + squares[2] * (side_px / 2 / _TURNED_PX) ** 2,
            creep=min(max(math.sqrt(squares[axis]) / _CREEP_PX, _SLOWEST), 1.0),
        )

    def _move(self, place: tuple[float, ...]) -> None:
        if self._last is not None:
            steps = [there - was for there, was in zip(place, self._last, strict=True)]
            self._speed_px += (math.hypot(steps[0], steps[1]) - self._speed_px) / _SPEED_MEMORY
            for axis, step in enumerate(steps):
                self._velocity[axis] += (step - self._velocity[axis]) / _SPEED_MEMORY
                self._squares[axis] += (self._velocity[axis] ** 2 - self._squares[axis]) / _REST_MEMORY
        self._last = place
        for way, one in zip(self._ways, place, strict=False):
            way.go_on(one)


def _find_law(coding: Coding, *, across: bool) -> _Law:
    """Return the law of an image's coder; the one of unknown coders where a step is missing."""
    laws = _LAWS_BETWEEN if coding.between else _LAWS_ACROSS if across else _LAWS
    law = laws.get(coding.family, _LAWS[coding.family])
    return _LAWS["other"] if law.powers.step > 0 and math.isnan(coding.step) else law


class _Way:
    """How far a tag has come along one axis, forgotten as it rests."""

    def __init__(self) -> None:
        self._start: float | None = None
        self.square = 0.0

    def go_on(self, place: float) -> None:
        start = place if self._start is None else self._start
        self._start = start + (place - start) / _REST_MEMORY
        self.square = max(self.square * (1 - 2 / _REST_MEMORY), (place - self._start) ** 2)
