"""How far measured places scatter in time, which is what a codec's shifts of whole blocks show in alone."""

import math
from collections.abc import Sequence

import numpy as np

_MEMORY = 32  # frames
_ORDERS = 4  # of further differences: what moves fast at few frames a second is gone in the highest
# What the square of each further difference of an innovation is worth, where the places are white noise.
_SHARES = [1 / math.comb(2 * further + 6, further + 3) for further in range(_ORDERS)]
_AT_ONCE = 8  # frames
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
        self._innovations: list[tuple[float, float, float]] = []  # the oldest first ...
        self._counted = 0  # ... of which so many have been counted in
        self._stated: Sequence[float] = ()
        self._squares = np.zeros((_ORDERS, 3))
        self._counts = np.zeros(_ORDERS)
        self._variance = [0.0, 0.0, 0.0]

    @property
    def variance(self) -> list[float]:
        """Of (x, y, angle); 0 as long as too few frames have been seen, and some frames old."""
        return self._variance

    def add(self, innovation: tuple[float, float, float], stated: Sequence[float]) -> None:
        """Take in one frame.

        Parameters
        ----------
        innovation : tuple of float
            Measured less predicted centre (x, y in px) and angle (rad).
        stated : sequence of float
            Variances of these measurements as the image alone shows them.
        """
        self._innovations.append(innovation)
        self._stated = stated
        if len(self._innovations) - self._counted >= _AT_ONCE:
            self._count()

    def interrupt(self) -> None:
        """Forget the last frames, after a gap, but not how much they scattered."""
        if len(self._innovations) > self._counted:
            self._count()
        self._innovations.clear()
        self._counted = 0

    def _count(self) -> None:
        innovations = np.array(self._innovations)
        most = _MOST_AT_ONCE * np.maximum(self._variance, self._stated)
        for order in range(_ORDERS):
            squares = np.square(np.diff(innovations, order, axis=0)[max(self._counted - order, 0) :]) * _SHARES[order]
            new = len(squares)
            if not new:
                continue
            self._counts[order] += new
            share = min(new / min(self._counts[order], _MEMORY), 1.0)
            self._squares[order] += (np.minimum(squares, most).mean(axis=0) - self._squares[order]) * share
        settled = np.count_nonzero(self._counts >= _FEWEST)  # the first orders
        if settled:
            self._variance = (_COLOUR * self._squares[:settled].min(axis=0)).tolist()
        self._innovations = self._innovations[1 - _ORDERS :]
        self._counted = len(self._innovations)
