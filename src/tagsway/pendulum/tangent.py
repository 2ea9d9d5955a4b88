"""A simulated motion, and how it changes with little changes of whatever drives it.

One step of the simulation is a map of the state, and its slopes at all steps are had at once. What a little change at
one of them does to all that follows is then a linear recurrence: as exact as differences of whole simulations, in a
tenth of their time, and for any number of changes.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg import solve_banded

from tagsway.dynamics import step_sway
from tagsway.model import FloatArray, IntArray
from tagsway.pendulum.model import (
    SMOOTH_RATE_RAD_S,
    at_samples,
    ensemble_of,
    pivot_velocity,
    see,
    simulate,
    start_of,
    true_velocity,
)
from tagsway.pendulum.record import Record

DIFFERENCE = 1e-6
"""Step of forward differences: half of double precision's digits, with all that is varied of order one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tangent:
    """The motion of one set of parameters.

    Parameters
    ----------
    record : Record
        The data.
    parameters : ndarray, shape (15, 1)
        The set.
    velocity_m_s : ndarray, shape (2 k - 1, 2, 1)
        The pivot's, at the nodes and half-way between.
    angle_rad, rate_rad_s, momentum_rad_s : ndarray, shape (k, 1)
        q, q' and p at the nodes.
    first : ndarray, shape (2, 2)
        Slopes of the first step's map of (q, p).
    bands : ndarray, shape (4, 2 k - 2)
        The recurrence's matrix: one on the diagonal, the later steps' slopes below it.
    """

    record: Record
    parameters: FloatArray
    velocity_m_s: FloatArray
    angle_rad: FloatArray
    rate_rad_s: FloatArray
    momentum_rad_s: FloatArray
    first: FloatArray
    bands: FloatArray

    @classmethod
    def of(cls, record: Record, parameters: FloatArray) -> Self:
        """Simulate parameters of shape (15,)."""
        columns = parameters[:, None]
        velocity = pivot_velocity(record, columns)
        q, rate = simulate(record, columns)
        p = rate + _push(velocity[::2], q) / ensemble_of(columns).length_m
        shifts = DIFFERENCE * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        steps = _step_each(record, np.repeat(columns, 3, axis=1), velocity, q + shifts[0], p + shifts[1])
        slopes = (steps[:, :, 1:] - steps[:, :, :1]) / DIFFERENCE
        bands = np.zeros((4, 2 * len(slopes)))
        bands[0] = 1.0
        for after in range(2):
            for before in range(2):
                bands[2 + after - before, before : before + 2 * len(slopes) - 2 : 2] = -slopes[1:, after, before]
        return cls(
            record=record,
            parameters=columns,
            velocity_m_s=velocity,
            angle_rad=q,
            rate_rad_s=rate,
            momentum_rad_s=p,
            first=slopes[0],
            bands=bands,
        )

    def seen(self) -> FloatArray:
        """Return what the camera sees, shape (3, n)."""
        return see(self.record, self.parameters, at_samples(self.record, self.angle_rad, self.rate_rad_s))[:, :, 0]

    def of_parameters(self, unknowns: IntArray) -> FloatArray:
        """Return the slopes of what the camera sees in some of the parameters, shape (3, n, unknowns)."""
        varied = np.repeat(self.parameters, len(unknowns) + 1, axis=1)
        varied[unknowns, np.arange(1, len(unknowns) + 1)] += DIFFERENCE
        velocity = pivot_velocity(self.record, varied)
        start = np.stack(start_of(varied, velocity))
        steps = _step_each(self.record, varied, velocity, self.angle_rad, self.momentum_rad_s)
        change = self._carry(start - start[:, :1], steps - steps[:, :, :1])
        q, p = self.angle_rad + change[:, 0], self.momentum_rad_s + change[:, 1]
        rate = p - _push(velocity[::2], q) / ensemble_of(varied).length_m
        camera = see(self.record, varied, at_samples(self.record, q, rate))
        return np.asarray((camera[:, :, 1:] - camera[:, :, :1]) / DIFFERENCE)

    def of_velocity(self, change_m_s: FloatArray) -> FloatArray:
        """Return what little changes of the TCP's velocity do to what the camera sees.

        Parameters
        ----------
        change_m_s : ndarray, shape (2 k - 1, 2, m)
            As the camera would show them.

        Returns
        -------
        ndarray, shape (3, n, m)
        """
        change = true_velocity(self.parameters, change_m_s)
        places = np.stack([change[:-2:2], change[1:-1:2], change[2::2]])
        kicks = np.zeros((len(self.angle_rad) - 1, 2, change.shape[2]))
        for place in range(3):
            for axis in range(2):
                kicks += self._slope_of_velocity(place, axis)[:, :, None] * places[place, :, None, axis]
        length = ensemble_of(self.parameters).length_m
        push = _push(change[::2], self.angle_rad) / length
        start = np.stack([np.zeros(change.shape[2]), push[0]])
        moved = self._carry(start, kicks)
        return self._see_change(moved, push)

    def of_push(self, push_rad_s2: FloatArray) -> FloatArray:
        """Return what little angular accelerations, slow beside a step, do to what the camera sees.

        Parameters
        ----------
        push_rad_s2 : ndarray, shape (k, m)
            At the nodes.

        Returns
        -------
        ndarray, shape (3, n, m)
        """
        step = self.record.nodes_s[1] - self.record.nodes_s[0]
        kicks = np.zeros((len(push_rad_s2) - 1, 2, push_rad_s2.shape[1]))
        kicks[:, 1] = step * (push_rad_s2[1:] + push_rad_s2[:-1]) / 2
        kicks[:, 0] = step**2 * (2 * push_rad_s2[:-1] + push_rad_s2[1:]) / 6
        return self._see_change(self._carry(np.zeros((2, push_rad_s2.shape[1])), kicks), 0.0)

    def _slope_of_velocity(self, place: int, axis: int) -> FloatArray:
        """Return the slopes of every step's map in one of the velocities of the step, shape (k - 1, 2)."""
        ends = []
        for shift in (0.0, DIFFERENCE):
            moved = _places(self.velocity_m_s)
            moved[place, axis] += shift
            ends.append(_take_steps(self.record, self.parameters, moved, self.angle_rad[:-1], self.momentum_rad_s[:-1]))
        return np.asarray((ends[1] - ends[0])[:, :, 0] / DIFFERENCE)

    def _carry(self, start: FloatArray, kicks: FloatArray) -> FloatArray:
        """Return the changes of (q, p) at the nodes, shape (k, 2, m), from those at the start and in each step."""
        right = kicks.copy()
        right[0] += self.first @ start
        moved = solve_banded((3, 0), self.bands, right.reshape(-1, right.shape[2]), check_finite=False)
        return np.concatenate([start[None], moved.reshape(right.shape)])

    def _see_change(self, moved: FloatArray, push: FloatArray | float) -> FloatArray:
        """Return what the camera sees of changes of (q, p), and of p's part that is the pivot's own."""
        lean = _push_slope(self.velocity_m_s[::2], self.angle_rad) / ensemble_of(self.parameters).length_m
        angle = at_samples(self.record, moved[:, 0], moved[:, 1] - lean * moved[:, 0] - push)
        q = at_samples(self.record, self.angle_rad, self.rate_rad_s)
        ends = [see(self.record, self.parameters, q + shift) for shift in (-DIFFERENCE, DIFFERENCE)]
        return np.asarray((ends[1] - ends[0]) / (2 * DIFFERENCE) * angle)


def _push(velocity: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(velocity[:, 0] * np.cos(q) + velocity[:, 1] * np.sin(q))


def _push_slope(velocity: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(velocity[:, 1] * np.cos(q) - velocity[:, 0] * np.sin(q))


def _places(velocity: FloatArray) -> FloatArray:
    """Return velocities at the start, in the middle and at the end of each step, shape (3, 2, k - 1, m)."""
    return np.stack([velocity[:-2:2], velocity[1:-1:2], velocity[2::2]]).transpose(0, 2, 1, 3)


def _step_each(
    record: Record, parameters: FloatArray, velocity: FloatArray, q: FloatArray, p: FloatArray
) -> FloatArray:
    """Return (q, p) one step after each node but the last, shape (k - 1, 2, m)."""
    return _take_steps(record, parameters, _places(velocity), q[:-1], p[:-1])


def _take_steps(record: Record, parameters: FloatArray, places: FloatArray, q: FloatArray, p: FloatArray) -> FloatArray:
    return np.stack(
        step_sway(
            ensemble_of(parameters),
            float(record.nodes_s[1] - record.nodes_s[0]),
            places,
            angle_rad=q,
            momentum_rad_s=p,
            stiction_rate_rad_s=SMOOTH_RATE_RAD_S,
        ),
        axis=1,
    )
