"""How far measured places scatter in time about a smooth motion."""

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numba import types

from tagsway.compiled import compile_part, compile_whole
from tagsway.model import FloatArray

_STRIDES = (1, 2, 4)  # images between the places that are compared: an error that lasts shows in the longer ones alone
_LEAST_ORDER, _MOST_ORDER = 3, 6  # of the differences: what moves fast at few images a second is gone in the highest
_ORDERS = _MOST_ORDER - _LEAST_ORDER + 1
_HELD = _STRIDES[-1] * _MOST_ORDER + 1
_EVERY = 2  # images: differences of neighbouring ones tell almost the same
_MEMORY = 16  # differences
_FEWEST = 4
_MOST_AT_ONCE = 16.0  # a jerk of the tag is no noise: one square counts as no more than so many
_AGREE = 0.5  # noise leaves as much in differences of the fifth and sixth order, a motion a quarter at the most
_MOST_SHARED = 1.8  # times what neighbours show: more is no noise but jerks of the motion
_COLOUR = 0.85  # the largest of three such estimates is larger than the noise


class Scatter:
    """How much a tag's centre and angle scatter about a smooth motion, over what was stated of the last images.

    Notes
    -----
    The n-th divided difference of n + 1 places at their true times is free of any motion of degree n - 1; the mean of
    its square, over the mean of what the places' stated variances make of it, is 1 where these are right. Higher orders
    remove more of the motion, and the order that leaves least is believed. A difference over every second or fourth
    image sees what an error has in common with its neighbours, but more of the motion too: it counts where its two
    highest orders agree, as those of noise do.

    An error that stays for longer than a dozen images does not scatter: this does not see it.
    """

    def __init__(self) -> None:
        self._add = load_add()
        self._time_s = -1.0 - np.arange(_HELD)  # the newest first; none of them twice
        self._place = np.zeros((_HELD, 3))
        self._stated = np.zeros((_HELD, 3))
        self._held = 0
        self._added = 0
        self._squares = np.zeros((2, len(_STRIDES), _ORDERS, 3))
        self._counts = np.zeros((len(_STRIDES), _ORDERS))
        self._excess = np.zeros(3)

    @property
    def excess(self) -> FloatArray:
        """Variance over the stated one, of (x, y, angle), shape (3,); 0 as long as too few images have been seen."""
        return self._excess

    def add(self, time_s: float, place: Sequence[float], stated: Sequence[float]) -> None:
        """Take in one image.

        Parameters
        ----------
        time_s : float
            When it was taken, from 0 on; an image that is not later than the one before is left out.
        place : sequence of 3 float
            Centre (x, y in px) and angle (rad, unwrapped).
        stated : sequence of 3 float
            Variances of these, as far as this image's are known.
        """
        if not time_s > self._time_s[0]:
            return
        self._time_s[1:] = self._time_s[:-1]
        self._place[1:] = self._place[:-1]
        self._stated[1:] = self._stated[:-1]
        self._time_s[0], self._place[0], self._stated[0] = time_s, place, stated
        self._held = min(self._held + 1, _HELD)
        self._added += 1
        if self._added % _EVERY == 0 and self._held > _LEAST_ORDER:
            self._excess = self._add(
                self._time_s, self._place, self._stated, self._held, self._excess, self._squares, self._counts
            )

    def interrupt(self) -> None:
        """Forget the last images, after a gap, but not how much they scattered."""
        self._held = 0


@compile_part
def _weigh(time_s, stride, order, k):
    """Return the weight of a place in the divided difference of places, every so many images."""
    product = 1.0
    for other in range(order + 1):
        if other != k:  # in units of the first step, so that no product is too small
            product *= (time_s[stride * k] - time_s[stride * other]) / (time_s[0] - time_s[stride])
    return 1 / product


def _add(time_s, place, stated, held, known, squares, counts):
    difference, expected = np.zeros(3), np.zeros(3)
    for s in range(len(_STRIDES)):
        stride = _STRIDES[s]
        for o in range(_ORDERS):
            order = o + _LEAST_ORDER
            if not stride * order < held:
                continue
            counts[s, o] += 1
            difference[:], expected[:], length = 0.0, 0.0, 0.0
            for k in range(order + 1):
                weight = _weigh(time_s, stride, order, k)
                length += weight**2
                for axis in range(3):
                    difference[axis] += weight * (place[stride * k, axis] - place[0, axis])
                    expected[axis] += weight**2 * stated[stride * k, axis]
            for axis in range(3):
                most = _MOST_AT_ONCE * max(known[axis], 1.0) * expected[axis]
                square = min(difference[axis] ** 2, most) / length
                share = 1 / min(counts[s, o], _MEMORY)
                squares[0, s, o, axis] += share * (square - squares[0, s, o, axis])
                squares[1, s, o, axis] += share * (expected[axis] / length - squares[1, s, o, axis])
    excess = np.zeros(3)
    for axis in range(3):
        near = 0.0  # what neighbours show
        for s in range(len(_STRIDES)):
            quiet = math.inf  # the order that leaves least
            for o in range(_ORDERS):
                if counts[s, o] >= _FEWEST and squares[1, s, o, axis] > 0:
                    quiet = min(quiet, squares[0, s, o, axis] / squares[1, s, o, axis])
            last, before = squares[0, s, -1, axis], squares[0, s, -2, axis]
            noisy = counts[s, -1] >= _FEWEST and last > _AGREE * before
            if s == 0:
                near = quiet if quiet < math.inf else 0.0
                excess[axis] = near
            elif noisy and quiet < math.inf:
                excess[axis] = max(excess[axis], min(quiet, _MOST_SHARED * near))
        excess[axis] *= _COLOUR
    return excess


@cache
def load_add() -> Callable[..., FloatArray]:
    """Return the compiled function that takes one image in.

    Returns
    -------
    callable
        Takes times (25,), places and stated variances (25, 3 each), the newest first; how many of them are known; the
        excess so far (3,), against which one square is held; and the running squares of the differences, measured and
        expected, (2, 3, 4, 3), and their counts (3, 4), by stride and order, which it goes on with. Returns the largest
        excess of all strides that see noise, shape (3,).
    """
    one, two, four = (types.Array(types.float64, dimensions, "C") for dimensions in (1, 2, 4))
    return compile_whole(_add, (one, two, two, types.int64, one, four, two))
