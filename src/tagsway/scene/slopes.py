"""The scene's equations of motion, compiled: `tagsway.scene.motion` tells what they are."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import types

from tagsway.compiled import compile_part, compile_whole
from tagsway.model import FloatArray

DRY_RATE_RAD_S = 1e-3
"""Over which dry friction's sign is smoothed."""


@compile_part
def _turn(q, s):
    """Return ∂d/∂(q, s) as its two columns."""
    sq, ss, cq, cs = math.sin(q), math.sin(s), math.cos(q), math.cos(s)
    return np.array([[cq * cs, 0.0, sq * cs], [-sq * ss, cs, cq * ss]])


@compile_part
def _bend(q, s, u, v):
    """Return the part of d'' that has no angular acceleration, under the rates u and v."""
    sq, ss, cq, cs = math.sin(q), math.sin(s), math.cos(q), math.cos(s)
    second, mixed = u**2 + v**2, 2 * u * v
    return np.array([-sq * cs * second - cq * ss * mixed, -ss * v**2, cq * cs * second - sq * ss * mixed])


@compile_part
def _torques(angle, rate, spring, resistance):
    """Return what the pivot and the hinge do to each angle."""
    damper, drag, friction, spring2, damper2 = resistance
    speed = math.hypot(rate[0], rate[1])
    brake = damper + drag * speed
    if speed > 0:
        brake += friction * math.tanh(speed / DRY_RATE_RAD_S) / speed
    torques = np.zeros(len(angle))
    for i in range(2):
        torques[i] = -spring[i] * angle[i] - brake * rate[i]
        if len(angle) == 4:
            hinge = spring2 * (angle[2 + i] - angle[i]) + damper2 * (rate[2 + i] - rate[i])
            torques[i] += hinge
            torques[2 + i] = -hinge
    return torques


@compile_part
def _solve(matrix, vector):
    """Solve a positive definite system in place: no row needs to be exchanged."""
    # LAPACK's takes a third longer to compile and to call, and its last digits, and so a film's, depend on the machine.
    n = len(vector)
    for i in range(n):
        for j in range(i + 1, n):
            share = matrix[j, i] / matrix[i, i]
            matrix[j] -= share * matrix[i]
            vector[j] -= share * vector[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            vector[i] -= matrix[i, j] * vector[j]
        vector[i] /= matrix[i, i]


def _slopes(time, state, begin, weights, coupling, moments, spring, resistance):
    size = len(state) // 2
    bodies = size // 2
    angle, rate = state[:size], state[size:]
    push = np.zeros(3)
    for k in range(len(weights) - 1, -1, -1):
        push = push * (time - begin) + weights[k]
    slopes = np.empty(2 * size)
    slopes[:size] = rate
    load, mass = _torques(angle, rate, spring, resistance), np.empty((size, size))
    for i in range(bodies):
        turn, pull = _turn(angle[2 * i], angle[2 * i + 1]), moments[i] * push
        for j in range(bodies):
            a, b = 2 * j, 2 * j + 1
            pull += coupling[i, j] * _bend(angle[a], angle[b], rate[a], rate[b])
            other = _turn(angle[a], angle[b])
            for row in range(2):
                for column in range(2):
                    mass[2 * i + row, a + column] = coupling[i, j] * (turn[row] * other[column]).sum()
        for row in range(2):
            load[2 * i + row] -= (turn[row] * pull).sum()
    _solve(mass, load)
    slopes[size:] = load
    return slopes


def _array(dimensions: int) -> types.Array:
    return types.Array(types.float64, dimensions, "A", readonly=True)


@cache
def load_slopes() -> Callable[..., FloatArray]:
    """Return the compiled derivative of the angles and rates of one or two bodies.

    Returns
    -------
    callable
        Takes the time; q1, s1, q2, s2 and their rates, shape (4 n,) for n bodies; when the piece of the drive begins;
        the coefficients of A, the pivot's acceleration plus g upwards, from then on, shape (k, 3), the constant first;
        the inertias between the bodies, shape (n, n), and the moments m l, shape (n,); the pivot's springs against q
        and s, shape (2,); and its damper, drag and dry friction, then the hinge's spring and damper, five floats.
        Returns the derivative of the state, shape (4 n,).
    """
    floats = types.float64
    return compile_whole(
        _slopes,
        (floats, _array(1), floats, _array(2), _array(2), _array(1), _array(1), types.UniTuple(floats, 5)),
    )
