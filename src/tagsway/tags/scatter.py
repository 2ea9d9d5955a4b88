"""How far measured places scatter in time, which is what a codec's shifts of whole blocks show in alone."""

import math
from collections.abc import Sequence

_MEMORY = 32  # frames
_ORDERS = 4  # of further differences: what moves fast at few frames a second is gone in the highest
# What makes the variance of one place of the square of each further difference, where the places are white noise.
_SHARES = tuple(1 / math.comb(2 * further + 6, further + 3) for further in range(_ORDERS))
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
        self._last = [[0.0] * _ORDERS for _ in range(3)]  # further differences of x, y and angle
        self._squares = [[0.0] * _ORDERS for _ in range(3)]
        self._counts = [0] * _ORDERS
        self._held = 0
        self._variance = [0.0] * 3

    @property
    def variance(self) -> Sequence[float]:
        """Of x, y and angle; 0 as long as too few frames have been seen."""
        return self._variance

    def add(self, innovation: Sequence[float], stated: Sequence[float]) -> None:
        """Take in one frame.

        Parameters
        ----------
        innovation : sequence of 3 float
            Measured less predicted centre (x, y in px) and angle (rad).
        stated : sequence of 3 float
            Variances of these measurements as the image alone shows them.
        """
        self._held = min(self._held + 1, _ORDERS)
        for order in range(self._held):
            self._counts[order] += 1
        settled = sum(count >= _FEWEST for count in self._counts)  # the first orders
        for k, (difference, variance) in enumerate(zip(innovation, stated, strict=True)):
            most = _MOST_AT_ONCE * max(self._variance[k], variance)
            last, squares = self._last[k], self._squares[k]
            for order in range(self._held):
                square = min(difference * difference * _SHARES[order], most)
                squares[order] += (square - squares[order]) / min(self._counts[order], _MEMORY)
                last[order], difference = difference, difference - last[order]
            if settled:
                self._variance[k] = _COLOUR * min(squares[:settled])

    def interrupt(self) -> None:
        """Forget the last frames, after a gap, but not how much they scattered."""
        self._held = 0
