"""The shortest sequence of positive impulses that keeps V under a limit at many modes at once."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, linprog, minimize

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray
from tagsway.shapers.impulses import Impulses

ComplexArray = npt.NDArray[np.complex128]

_Constraint = Any  # scipy's own type for it is private

_OPTIONS: Any = {"maxiter": 200, "ftol": 1e-12}

INSTANTS = 61
"""Where the linear programme may put an impulse."""

SIDES = 24
"""Of the polygon that stands in for the circle |V| = limit; it is inscribed, so nothing passes the limit."""

MARGIN = 1e-7
"""Relative; the optimiser keeps its constraints to about 1e-8, and a limit should hold."""

BISECTIONS = 16

ROUNDS = 10

CLOSEST = 1e-3
"""Of the length: two impulses that come closer are one."""

STEEPER = 3.0
"""By which the margin grows in each round: to 0.6 % in the last one."""


def shortest_within(poles: Callable[[int], ComplexArray], limit: float, longest_s: float) -> Impulses:
    """Return the shortest positive impulses with V ≤ limit at every pole of a band.

    Parameters
    ----------
    poles : callable
        Returns the band's poles ω (ζ + j √(1 - ζ²)) in rad/s on a grid; the argument says how fine.
    limit : float
        Of V, in (0, 1).
    longest_s : float
        Where to give up.

    Returns
    -------
    Impulses
        V ≤ limit at every pole of the finest grid.

    Raises
    ------
    InputError
        Where none shorter than `longest_s` exists.

    Notes
    -----
    For times on a grid the amplitudes are a linear programme, with the circle |V| ≤ limit as an inscribed polygon: the
    least duration is bisected, and its solution, a vertex, has few impulses. From there times and amplitudes move
    freely (SLSQP); the frequencies where V peaks join the constraints until none is left above the limit.
    """
    coarse, fine = poles(12), poles(1600)

    def amplitudes(length: float) -> FloatArray | None:
        return _amplitudes(np.linspace(0.0, length, INSTANTS), coarse, limit)

    length, weight = _least(amplitudes, longest_s)
    for gap in (2, 1, 0):
        polished = _polish(*_clusters(np.linspace(0.0, length, INSTANTS), weight, gap), coarse, fine, limit)
        if polished is not None:
            return polished
    raise InputError("no shortest shaper for this band was found: use an ei, 2hump_ei or zvd")


def shortest_zero(poles: ComplexArray, longest_s: float) -> Impulses:
    """Return the shortest positive impulses with V = 0 at every pole.

    Parameters
    ----------
    poles : ndarray, shape (m,)
        ω (ζ + j √(1 - ζ²)) in rad/s of the modes.
    longest_s : float
        Where to give up; the convolution of one shaper a mode is long enough.

    Notes
    -----
    As `shortest_within`, but with the 2 m equations Re = Im = 0.
    """

    def rows(time: FloatArray) -> FloatArray:
        response = np.exp(np.multiply.outer(poles, time - time[-1]))
        return np.concatenate([response.real, response.imag, np.ones((1, len(time)))])

    sums = np.zeros(2 * len(poles) + 1)
    sums[-1] = 1.0

    def amplitudes(length: float) -> FloatArray | None:
        instants = np.linspace(0.0, length, 4 * INSTANTS)
        found = linprog(np.zeros(len(instants)), A_eq=rows(instants), b_eq=sums)
        return np.asarray(found.x) if found.status == 0 else None

    length, weight = _least(amplitudes, longest_s)
    time, weight = _clusters(np.linspace(0.0, length, 4 * INSTANTS), weight)
    unit, n = float(time[-1]), len(time)

    def faults(unknowns: FloatArray) -> FloatArray:
        instants = unit * np.concatenate([[0.0], unknowns[: n - 1]])
        return np.asarray(rows(instants) @ unknowns[n - 1 :] - sums)

    start = np.concatenate([time[1:] / unit, weight])
    order = np.concatenate([np.zeros((n - 1, 1)), np.eye(n - 1)], axis=1)[:, 1:] - np.eye(n - 1, k=-1)
    spaced: _Constraint = {"type": "ineq", "fun": lambda u: order @ u[: n - 1] - 1e-3}
    equal: _Constraint = {"type": "eq", "fun": faults}
    bounds = [(0.0, 2.0)] * (n - 1) + [(0.0, 1.0)] * n
    free = minimize(  # type: ignore[call-overload]  # its stubs take no constraints as dictionaries
        lambda u: float(u[n - 2]), start, method="SLSQP", bounds=bounds, constraints=[equal, spaced], options=_OPTIONS
    )
    best = free.x if np.max(np.abs(faults(free.x))) < 1e-6 else start
    exact = least_squares(faults, best, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    instants, final = unit * np.concatenate([[0.0], exact[: n - 1]]), exact[n - 1 :]
    if np.max(np.abs(faults(exact))) > 1e-9 or not (np.all(np.diff(instants) > 0) and np.all(final > -1e-9)):
        raise InputError("no shorter shaper for these modes together was found: convolve one for each instead")
    kept = (final > 1e-12) | (np.arange(n) == 0)
    return Impulses.normalised(instants[kept], final[kept])


def _least(amplitudes: Callable[[float], FloatArray | None], longest_s: float) -> tuple[float, FloatArray]:
    """Return the least feasible length, and its amplitudes."""
    weight = amplitudes(longest_s)
    if weight is None:
        raise InputError(
            f"no shaper of up to {longest_s:.3g} s keeps the residual vibration under its limit over this band: "
            "narrow the band, or raise the tolerance"
        )
    low, high = 0.0, longest_s
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        found = amplitudes(middle)
        if found is None:
            low = middle
        else:
            high, weight = middle, found
    return high, weight


def _clusters(instants: FloatArray, weight: FloatArray, gap: int = 2) -> tuple[FloatArray, FloatArray]:
    """Return one impulse for each run of instants that carry weight, no more than `gap` apart; the first is at 0.

    Where a band is a little too wide for n impulses, the next one is born as a neighbour: a gap of 0 keeps it.
    """
    used = np.flatnonzero(weight > 1e-7)
    groups = np.split(used, np.flatnonzero(np.diff(used) > gap) + 1)
    time = np.array([np.average(instants[group], weights=weight[group]) for group in groups])
    return time - time[0], np.array([weight[group].sum() for group in groups])


def _polish(
    time: FloatArray, weight: FloatArray, coarse: ComplexArray, fine: ComplexArray, limit: float
) -> Impulses | None:
    """Return the sequence with its times freed from the grid and V ≤ limit on the fine grid, None where that fails."""
    unit, n = float(time[-1]), len(time)
    unknowns, target = np.concatenate([time[1:] / unit, weight]), limit * (1 - MARGIN)
    bounds = [(0.0, 2.0)] * (n - 1) + [(0.0, 1.0)] * n
    last, total = np.zeros(2 * n - 1), np.concatenate([np.zeros(n - 1), np.ones(n)])
    last[n - 2] = 1.0
    order = np.eye(n - 1, 2 * n - 1) - np.eye(n - 1, 2 * n - 1, k=-1)
    spaced: _Constraint = {"type": "ineq", "fun": lambda u: order @ u - CLOSEST, "jac": lambda _: order}
    whole: _Constraint = {"type": "eq", "fun": lambda u: [total @ u - 1], "jac": lambda _: total[None]}
    guard, best = coarse, None
    for i in range(ROUNDS):
        under: _Constraint = {
            "type": "ineq",
            "fun": lambda u, g=guard, v=target: 1 - np.abs(_response(u, g * unit)) / v,
            "jac": lambda u, g=guard, v=target: -_slope(u, g * unit) / v,
        }
        found = minimize(  # type: ignore[call-overload]  # as above
            lambda u: float(u[n - 2]),
            unknowns,
            jac=lambda _: last,
            method="SLSQP",
            bounds=bounds,
            constraints=[under, spaced, whole],
            options=_OPTIONS,
        )
        residual = np.abs(_response(found.x, fine * unit))
        worst = float(np.max(residual))
        if worst <= limit and abs(total @ found.x - 1) < 1e-9 and (best is None or found.x[n - 2] < best[n - 2]):
            best = found.x
        if best is not None and found.success:
            break
        # Where the optimum is flat its line search ends a little above the limit: aim a little lower each time.
        target = limit * (1 - MARGIN * STEEPER ** (i + 1))
        # A start that is not the last end frees the optimiser where its line search is stuck.
        unknowns = (3 * found.x + unknowns) / 4
        guard = np.concatenate([guard, fine[_peaks(residual, target)]])
    if best is None:
        return None
    final = np.where(best[n - 1 :] > 1e-9, best[n - 1 :], 0.0)
    kept = (final > 0) | (np.arange(n) == 0)
    return Impulses.normalised(unit * np.concatenate([[0.0], best[: n - 1]])[kept], final[kept])


def _amplitudes(instants: FloatArray, poles: ComplexArray, limit: float) -> FloatArray | None:
    """Return amplitudes at these instants with V ≤ limit at the poles, None where there are none."""
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    response = np.exp(np.multiply.outer(poles, instants - instants[-1]))
    rows = np.concatenate([(np.exp(-1j * a) * response).real for a in angle])
    found = linprog(
        np.zeros(len(instants)),
        A_ub=rows,
        b_ub=np.full(len(rows), limit * math.cos(np.pi / SIDES)),
        A_eq=np.ones((1, len(instants))),
        b_eq=[1.0],
    )
    return np.asarray(found.x) if found.status == 0 else None


def _response(unknowns: FloatArray, poles: ComplexArray) -> ComplexArray:
    """Return what the impulses leave at each pole; unknown are all times but the first, then all amplitudes."""
    n = (len(unknowns) + 1) // 2
    instants = np.concatenate([[0.0], unknowns[: n - 1]])
    return np.asarray(np.exp(np.multiply.outer(poles, instants - instants[-1])) @ unknowns[n - 1 :])


def _slope(unknowns: FloatArray, poles: ComplexArray) -> FloatArray:
    """Return the derivatives of |response|, shape (poles, unknowns)."""
    n = (len(unknowns) + 1) // 2
    instants, weight = np.concatenate([[0.0], unknowns[: n - 1]]), unknowns[n - 1 :]
    each = np.exp(np.multiply.outer(poles, instants - instants[-1]))
    response = each @ weight
    by_time = each * weight * poles[:, None]
    by_time[:, -1] -= by_time.sum(axis=1)
    slopes = np.concatenate([by_time[:, 1:], each], axis=1)
    return np.asarray((response.conj()[:, None] * slopes).real / np.maximum(np.abs(response), 1e-300)[:, None])


def _peaks(residual: FloatArray, target: float) -> IntArray:
    """Return the indices of the local maxima above the target."""
    wide = np.concatenate([[-1.0], residual, [-1.0]])
    peak = (wide[1:-1] >= wide[:-2]) & (wide[1:-1] >= wide[2:]) & (residual > target)
    return np.flatnonzero(peak)
