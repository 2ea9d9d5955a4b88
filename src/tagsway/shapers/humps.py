"""Extra-insensitive shapers: a little vibration everywhere in a wide band, instead of none at one frequency."""

import math
from functools import partial

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Mode
from tagsway.shapers.branch import follow_branch, solve_near
from tagsway.shapers.impulses import Impulses


def hump_shaper(humps: int, mode: Mode, tolerance: float) -> Impulses:
    """Return EI and its relatives with more humps, for a damped mode, solved exactly.

    Parameters
    ----------
    humps : int
        How often V rises to the tolerance inside the band: 1 for EI [1]_, 2 and 3 for the wider ones [2]_.
    mode : Mode
        The middle of the band: V is `tolerance` there for an odd number of humps and 0 for an even one.
    tolerance : float
        The humps' height, in (0, 1).

    Returns
    -------
    Impulses
        ``humps + 2`` of them, about half a damped period apart.

    Raises
    ------
    InputError
        Where the equations have no solution: a damping so strong, or a tolerance so high, that the upper humps no
        longer reach it: the branch that begins at ζ = 0 ends there (at 5 %: at 0.68, 0.44 and 0.28 for one, two and
        three humps; at 2 % beyond 0.7, at 0.54 and at 0.40). A shaper of specified insensitivity has no such end.

    Notes
    -----
    Unknown are the impulses' times and amplitudes, the ``humps + 1`` frequencies at which V = 0, and the humps' own
    frequencies; the equations are V = 0 at the former, V = tolerance and dV/dω = 0 at the latter, ΣA = 1, and the
    middle of the band. Without damping the solution is known: the amplitudes are a Dolph-Chebyshev window, as
    V = tolerance |T_n(x₀ cos(πω/2ω_n))|. It is followed from there to the mode's damping ratio. The published fits
    hold for a tolerance of 5 % only and miss it by up to 0.4 points.

    References
    ----------
    .. [1] W. E. Singhose, W. P. Seering and N. C. Singer, Proc. Japan-USA Symp. Flexible Automation (1996) 631-638.
    .. [2] W. E. Singhose, L. J. Porter and N. C. Singer, Proc. American Control Conf. (1995) 4160-4164.
    """
    start = _undamped(humps, tolerance)
    unknowns, reached = follow_branch(start, mode.damping_ratio, partial(_solve, humps, tolerance))
    if reached < mode.damping_ratio:
        raise InputError(
            f"no shaper with {humps} hump(s) exists for a damping ratio of {mode.damping_ratio:g} and a tolerance of "
            f"{tolerance:g}: they end at a damping ratio of {reached:.2f}; use a lower tolerance, or a si, zv or zvd"
        )
    time, amplitude, _, _ = _split(unknowns, humps)
    return Impulses.normalised(time / mode.angular_frequency_rad_s, amplitude)


def _solve(humps: int, tolerance: float, start: FloatArray, zeta: float) -> FloatArray | None:
    """Return the solution near `start`, None where there is none with rising times and positive amplitudes."""
    found = solve_near(lambda unknowns: _faults(unknowns, humps, zeta, tolerance), start)
    if found is None:
        return None
    time, amplitude, _, peaks = _split(found, humps)
    ordered = np.all(np.diff(time) > 0) and np.all(amplitude > 0) and np.all(np.diff(peaks) > 0)
    return found if ordered else None


def _undamped(humps: int, tolerance: float) -> FloatArray:
    """Return the unknowns for ζ = 0: times ω_n t without the first, amplitudes, and ratios ω/ω_n of zeros and humps."""
    order = humps + 1
    stretch = math.cosh(math.acosh(1 / tolerance) / order)
    zeros = 2 / np.pi * np.arccos(np.cos(np.pi * (np.arange(1, order + 1) - 0.5) / order) / stretch)
    peaks = 2 / np.pi * np.arccos(np.cos(np.pi * np.arange(1, order) / order) / stretch)
    # V = 0 at the roots of a polynomial in z = e^(jπ ω/ω_n): its coefficients are the amplitudes.
    amplitude = np.poly(np.exp(1j * np.pi * zeros)).real
    time = np.pi * np.arange(1, order + 1)
    return np.concatenate([time, amplitude / amplitude.sum(), zeros, peaks])


def _split(unknowns: FloatArray, humps: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    order = humps + 1
    time, amplitude, zeros, peaks = np.split(unknowns, [order, 2 * order + 1, 3 * order + 1])
    return np.concatenate([[0.0], time]), amplitude, zeros, peaks


def _faults(unknowns: FloatArray, humps: int, zeta: float, tolerance: float) -> FloatArray:
    """Return by how much each equation fails."""
    time, amplitude, zeros, peaks = _split(unknowns, humps)
    pole = zeta + 1j * math.sqrt(1 - zeta**2)
    back = time - time[-1]

    def response(ratio: FloatArray, weight: FloatArray) -> FloatArray:
        return np.asarray(np.exp(np.multiply.outer(pole * ratio, back)) @ weight)

    at_zeros = response(zeros, amplitude)
    at_peaks = response(peaks, amplitude)
    slope = (response(peaks, amplitude * back) * pole * at_peaks.conjugate()).real
    middle = peaks[humps // 2] if humps % 2 else zeros[humps // 2]
    return np.concatenate(
        [
            at_zeros.real,
            at_zeros.imag,
            np.abs(at_peaks) ** 2 / tolerance - tolerance,
            slope / tolerance,
            [amplitude.sum() - 1, middle - 1],
        ]
    )
