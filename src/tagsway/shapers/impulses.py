"""Impulse sequences that cancel a mode: times from 0 in seconds, amplitudes that sum to 1."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Mode

SMALLEST_SUM = 1e-6
"""Of given amplitudes, against the largest: what cancels to less is no command that arrives."""

COINCIDENT = 1e-12
"""Of a shaper's length: impulses closer than this differ by rounding only."""


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


def given_impulses(time_s: Sequence[float], amplitude: Sequence[float]) -> Impulses:
    """Return impulses that somebody wrote down, checked and scaled to a sum of 1.

    Parameters
    ----------
    time_s : sequence of float
        Rising, the first at 0.
    amplitude : sequence of float
        One each, in any unit; they may be negative, their sum must be positive.

    Raises
    ------
    InputError
        Where they are no shaper.
    """
    time, weight = np.asarray(time_s, dtype=float), np.asarray(amplitude, dtype=float)
    if time.ndim != 1 or time.shape != weight.shape or len(time) == 0:
        raise InputError(f"a shaper needs one amplitude for each time, not {weight.size} for {time.size}")
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(weight))):
        raise InputError("a shaper's times and amplitudes must be finite, some are not")
    if time[0] != 0 or not np.all(np.diff(time) > 0):
        raise InputError(f"a shaper's times must rise from 0 s, not {time.tolist()}")
    total = math.fsum(weight.tolist())
    if not total > SMALLEST_SUM * float(np.max(np.abs(weight))):
        raise InputError(f"a shaper's amplitudes must have a positive sum, not {total:g}: the move would not arrive")
    return Impulses.normalised(time, weight)


def convolve_impulses(*sequences: Impulses) -> Impulses:
    """Return the sequence that does what these do one after another; impulses that coincide are added.

    Notes
    -----
    Its V on any mode is the product of theirs, its duration the sum of theirs.
    """
    time, amplitude = np.zeros(1), np.ones(1)
    for sequence in sequences:
        time = np.add.outer(time, sequence.time_s).ravel()
        amplitude = np.multiply.outer(amplitude, sequence.amplitude).ravel()
    order = np.argsort(time, kind="stable")
    time, amplitude = time[order], amplitude[order]
    first = np.flatnonzero(np.diff(time, prepend=-np.inf) > COINCIDENT * max(float(time[-1]), 1e-300))
    return Impulses.normalised(time[first], np.add.reduceat(amplitude, first))


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
