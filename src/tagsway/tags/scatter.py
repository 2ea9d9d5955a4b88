"""How far measured places scatter in time, which is what a codec's shifts of whole blocks show in alone."""

import math

import numpy as np

from tagsway.model import FloatArray

_MEMORY = 32  # frames
_ORDERS = 4  # of further differences: what moves fast at few frames a second is gone in the highest
_GAINS = np.array([math.comb(2 * order, order) for order in range(3, 3 + _ORDERS)], dtype=float)
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
        self._rows: list[FloatArray] = []
        self._squares = np.zeros((_ORDERS, 3))
        self._counts = np.zeros(_ORDERS)

    @property
    def variance(self) -> FloatArray:
        """Of (x, y, angle), shape (3,); 0 as long as too few frames have been seen."""
        if self._counts[0] < _FEWEST:
            return np.zeros(3)
        known = self._counts >= _FEWEST
        least: FloatArray = _COLOUR * (self._squares[known] / _GAINS[known, None]).min(axis=0)
        return least

    def add(self, innovation: FloatArray, stated: FloatArray) -> None:
        """Take in one frame.

        Parameters
        ----------
        innovation : ndarray, shape (3,)
            Measured less predicted centre (x, y in px) and angle (rad).
        stated : ndarray, shape (3,)
            Variances of these measurements as the image alone shows them.
        """
        self._rows = [*self._rows[1 - _ORDERS :], innovation]
        difference = np.array(self._rows)
        usual = np.maximum(self.variance, stated)
        for order in range(len(self._rows)):
            square = np.minimum(difference[-1] ** 2, _MOST_AT_ONCE * usual * _GAINS[order])
            self._counts[order] += 1
            self._squares[order] += (square - self._squares[order]) / min(self._counts[order], _MEMORY)
            difference = np.diff(difference, axis=0)

    def interrupt(self) -> None:
        """Forget the last frames, after a gap, but not how much they scattered."""
        self._rows = []
