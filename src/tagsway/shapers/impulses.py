"""Impulse sequences that cancel a mode: times from 0 in seconds, amplitudes that sum to 1."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import FloatArray, Mode


@dataclass(frozen=True, slots=True, kw_only=True)
class Impulses:
    """An impulse sequence as arrays.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        From 0 upwards.
    amplitude : ndarray, shape (n,)
        Sum to 1.
    """

    time_s: FloatArray
    amplitude: FloatArray

    @classmethod
    def normalised(cls, time_s: FloatArray, weight: FloatArray) -> Self:
        """Return the sequence with these weights, divided by their sum."""
        return cls(time_s=time_s, amplitude=weight / math.fsum(weight.tolist()))


def zero_vibration(mode: Mode, *, derivatives: int = 0) -> Impulses:
    """Return ZV, ZVD, ZVDD … for a damped mode.

    Parameters
    ----------
    mode : Mode
        The mode to cancel.
    derivatives : int
        How many derivatives of V with respect to the frequency vanish as well: 0 for ZV, 1 for ZVD [1]_ …

    Returns
    -------
    Impulses
        ``derivatives + 2`` impulses, half a damped period apart, weights binomial in
        K = exp(-ζπ/√(1 - ζ²)): (1 + K z)^(derivatives + 1).

    References
    ----------
    .. [1] N. C. Singer and W. P. Seering, J. Dyn. Sys. Meas. Control 112 (1990) 76-82.
    """
    order = derivatives + 1
    decay = _decay(mode, math.pi)
    weight = np.array([math.comb(order, i) * decay**i for i in range(order + 1)])
    return Impulses.normalised(np.arange(order + 1) * mode.damped_period_s / 2, weight)


def modified_zero_vibration(mode: Mode) -> Impulses:
    """Return MZV: a ZV of three impulses, 3/8 of a damped period apart.

    Parameters
    ----------
    mode : Mode
        The mode to cancel.

    Returns
    -------
    Impulses
        Weights 1, -2 K cos θ, K² with θ = 3π/4, the phase between two impulses, and K = exp(-ζθ/√(1 - ζ²)): the
        product of the zeros at the mode and its conjugate, so V = 0 there. Half as long again as ZV, half as
        insensitive again to an error of the frequency.
    """
    phase = 3 * math.pi / 4
    zero = _decay(mode, phase) * np.exp(1j * phase)
    weight = np.array([1.0, -2 * zero.real, abs(zero) ** 2])
    return Impulses.normalised(np.array([0.0, 0.375, 0.75]) * mode.damped_period_s, weight)


def _decay(mode: Mode, phase_rad: float) -> float:
    """Return by how much the mode's amplitude falls while its phase advances."""
    return math.exp(-mode.damping_ratio * phase_rad / math.sqrt(1 - mode.damping_ratio**2))
