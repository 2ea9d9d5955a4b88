"""How far measured places scatter in time about a smooth motion."""

import math

import numpy as np

from tagsway.model import FloatArray

_STRIDES = (1, 2, 4)  # images between the places that are compared: an error that lasts shows in the longer ones alone
_LEAST_ORDER, _MOST_ORDER = 3, 6  # of the differences: what moves fast at few images a second is gone in the highest
_ORDERS = np.arange(_LEAST_ORDER, _MOST_ORDER + 1)
_PLACES = np.array([[stride * k for k in range(_MOST_ORDER + 1)] for stride in _STRIDES])
_BEHIND = np.tri(_MOST_ORDER + 1, dtype=bool)[_ORDERS].T  # which places, of the newest first, a difference is of
_ITSELF = np.eye(_MOST_ORDER + 1)
_HELD = int(_PLACES.max()) + 1
_EVERY = 2  # images: differences of neighbouring ones tell almost the same
_MEMORY = 16  # differences
_FEWEST = 4
_MOST_AT_ONCE = 16.0  # a jerk of the tag is no noise: one square counts as no more than so many
_AGREE = 0.5  # noise leaves as much in differences of the fifth and sixth order, a motion a quarter at the most
_MOST_SHARED = 1.8  # times what neighbours show: more is no noise but jerks of the motion
_COLOUR = 0.85  # the largest of three such estimates is larger than the noise


class Scatter:
    """The variance of a tag's centre and angle about a smooth motion, over the last images.

    Notes
    -----
    The n-th divided difference of n + 1 places at their true times is free of any motion of degree n - 1; scaled to
    unit length its square has the variance of one place. Higher orders remove more of the motion, and the order that
    leaves least is believed. A difference over every second or fourth image sees what an error has in common with its
    neighbours, but more of the motion too: it counts where its two highest orders agree, as those of noise do.

    An error that stays for longer than a dozen images does not scatter: this does not see it.
    """

    def __init__(self) -> None:
        self._time_s = -1.0 - np.arange(_HELD)  # the newest first; none of them twice
        self._place = np.zeros((_HELD, 3))
        self._held = 0
        self._added = 0
        self._squares = np.zeros((len(_STRIDES), len(_ORDERS), 3))
        self._counts = np.zeros((len(_STRIDES), len(_ORDERS), 1))
        self._variance = np.zeros(3)

    @property
    def variance(self) -> FloatArray:
        """Of (x, y, angle), shape (3,); 0 as long as too few images have been seen."""
        return self._variance

    def add(self, time_s: float, place: FloatArray, stated: FloatArray) -> None:
        """Take in one image.

        Parameters
        ----------
        time_s : float
            When it was taken, from 0 on; an image that is not later than the one before is left out.
        place : ndarray, shape (3,)
            Centre (x, y in px) and angle (rad, unwrapped).
        stated : ndarray, shape (3,)
            Variances of these as the image alone shows them.
        """
        if not time_s > self._time_s[0]:
            return
        self._time_s[1:] = self._time_s[:-1]
        self._place[1:] = self._place[:-1]
        self._time_s[0], self._place[0] = time_s, place
        self._held = min(self._held + 1, _HELD)
        self._added += 1
        if self._added % _EVERY or self._held <= _LEAST_ORDER:
            return
        weights = _weigh_differences(self._time_s[_PLACES])
        differences = np.swapaxes(weights, 1, 2) @ (self._place[_PLACES] - place)
        squares = np.minimum(differences * differences, _MOST_AT_ONCE * np.maximum(self._variance, stated))
        known = (_PLACES[:, _ORDERS] < self._held)[..., None]
        self._counts += known
        step = (squares - self._squares) / np.clip(self._counts, 1, _MEMORY)
        self._squares += np.where(known, step, 0.0)
        self._variance = self._judge()

    def interrupt(self) -> None:
        """Forget the last images, after a gap, but not how much they scattered."""
        self._held = 0

    def _judge(self) -> FloatArray:
        """Return the largest scatter of all strides that see noise, each in the order that leaves least."""
        settled = self._counts >= _FEWEST
        least = np.where(settled, self._squares, math.inf).min(axis=1)
        noisy = settled[:, -1] & (self._squares[:, -1] > _AGREE * self._squares[:, -2])
        noisy[0] = True
        least[~(noisy & np.isfinite(least))] = 0.0
        least[1:] = np.minimum(least[1:], _MOST_SHARED * least[0])
        variance: FloatArray = _COLOUR * least.max(axis=0)
        return variance


def _weigh_differences(time_s: FloatArray) -> FloatArray:
    """Return the divided differences' weights of places at these times, of unit length, shape (strides, 7, orders)."""
    apart = time_s[:, :, None] - time_s[:, None, :]
    # In units of the first step, so that no product is too small; a place's distance from itself is left out.
    products = np.cumprod(apart / abs(apart[:, :1, 1:2]) + _ITSELF, axis=2)[:, :, _ORDERS]
    weights = _BEHIND / products
    unit: FloatArray = weights / np.sqrt((weights * weights).sum(axis=1, keepdims=True))
    return unit
