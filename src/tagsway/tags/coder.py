"""What a coder leaves of a tag's motion: images that are made from others keep the others' errors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tagsway.model import UNKNOWN_CODING, Coding
from tagsway.tags.scatter import Scatter

_UNEVEN = math.exp(0.1)  # the blocks of raw images stay below, by chance
_HIDDEN = 0.05  # of white noise's variance: so much of what blocks have apart hides in it, at least
_SIZE_PX, _SMALLER = 40.0, -0.3  # a tag's side, and the power of it: more blocks, more of their errors even out
_SLOW_PX, _SHARED = 0.4, 0.27  # an image: faster, and the axis that the tag moves along has the larger share
_TURNED_PX, _TORN = 0.2, 0.3  # an image, at an edge: a tag that turns moves each of its blocks by another way
_STEP, _STEP_SMALLER = 0.125, -0.45  # of the contrast: a quantiser's step of 20 grey levels; as above
_ANGLE_TOGETHER = 2.5  # variance of the angle that all blocks share, over what their differences show
_LAG, _LAG_ANGLE = 0.55, 0.4  # px, and px at an edge, to a coarse coder's step that is as large as the contrast
_CREEP_PX = 0.07  # an image: slower, and noise corrects the lag meanwhile
_FROZEN = 2.0  # what blocks have apart, of an image that was coded by itself
_SPEED_MEMORY = 4  # images
_REST_MEMORY = 40  # images: after so many at rest a coder has corrected what it left
_NO_WAY = 4.0  # variances of the place: by so much it seems to have moved at rest


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """How much of a tag's place a family of coders holds back, in px: at even blocks, and at a step of `_STEP`."""

    apart_px: float = 0.89
    power: float = 0.73  # of what blocks have apart, in the variance of what they have in common
    step_px: float = 0.0
    step_power: float = 0.0
    fast_power: float = 0.0


_LAWS = {
    "h264": _Law(step_px=0.0241, step_power=1.25),
    "hevc": _Law(apart_px=2.15, power=0.85),  # its loop filter and large blocks leave more than their differences show
    "hevc_coarse": _Law(apart_px=2.72, power=0.85),
    "vp9": _Law(apart_px=1.18, step_px=0.027, step_power=3.0, fast_power=0.45),
    "other": _Law(),
}
_LAG_FAST = {"whole": 0.05, "half": 0.25}  # powers of the squared speed: vectors of half pixels can follow a fast tag
_LONGEST_LAG_PX = {"whole": 0.2, "half": 0.1}  # ... and then vectors follow even a slow one


class CoderPull:
    """How far a coder may hold a tag back.

    Notes
    -----
    H.264, HEVC and their like make an image from the one before: blocks are moved by a vector and corrected only where
    that is worth the bits. What is not worth them stays as an error of the place, up to some hundredths of a pixel, and
    lasts: a tag that starts lags behind its motion, one that stops is drawn short of its place. Neighbouring blocks
    share their vectors, so most of that error is common to all of a tag, where no residual of the image shows it.

    What tells it is, first, how the blocks differ: the variance of the place from the residual's sums over blocks
    exceeds the one of white noise, w, by u; the common variance goes with u + √(u w) to the power of 0.73, of 0.85 for
    HEVC. Second, the quantiser's step Δ over the contrast, where the decoder tells it: with Δ^1.25 for H.264 (a
    vector's quarter pixels set a limit), with Δ³ for VP9 (noise helps what is just below the step). The geometric mean
    of both counts, for each fails where the other does not: noise hides how the blocks of a small tag differ, and a
    coder's presets use a step unlike.

    A coder that moves blocks by whole or half pixels (x264's preset "ultrafast", MPEG-4 Part 2) leaves the rest of each
    motion to the corrections, and none is made that is smaller than its quantiser's step: all blocks lag behind alike,
    and nothing shows it. The lag is 0.55 px times Δ over the contrast, 0.2 px at the most (0.1 with half pixels),
    whatever the tag's size, but less for what creeps by less than 0.07 px an image (noise corrects it meanwhile) and
    for a tag that turns, whose blocks lag each by another bit.

    All of that holds for each axis by its own motion: one that does not move is not held back, and the error cannot
    exceed the way since the last image that was coded by itself (for a coarse coder, which holds a tag before that
    already: the way of late). It is mended while the tag rests. What goes beyond it for some images, `Scatter` sees.

    The constants are from rendered films of 20 to 90 px (H.264 from "ultrafast" to "slow" at crf 12 to 28, HEVC, VP9,
    MPEG-4 Part 2) and were held against others: benchmarks/accuracy.py. There the normalised variance of a moving tag
    is 0.3 to 1.9, two in three between 0.7 and 1.2. Too small is the variance where a large tag creeps in x264's
    "superfast" and "ultrafast", and in HEVC's bursts of error, whose quantiser is not told; too large for steady creep
    in x264's slower presets, and in MPEG-4 for a large tag that turns.

    Where each image was coded by itself the blocks show all, unless it was taken from a film that was not: then the
    scatter counts.
    """

    def __init__(self) -> None:
        self._scatter = Scatter()
        self._last: tuple[float, ...] | None = None
        self._since_image, self._lately = (_Way(), _Way(), _Way()), (_Way(), _Way(), _Way())
        self._speed_px = 0.0
        self._velocity, self._squares = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
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
        side_px: float = _SIZE_PX,
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
            What is known of the coder.
        gain : float
            Grey levels from the tag's black to its white.
        side_px : float
            Of the tag.
        """
        self.is_at_work = self.is_at_work or predicted
        uneven = [max(one - _UNEVEN * even, 0.0) for one, even in zip(blocks, white, strict=True)]
        if not (self.is_at_work or (uneven[0] > 0 and uneven[1] > 0)):
            return [0.0, 0.0, 0.0]
        self._scatter.add(time_s, place, blocks)
        shown = white if self.is_at_work else blocks
        scatter = [max(one - even, 0.0) for one, even in zip(self._scatter.variance.tolist(), shown, strict=True)]
        if not self.is_at_work:
            return scatter
        self._move((float(place[0]), float(place[1]), float(place[2])), predicted=predicted)
        step = coding.step / gain
        if coding.family in _LAG_FAST:
            held, ways = self._measure_lag(coding.family, step, side_px), self._lately
        else:
            held, ways = self._measure_common(coding.family, step, side_px, white, uneven), self._since_image
        reached = [max(way.square - _NO_WAY * even, 0.0) for way, even in zip(ways, blocks, strict=True)]
        angle = _ANGLE_TOGETHER * (uneven[2] + math.sqrt(uneven[2] * white[2]))
        limited = [min(one, most) for one, most in zip(held, reached, strict=True)]
        limited[2] = max(limited[2], angle)
        return [max(one, more, _FROZEN * least) for one, more, least in zip(limited, scatter, uneven, strict=True)]

    def interrupt(self) -> None:
        """Forget the last places, after a gap."""
        self._scatter.interrupt()
        self._last = None

    def _measure_common(
        self, family: str, step: float, side_px: float, white: Sequence[float], uneven: Sequence[float]
    ) -> list[float]:
        """Return the variances of x and y that all blocks share, and none of the angle."""
        law = _LAWS[family]
        size = side_px / _SIZE_PX
        told = law.step_px**2 * (step / _STEP) ** law.step_power * size**_STEP_SMALLER if law.step_px > 0 else math.nan
        moved = 1 + (self._squares[0] + self._squares[1]) / _SLOW_PX**2
        torn = (1 + self._turn_px2(side_px) / _TURNED_PX**2) ** -_TORN * self._fast() ** -law.fast_power
        common = [0.0, 0.0, 0.0]
        for axis in range(2):
            even, least = white[axis], uneven[axis]
            hidden = 0.0 if math.isnan(told) else _HIDDEN * even
            seen = law.apart_px**2 * (least + math.sqrt(least * even) + hidden) ** law.power * size**_SMALLER
            share = ((1 + self._squares[axis] / _SLOW_PX**2) / moved) ** _SHARED
            common[axis] = torn * share * (seen if math.isnan(told) else math.sqrt(seen * told))
        return common

    def _measure_lag(self, family: str, step: float, side_px: float) -> list[float]:
        """Return the variances of x, y and angle by which a coder that moves blocks coarsely lags behind."""
        turn_px2 = self._turn_px2(side_px)
        longest = min(_LAG * step, _LONGEST_LAG_PX[family]) if step > 0 else 0.0
        whole = longest**2 * self._fast() ** -_LAG_FAST[family] / (1 + turn_px2 / _TURNED_PX**2)
        along = [whole * min(math.sqrt(self._squares[axis]) / _CREEP_PX, 1.0) for axis in range(2)]
        return [*along, (_LAG_ANGLE / _LAG * longest / (side_px / 2)) ** 2 * min(math.sqrt(turn_px2) / _CREEP_PX, 1.0)]

    def _fast(self) -> float:
        return 1 + (self._speed_px / _SLOW_PX) ** 2

    def _turn_px2(self, side_px: float) -> float:
        """Return how far an edge turns from image to image, squared."""
        return self._squares[2] * (side_px / 2) ** 2

    def _move(self, place: tuple[float, ...], *, predicted: bool) -> None:
        if self._last is not None:
            steps = [there - was for there, was in zip(place, self._last, strict=True)]
            self._speed_px += (math.hypot(steps[0], steps[1]) - self._speed_px) / _SPEED_MEMORY
            for axis, step in enumerate(steps):
                self._velocity[axis] += (step - self._velocity[axis]) / _SPEED_MEMORY
                self._squares[axis] += (self._velocity[axis] ** 2 - self._squares[axis]) / _REST_MEMORY
        self._last = place
        if not predicted:
            self._since_image = (_Way(), _Way(), _Way())
        for ways in (self._since_image, self._lately):
            for way, one in zip(ways, place, strict=True):
                way.go_on(one)


class _Way:
    """How far a tag has come along one axis, forgotten as it rests."""

    def __init__(self) -> None:
        self._start: float | None = None
        self.square = 0.0

    def go_on(self, place: float) -> None:
        start = place if self._start is None else self._start
        self._start = start + (place - start) / _REST_MEMORY
        self.square = max(self.square * (1 - 2 / _REST_MEMORY), (place - self._start) ** 2)
