"""Prefilters other than impulses: filters in continuous time, and how long they ring."""

import numpy as np
from scipy.linalg import expm

from tagsway.model import DigitalFilter, FloatArray, Mode
from tagsway.shapers.impulses import Impulses

SETTLED = 1e-6
"""Of a step: below it the tail is over (a move of 1 m then ends within 1 µm)."""


def notch_filter(mode: Mode) -> DigitalFilter:
    """Return a notch with its zeros on the mode's poles and both of its own at -ω_n.

    Notes
    -----
    F = (s² + 2ζω s + ω²) / (s + ω)². V = 0 at the mode as for ZV, but it lasts 2.7 periods, it overshoots, and off
    the mode it is as sensitive as a ZV and worse.
    """
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    return DigitalFilter(numerator=(1.0, 2 * zeta * w, w**2), denominator=(1.0, 2 * w, w**2))


def low_pass_filter(mode: Mode, *, tolerance: float, order: int = 4) -> DigitalFilter:
    """Return a low-pass of equal real poles that leaves V = tolerance at the mode.

    Parameters
    ----------
    mode : Mode
        The mode to keep at rest.
    tolerance : float
        V at the mode, in (0, 1).
    order : int
        How many poles; more than four shorten it little.

    Notes
    -----
    F = (ω_c / (s + ω_c))^order has no overshoot. At the mode's pole -p, p = ω (ζ + j √(1 - ζ²)), its gain is
    |ω_c / (ω_c - p)|^order = tolerance, a quadratic for ω_c. Every faster mode is left less, every slower one more:
    it has no band. It lasts longer than any impulse shaper.
    """
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    inverse = tolerance ** (-2 / order)
    # |ω_c - p|² = inverse ω_c²:  (inverse - 1) ω_c² + 2 ζ ω ω_c - ω² = 0
    corner = w * (-zeta + np.sqrt(zeta**2 + inverse - 1)) / (inverse - 1)
    below = tuple(float(c) for c in np.poly(np.full(order, -corner)).real)
    return DigitalFilter(numerator=(below[-1],), denominator=below)


def filter_tail(filtered: DigitalFilter, impulses: Impulses) -> float:
    """Return how long a filter rings on after the last of the impulses that precede it, in s.

    Parameters
    ----------
    filtered : DigitalFilter
        Stable.
    impulses : Impulses
        In series with it; where they cancel its poles it does not ring on at all.

    Returns
    -------
    float
        Until the response to a step stays within 1e-6 of its end.
    """
    system, unit = state_space(filtered)
    if not len(system[1]):
        return 0.0
    rest = np.linalg.solve(system[0], system[1])
    time = impulses.time_s * unit
    left = sum(
        amplitude * (expm(system[0] * (time[-1] - start)) @ rest)
        for start, amplitude in zip(time.tolist(), impulses.amplitude.tolist(), strict=True)
    )
    slowest = float(np.min(-np.linalg.eigvals(system[0]).real))
    if not np.max(np.abs(system[2] @ _orbit(system[0], np.asarray(left), 0.05, 400))) > SETTLED:
        return 0.0
    # The largest multiple root, of order n, rings for about its own n log n longer than a single one.
    horizon = (np.log(1 / SETTLED) + 4.0 * len(rest)) / slowest
    steps = 4000
    ringing = np.abs(system[2] @ _orbit(system[0], np.asarray(left), horizon / steps, steps))
    last = int(np.flatnonzero(ringing > SETTLED)[-1]) + 1
    return float(last * horizon / steps / unit)


def state_space(filtered: DigitalFilter) -> tuple[tuple[FloatArray, FloatArray, FloatArray, float], float]:
    """Return (A, B, C, D) of a filter in units of its own time, and that unit in 1/s.

    Notes
    -----
    x' = A x + B u, y = C x + D u, in controllable form; time is counted in 1 / (geometric mean of its poles), so that
    A's entries are of the order of 1.
    """
    below = np.array(filtered.denominator) / filtered.denominator[0]
    order = len(below) - 1
    unit = abs(below[-1]) ** (1 / order) if order else 1.0
    powers = unit ** -np.arange(order + 1)
    above = np.zeros(order + 1)
    above[order + 1 - len(filtered.numerator) :] = np.array(filtered.numerator) / filtered.denominator[0]
    below, above = below * powers, above * powers
    through = float(above[0])
    a = np.zeros((order, order))
    b = np.zeros(order)
    if order:
        a[:-1, 1:] = np.eye(order - 1)
        a[-1] = -below[:0:-1]
        b[-1] = 1.0
    c = (above[1:] - through * below[1:])[::-1].copy()
    return (a, b, c, through), float(unit)


def _orbit(a: FloatArray, start: FloatArray, step: float, count: int) -> FloatArray:
    """Return the states of x' = A x from `start`, shape (order, count)."""
    forward, state = expm(a * step), start
    states = np.empty((len(start), count))
    for i in range(count):
        states[:, i] = state
        state = forward @ state
    return states
