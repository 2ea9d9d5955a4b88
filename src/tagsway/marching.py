"""Runge's and Kutta's classical rule in momentum form, compiled: a fit takes it a million times.

The equations are those of `tagsway.dynamics`. Constants are an array of shape (6, m): l, g/l, k/J, b/J, drag and
friction; whatever has one column serves all m.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import types

from tagsway.compiled import compile_part, compile_whole
from tagsway.model import FloatArray


@compile_part
def _slopes(q, p, x, z, constants, j, stiction):
    """Return q' and p' under a pivot's velocity over l."""
    sine, cosine = math.sin(q), math.cos(q)
    rate = p - x * cosine - z * sine
    brake = constants[3, j] + x * sine - z * cosine + constants[4, j] * abs(rate)
    slope = -(constants[1, j] * sine + constants[2, j] * q + brake * rate)
    if constants[5, j] != 0:
        slope -= constants[5, j] * math.tanh(rate / stiction)
    return rate, slope


@compile_part
def _step(q, p, start, middle, end, k, step, constants, j, stiction):
    """Return q and p one step later; the pivot's velocities are in column k of their arrays."""
    half, per_length = step / 2, 1 / constants[0, j]
    x, z = middle[0, k] * per_length, middle[1, k] * per_length
    q1, p1 = _slopes(q, p, start[0, k] * per_length, start[1, k] * per_length, constants, j, stiction)
    q2, p2 = _slopes(q + half * q1, p + half * p1, x, z, constants, j, stiction)
    q3, p3 = _slopes(q + half * q2, p + half * p2, x, z, constants, j, stiction)
    x, z = end[0, k] * per_length, end[1, k] * per_length
    q4, p4 = _slopes(q + step * q3, p + step * p3, x, z, constants, j, stiction)
    return q + step / 6 * (q1 + 2 * (q2 + q3) + q4), p + step / 6 * (p1 + 2 * (p2 + p3) + p4)


def _march(start, velocity, steps, constants, stiction):
    n, m = len(steps) + 1, start.shape[1]
    states = np.empty((2, n, m))
    states[:, 0] = start
    for i in range(n - 1):
        for member in range(m):
            j, k = min(member, constants.shape[1] - 1), min(member, velocity.shape[2] - 1)
            states[0, i + 1, member], states[1, i + 1, member] = _step(
                states[0, i, member],
                states[1, i, member],
                velocity[2 * i],
                velocity[2 * i + 1],
                velocity[2 * i + 2],
                k,
                steps[i],
                constants,
                j,
                stiction,
            )
    return states


def _step_each(states, velocity, step, constants, stiction):
    n, m = states.shape[1], max(states.shape[2], velocity.shape[3], constants.shape[1])
    ends = np.empty((2, n, m))
    for i in range(n):
        for member in range(m):
            j, k = min(member, constants.shape[1] - 1), min(member, velocity.shape[3] - 1)
            own = min(member, states.shape[2] - 1)
            ends[0, i, member], ends[1, i, member] = _step(
                states[0, i, own],
                states[1, i, own],
                velocity[0, :, i],
                velocity[1, :, i],
                velocity[2, :, i],
                k,
                step,
                constants,
                j,
                stiction,
            )
    return ends


def _march_carried(push, steps, square, damping):
    n, m = len(steps) + 1, push.shape[1]
    states = np.empty((2, n, m))
    for member in range(m):
        states[0, 0, member], states[1, 0, member] = 0.0, push[0, member]
    for i in range(n - 1):
        step, half = steps[i], steps[i] / 2
        for member in range(m):
            k, b = square[member], damping[member]
            y, p = states[0, i, member], states[1, i, member]
            start, middle, end = push[2 * i, member], push[2 * i + 1, member], push[2 * i + 2, member]
            y1 = p - start
            p1 = -b * y1 - k * y
            y2 = p + half * p1 - middle
            p2 = -b * y2 - k * (y + half * y1)
            y3 = p + half * p2 - middle
            p3 = -b * y3 - k * (y + half * y2)
            y4 = p + step * p3 - end
            p4 = -b * y4 - k * (y + step * y3)
            states[0, i + 1, member] = y + step / 6 * (y1 + 2 * (y2 + y3) + y4)
            states[1, i + 1, member] = p + step / 6 * (p1 + 2 * (p2 + p3) + p4)
    return states


def _array(dimensions: int) -> types.Array:
    return types.Array(types.float64, dimensions, "A", readonly=True)


@cache
def load_march() -> Callable[..., FloatArray]:
    """Return the compiled function that follows m pendulums through n nodes.

    Returns
    -------
    callable
        Takes q and p at the first node, shape (2, m); the pivot's velocities at the nodes and half-way between them,
        shape (2 n - 1, 2, m or 1); the steps, shape (n - 1,); constants; and the rate in rad/s over which dry
        friction's sign is smoothed. Returns q and p at all nodes, shape (2, n, m); NaN from where a motion flies off.
    """
    return compile_whole(_march, (_array(2), _array(3), _array(1), _array(2), types.float64))


@cache
def load_step_each() -> Callable[..., FloatArray]:
    """Return the compiled function that takes one step from each of n states of m pendulums.

    Returns
    -------
    callable
        Takes q and p, shape (2, n, m or 1); the pivot's velocities at the start, in the middle and at the end of each
        step, shape (3, 2, n, m or 1); the step; constants; and the rate of the smoothing. Returns q and p at the ends,
        shape (2, n, m).
    """
    return compile_whole(_step_each, (_array(3), _array(4), types.float64, _array(2), types.float64))


@cache
def load_march_carried() -> Callable[..., FloatArray]:
    """Return the compiled function that follows m light bodies from rest, each carried by a pendulum.

    Returns
    -------
    callable
        Takes what drives them, gain (X + R sin q)' at the nodes and half-way between them, shape (2 n - 1, m); the
        steps, shape (n - 1,); ω_n² and 2 ζ ω_n, each of shape (m,). Returns y and p at all nodes, shape (2, n, m).
    """
    return compile_whole(_march_carried, (_array(2), _array(1), _array(1), _array(1)))
