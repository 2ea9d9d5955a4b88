"""Unity-magnitude shapers: impulses of +1 and -1, for actuators that know only on and off."""

import math
from functools import partial

import numpy as np
from scipy.optimize import root

from tagsway.errors import InputError
from tagsway.model import FloatArray, Mode
from tagsway.shapers.branch import follow_branch, solve_near
from tagsway.shapers.impulses import Impulses


def unity_magnitude(mode: Mode, *, derivatives: int = 0, tolerance: float | None = None) -> Impulses:
    """Return UM-ZV, UM-ZVD or UM-EI for a damped mode, solved exactly.

    Parameters
    ----------
    mode : Mode
        The mode to cancel.
    derivatives : int
        0 for UM-ZV (three impulses, a third of a period), 1 for UM-ZVD (five, three quarters of a period) [1]_.
    tolerance : float, optional
        V at the mode, for UM-EI: as long as UM-ZVD and wider; `derivatives` is then 1.

    Returns
    -------
    Impulses
        Amplitudes 1, -1, 1 …; shorter than positive ones, but the negative ones excite whatever is faster than the
        mode, and ask an actuator for its full step twice.

    Raises
    ------
    InputError
        Where the equations have no solution that can be followed from the undamped one.

    Notes
    -----
    For UM-ZV the unknowns are two times, with Σ A e^(st) = 0 at the mode's s; for UM-ZVD four, and the derivative
    Σ A t e^(st) = 0 as well; for UM-EI four and two frequencies at which V = 0, with V = tolerance and dV/dω = 0 at
    the mode. Without damping they are symmetric about the middle impulse: 1 - 2 cos a + 2 cos b is 0, or -tolerance.

    References
    ----------
    .. [1] W. Singhose, N. Singer and W. Seering, Proc. American Control Conf. (1994) 731-735.
    """
    order = 0 if derivatives == 0 and tolerance is None else 1
    start = _undamped(order, tolerance)
    unknowns, reached = follow_branch(start, mode.damping_ratio, partial(_solve, order, tolerance))
    if reached < mode.damping_ratio:
        raise InputError(
            f"no unity-magnitude shaper exists for a damping ratio of {mode.damping_ratio:g}: this kind ends at "
            f"{reached:.2f}; use one of positive impulses"
        )
    time = np.concatenate([[0.0], unknowns[: 2 + 2 * order]])
    return Impulses(time_s=time / mode.angular_frequency_rad_s, amplitude=_signs(order))


def _signs(order: int) -> FloatArray:
    return np.where(np.arange(3 + 2 * order) % 2 == 0, 1.0, -1.0)


def _undamped(order: int, tolerance: float | None) -> FloatArray:
    """Return the unknowns for ζ = 0: times ω_n t without the first, and for EI the ratios ω/ω_n of the zeros."""
    if order == 0:
        return np.array([np.pi / 3, 2 * np.pi / 3])
    level = tolerance or 0.0

    def faults(half: FloatArray) -> list[float]:
        a, b = half
        return [1 - 2 * math.cos(a) + 2 * math.cos(b) + level, a * math.sin(a) - b * math.sin(b)]

    a, b = root(faults, [1.738, 2.300], tol=1e-14).x
    time = np.array([b - a, b, a + b, 2 * b])
    if tolerance is None:
        return time
    # Near the mode, R = -V + R'' (ratio - 1)²/2: where it is 0 the zeros start, and Newton does the rest.
    curvature = 2 * a**2 * math.cos(a) - 2 * b**2 * math.cos(b)
    width = math.sqrt(2 * tolerance / curvature)
    found = _solve(order, tolerance, np.concatenate([time, [1 - width, 1 + width]]), 0.0)
    if found is None:
        raise InputError(f"no unity-magnitude shaper exists for a tolerance of {tolerance:g}: lower it")
    return found


def _solve(order: int, tolerance: float | None, start: FloatArray, zeta: float) -> FloatArray | None:
    found = solve_near(lambda unknowns: _faults(unknowns, zeta, order, tolerance), start)
    if found is None or not (found[0] > 0 and np.all(np.diff(found[: 2 + 2 * order]) > 0)):
        return None
    return found


def _faults(unknowns: FloatArray, zeta: float, order: int, tolerance: float | None) -> FloatArray:
    """Return by how much each equation fails."""
    sign, pole = _signs(order), zeta + 1j * math.sqrt(1 - zeta**2)
    time = np.concatenate([[0.0], unknowns[: 2 + 2 * order]])
    back = time - time[-1]
    response = np.exp(pole * back) @ sign
    slope = np.exp(pole * back) @ (sign * back)
    if tolerance is None:
        parts = [response] if order == 0 else [response, slope]
        return np.array([part for value in parts for part in (value.real, value.imag)])
    at_zeros = np.exp(np.multiply.outer(pole * unknowns[-2:], back)) @ sign
    flat = (slope * pole * response.conjugate()).real / tolerance
    return np.concatenate([at_zeros.real, at_zeros.imag, [abs(response) ** 2 / tolerance - tolerance, flat]])
