"""A candidate's motions: planned, raised where its shaper eats the vertical ends, and their peaks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Shaper, Trajectory
from tagsway.robots import plan_joints
from tagsway.trajectories import plan_move, plan_shaped, sample_trajectory
from tagsway.trajectories.limits import find_extremes
from tagsway.trajectories.limits import find_peaks as peaks_of

ShapedAxes = tuple[Literal["x", "z", "path"], ...]

STILL_M = 1e-9
"""A piece that moves the tool across by less is vertical."""

RAISINGS = 6
"""Secant steps towards the height that keeps the vertical; three suffice."""

ENOUGH_M = 1e-6
"""Height that may be kept beyond what was asked."""

HIGHEST_M = 0.6
"""A higher vertical end is no pick and place."""

LONGEST_S = 60.0
"""A slower move is a mistyped limit."""

LOOKS = 6
"""In each piece, for its peaks: a piece is a polynomial of low degree."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPeaks:
    """What a motion asks of the robot: vectors' magnitudes, corners of the space it needs, vertical height kept."""

    velocity_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    lowest_m: FloatArray
    highest_m: FloatArray
    vertical_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedCandidate:
    """One move and trajectory for each place point."""

    moves: tuple[Move, ...]
    trajectories: tuple[Trajectory, ...]

    def find_joint_fault(self) -> str | None:
        """Return why the robot's joints cannot follow, None where they can or are not known."""
        for move, trajectory in zip(self.moves, self.trajectories, strict=True):
            if move.robot.kind == "cartesian" or not move.robot.lengths_m:
                continue
            try:
                plan_joints(sample_trajectory(trajectory, move.sample_time_ms / 1e3), move.robot)
            except InputError as fault:
                return str(fault)
        return None


def plan_candidate(
    moves: Sequence[Move],
    shaper: Shaper | None,
    axes: ShapedAxes,
    acceleration_m_s2: float,
    *,
    vertical_m: float,
) -> PlannedCandidate:
    """Plan each move with one acceleration and shaper; heights are raised to what must stay vertical of the path.

    Parameters
    ----------
    moves : sequence of Move
        One for each place point.
    shaper, axes, acceleration_m_s2
        Of the candidate.
    vertical_m : float
        Height that must stay strictly vertical at both ends.

    Raises
    ------
    InputError
        Where there is no such move, or none that ends within a minute.

    Notes
    -----
    With z shaped, x starts before the lift has ended: the impulses that follow lift the tool on. The height at which
    x starts rises with the planned one, so that a secant finds it.
    """
    planned = []
    for move in moves:
        wanted = replace(
            move,
            max_acceleration_m_s2=acceleration_m_s2,
            max_velocity_m_s=move.max_velocity_m_s or move.limits.velocity_m_s,
            shaped_axes=axes,
            run_time_s=None,
        )
        if move.profile == "pick-and-place":
            wanted = replace(
                wanted,
                pick_height_m=max(move.pick_height_m, vertical_m),
                place_height_m=max(move.place_height_m, vertical_m),
            )
        if "z" in axes and vertical_m > 0 and move.profile == "pick-and-place":
            planned.append(_raise_ends(wanted, shaper, vertical_m))
        else:
            planned.append((wanted, _plan(wanted, shaper)))
        lasts = planned[-1][1].duration_s
        if not lasts <= LONGEST_S:
            raise InputError(
                f"at {acceleration_m_s2:.3g} m/s² the move takes {lasts:.3g} s: expected at most {LONGEST_S:g} s; "
                "allow more velocity or acceleration"
            )
    return PlannedCandidate(moves=tuple(m for m, _ in planned), trajectories=tuple(t for _, t in planned))


def find_peaks(trajectory: Trajectory) -> MotionPeaks:
    """Return the peaks of a motion, from both ends of each piece and four points inside it."""
    lengths = np.diff(trajectory.breaks_s)
    share = np.linspace(0.0, 1.0, LOOKS)
    offset = lengths[:, None] * share
    powers = offset[..., None] ** np.arange(trajectory.coefficients.shape[1])
    values, coefficients = [], trajectory.coefficients
    for _ in range(4):
        values.append(np.einsum("pkn,pnc->pkc", powers[..., : coefficients.shape[1]], coefficients))
        order = np.arange(1, coefficients.shape[1])[:, None]
        coefficients = coefficients[:, 1:] * order if len(order) else np.zeros_like(coefficients)
    position, velocity, acceleration, jerk = values
    ends = (
        np.concatenate([acceleration[:, 0], np.zeros((1, 3))]),
        np.concatenate([np.zeros((1, 3)), acceleration[:, -1]]),
    )
    peak = float(np.linalg.norm(acceleration, axis=-1).max())
    step = float(np.linalg.norm(ends[0] - ends[1], axis=1).max())
    return MotionPeaks(
        velocity_m_s=float(np.linalg.norm(velocity, axis=-1).max()),
        acceleration_m_s2=peak,
        jerk_m_s3=math.inf if step > 1e-6 * peak else float(np.linalg.norm(jerk, axis=-1).max()),
        lowest_m=position.min(axis=(0, 1)),
        highest_m=position.max(axis=(0, 1)),
        vertical_m=vertical_kept(trajectory),
    )


def refine_peaks(peaks: MotionPeaks, trajectory: Trajectory) -> MotionPeaks:
    """Return the peaks as the polynomials have them: between the looks of `find_peaks`, which is quicker, they pass."""
    velocity, acceleration, jerk = (peaks_of(trajectory, order)[3] for order in (1, 2, 3))
    places = [find_extremes(trajectory.coefficients[..., [axis]], trajectory) for axis in range(3)]
    return replace(
        peaks,
        velocity_m_s=velocity,
        acceleration_m_s2=acceleration,
        jerk_m_s3=max(jerk, peaks.jerk_m_s3),
        lowest_m=np.array([place.min() for place in places]),
        highest_m=np.array([place.max() for place in places]),
    )


def vertical_kept(trajectory: Trajectory) -> float:
    """Return the lower of the heights at which the way across begins and ends, above start and end, in m."""
    lengths = np.diff(trajectory.breaks_s)
    powers = np.arange(1, trajectory.coefficients.shape[1])
    sizes = np.abs(trajectory.coefficients[:, 1:, :2]) * (lengths[:, None] ** powers)[..., None]
    moving = np.flatnonzero(sizes.max(axis=(1, 2)) > STILL_M)
    if not len(moving):
        return math.inf
    z = trajectory(trajectory.breaks_s[[0, moving[0], moving[-1] + 1, -1]])[:, 2]
    return float(min(z[1] - z[0], z[2] - z[3]))


def _plan(move: Move, shaper: Shaper | None) -> Trajectory:
    return plan_move(move) if shaper is None else plan_shaped(move, shaper)


def _raise_ends(move: Move, shaper: Shaper | None, vertical_m: float) -> tuple[Move, Trajectory]:
    extra, before = 0.0, None
    for _ in range(RAISINGS):
        raised = replace(move, pick_height_m=move.pick_height_m + extra, place_height_m=move.place_height_m + extra)
        trajectory = _plan(raised, shaper)
        missing = vertical_m - vertical_kept(trajectory)
        if -ENOUGH_M <= missing <= 0 or (missing <= 0 and extra == 0.0):
            break
        slope = 1.0 if before is None or missing == before[1] else (missing - before[1]) / (before[0] - extra)
        before = (extra, missing)
        # Half of what may be left over, so that rounding does not ask for one step more.
        extra = max(extra + (missing + ENOUGH_M / 2) / max(slope, 0.05), 0.0)
        if not move.pick_height_m + extra < HIGHEST_M:
            break
    if vertical_m - vertical_kept(trajectory) > ENOUGH_M:
        raise InputError(
            f"no height up to {1e3 * HIGHEST_M:g} mm keeps {1e3 * vertical_m:g} mm of the shaped path vertical"
        )
    return raised, trajectory
