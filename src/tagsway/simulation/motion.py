"""What a payload does under a planned move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.criteria import Criteria, judge_move
from tagsway.dynamics import PlannedSway, simulate_planned
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, FloatArray, Trajectory
from tagsway.simulation.drive import Drive, plan_drive
from tagsway.simulation.payload import Payload

STEP_S = 1e-3
"""The error of a 2 s move at 1 ms is below 1e-7 mm at 2.5 Hz; it grows with the fourth power."""

STEPS_A_PERIOD = 50
"""At least: the phase is then off by 2e-6 rad in a radian."""

REST_S = 2.0
"""How long the payload is watched after a move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedMotion:
    """m samples of a payload under each of c moves.

    Parameters
    ----------
    drive : Drive
        The pivot's motion and the nodes.
    payload : Payload
        The samples.
    sway : PlannedSway
        Their angles, shape (n, c, m).
    """

    drive: Drive
    payload: Payload
    sway: PlannedSway

    @property
    def time_s(self) -> FloatArray:
        """Nodes, shape (n, c)."""
        return self.drive.time_s

    @property
    def pivot_m(self) -> FloatArray:
        """The pivot's x and z, shape (n, 2, c, 1)."""
        return self.drive.position_m[..., None]

    @property
    def pcp_m(self) -> FloatArray:
        """The product tag's x and z, shape (n, 2, c, m)."""
        r, q = self.payload.tag_radius_m, self.sway.angle_rad
        return self._around(self.drive.position_m, r * np.sin(q) + self.sway.second_m, -r * np.cos(q))

    @property
    def pcp_velocity_m_s(self) -> FloatArray:
        """Its velocity, shape (n, 2, c, m)."""
        r, q, w = self.payload.tag_radius_m, self.sway.angle_rad, self.sway.rate_rad_s
        return self._around(self.drive.velocity_m_s, r * w * np.cos(q) + self.sway.second_m_s, r * w * np.sin(q))

    @property
    def pcp_acceleration_m_s2(self) -> FloatArray:
        """Its acceleration, shape (n, 2, c, m): from the equation of motion, not by differences."""
        r, q, square = self.payload.tag_radius_m, self.sway.angle_rad, self.sway.rate_rad_s**2
        bend, sine, cosine = self.sway.acceleration_rad_s2, np.sin(q), np.cos(q)
        level = r * (bend * cosine - square * sine) + self.sway.second_m_s2
        return self._around(self.drive.acceleration_m_s2, level, r * (bend * sine + square * cosine))

    def pcp_force_n(self, mass_kg: float) -> FloatArray:
        """Return the force that holds a product of this mass at its tag, shape (n, 2, c, m): m (x'', z'' + g)."""
        if not mass_kg > 0:
            raise InputError(f"the mass is {mass_kg:g} kg: expected more than 0")
        force = self.pcp_acceleration_m_s2
        force[:, 1] += GRAVITY_M_S2
        force *= mass_kg
        return force

    @property
    def resting_m(self) -> FloatArray:
        """Where the product's tag comes to rest, shape (2, c, m): straight below the pivot."""
        x, z = self.drive.position_m[-1]
        r = self.payload.tag_radius_m
        return np.stack([x[:, None] + 0 * r, z[:, None] - r])

    def judge(self, *, reference_m: float | None = None, rim_m: float | None = None) -> Criteria:
        """Return how each motion ended, shape (c, m); see `tagsway.criteria.judge_move`."""
        rim = {} if rim_m is None else {"rim_m": rim_m}
        return judge_move(
            self.time_s[..., None],
            self.pivot_m,
            self.pcp_m,
            self.pcp_acceleration_m_s2,
            end_s=self.drive.end_s[:, None],
            final_m=self.resting_m,
            reference_m=reference_m,
            **rim,
        )

    def _around(self, pivot: FloatArray, level: FloatArray, up: FloatArray) -> FloatArray:
        return np.stack([pivot[:, 0, :, None] + level, pivot[:, 1, :, None] + up], axis=1)


def simulate_moves(
    trajectories: Trajectory | Sequence[Trajectory],
    payload: Payload,
    *,
    step_s: float | None = None,
    rest_s: float = REST_S,
) -> SimulatedMotion:
    """Simulate every sample of a payload under every move, in one call.

    Parameters
    ----------
    trajectories : Trajectory or sequence of Trajectory
        c moves of the tool, shaped or not, each in an upright plane of its own. The pivot moves as the tool does.
    payload : Payload
        m samples, hanging at rest when the move begins.
    step_s : float, optional
        The longest step; by default 1 ms, or a 50th of the payload's period. No step spans a switch of the move, so the
        acceleration is exact in each.
    rest_s : float
        How long to go on after each move.

    Returns
    -------
    SimulatedMotion
        Nonlinear, x and z coupled, for c · m motions.

    Raises
    ------
    InputError
        For moves that leave their plane, steps that are too long for the payload, and no move at all.

    Notes
    -----
    The error falls with the fourth power of the step; against DOP853 begun anew at every switch it is 3e-8 mm at 1 ms
    and 2e-5 mm at 5 ms for a payload of 2.5 Hz.
    """
    moves = [trajectories] if isinstance(trajectories, Trajectory) else list(trajectories)
    if not moves:
        raise InputError("a simulation needs at least one move, not none")
    step = min(STEP_S, longest_step(payload)) if step_s is None else step_s
    if not step <= 2.5 * longest_step(payload):
        raise InputError(
            f"a step of {1e3 * step:g} ms is too long for this payload: expected at most a 20th of its shortest "
            f"period, {2.5e3 * longest_step(payload):.3g} ms"
        )
    drive = plan_drive(moves, step_s=step, rest_s=rest_s)
    sway = simulate_planned(payload.pendulums, drive.time_s, drive.step_m_s2, second=payload.second)
    return SimulatedMotion(drive=drive, payload=payload, sway=sway)


def longest_step(payload: Payload) -> float:
    """Return a 50th of the shortest period in a payload, in s."""
    fastest = float(np.max(payload.frequency_hz))
    if payload.second is not None:
        fastest = max(fastest, float(np.max(payload.second.angular_frequency_rad_s)) / (2 * np.pi))
    return 1 / (STEPS_A_PERIOD * fastest)
