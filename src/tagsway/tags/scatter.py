"""How far measured places scatter in time, which is what a codec's shifts of whole blocks show in alone."""

import math

import numpy as np

from tagsway.model import FloatArray

_MEMORY = 32  # frames
_ORDERS = 4  # of further differences: what moves fast at few frames a second is gone in the highest
# Each row makes a further difference of the last innovations, of the variance of one place where they are white noise.
_DIFFERENCES = np.array(
    [
        [
            (-1) ** back * math.comb(further, back) / math.sqrt(math.comb(2 * further + 6, further + 3))
            for back in range(_ORDERS)
        ]
        for further in range(_ORDERS)
    ]
)
_FEWEST = 8
_MOST_AT_ONCE = 16.0  # a jerk of the tag is no noise: one square counts as no more than so many
_COLOUR = 1.15  # a codec's noise is a little larger than its differences say: neighbours share some of it


class Scatter:
    """The variance of a tag's centre and angle about a smooth motion, over the last frames.

    Notes
    -----
    A prediction is the parabola through the last three measurements, at their true times; what is measured less what
    was predicted is a third difference of the noise, of 20 times its variance: ``comb(2 n, n)`` for the n-th. Further
    differences remove more of the motion, and the order that leaves least is believed.

    Where blocks are copied from the image before, as a codec does at rest, nothing scatters and the error is one
    constant: this does not see it.
    """

    def __init__(self) -> None:
        self._innovations = np.zeros((_ORDERS, 3))  # the newest first
        self._held = 0
        self._squares = np.zeros((_ORDERS, 3))
        self._counts = np.zeros((_ORDERS, 1))
        self._variance = np.zeros(3)

    @property
    def variance(self) -> FloatArray:
        """Of (x, y, angle), shape (3,); 0 as long as too few frames have been seen."""
        return self._variance

    def add(self, innovation: FloatArray, stated: FloatArray) -> None:
        """Take in one frame.

        Parameters
        ----------
        innovation : ndarray, shape (3,)
            Measured less predicted centre (x, y in px) and angle (rad).
        stated : ndarray, shape (3,)
            Variances of these measurements as the image alone shows them.
        """
        self._innovations[1:] = self._innovations[:-1]
        self._innovations[0] = innovation
        self._held = min(self._held + 1, _ORDERS)
        known = slice(self._held)
        differences = _DIFFERENCES[known] @ self._innovations
        squares = np.minimum(differences * differences, _MOST_AT_ONCE * np.maximum(self._variance, stated))
        self._counts[known] += 1
        self._squares[known] += (squares - self._squares[known]) / np.minimum(self._counts[known], _MEMORY)
        settled = np.count_nonzero(self._counts >= _FEWEST)  # the first orders
        if settled:
            self._variance = _COLOUR * self._squares[:settled].min(axis=0)

    def interrupt(self) -> None:
        """Forget the last frames, after a gap, but not how much they scattered."""
        self._held = 0
