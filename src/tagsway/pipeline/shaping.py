"""From a move and a shaper to what the controller runs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tagsway.errors import InputError
from tagsway.model import JointPath, Move, Notice, SampledTrajectory, Shaper, Trajectory, TrajectoryCurve
from tagsway.robots import plan_joints
from tagsway.store.controller import controller_text, describe_ratio, describe_trajectory
from tagsway.trajectories import (
    MotionReport,
    ShaperRatio,
    check_limits,
    find_shaper_ratio,
    plan_move,
    plan_shaped,
    sample_trajectory,
    slow_down,
)

CURVE_SAMPLES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedMove:
    """A shaped move, sampled and checked.

    Parameters
    ----------
    sampled : SampledTrajectory
        On the controller's grid.
    joints : JointPath or None
        The same motion in the robot's joints; None where the robot's lengths are not given.
    report : MotionReport
        What it asks of the robot, and which limits it keeps.
    ratio : ShaperRatio or None
        τ, the shaper's length over the move's acceleration time; None for an unshaped move, or one straight up.
    curve : TrajectoryCurve
        Before and after shaping.
    speed : float
        Share of the planned speed; below 1 it is a dry run.
    """

    sampled: SampledTrajectory
    joints: JointPath | None
    report: MotionReport
    ratio: ShaperRatio | None
    curve: TrajectoryCurve
    speed: float

    @property
    def notices(self) -> tuple[Notice, ...]:
        """A warning for each limit that is broken, and where vertical height is lost."""
        lost_mm = 1e3 * max(self.report.lost_vertical_m)
        if not lost_mm > 0 or any(check.name == "vertical_mm" for check in self.report.checks):
            return self.report.notices
        lost = Notice(
            code="vertical_lost",
            message=f"shaping both axes takes {lost_mm:.1f} mm of the strictly vertical height: raise pick_height_m "
            "and place_height_m, or shape x alone",
        )
        return (*self.report.notices, lost)

    def files(self, *, form: str = "beckhoff") -> tuple[str, dict[str, Any]]:
        """Return the text of trajectory.csv and what trajectory.json says of it."""
        text = controller_text(self.sampled, self.joints, format=form)
        description = describe_trajectory(self.sampled, self.report, text, self.joints, format=form, speed=self.speed)
        return text, {**description, "shaper_ratio": describe_ratio(self.ratio)}


def plan_shaped_move(
    move: Move, shaper: Shaper | None, *, speed: float = 1.0, joint_rate_hz: float | None = None
) -> PlannedMove:
    """Plan a move, shape it, check its limits and sample it.

    Parameters
    ----------
    move : Move
        The move, its limits and the axes to shape.
    shaper : Shaper or None
        None leaves the move unshaped.
    speed : float
        In (0, 1]: the same path, slower; the limits are checked for the slow motion.
    joint_rate_hz : float, optional
        At which the joints are interpolated; by default at the move's sample time.

    Returns
    -------
    PlannedMove
        Broken limits are warnings in it, not errors.

    Raises
    ------
    InputError
        For a move that cannot be planned, shaped or sampled, or that the robot cannot follow.
    """
    unshaped = plan_move(move)
    shaped = unshaped if shaper is None else plan_shaped(move, shaper)
    ratio = None if shaper is None or not move.shaped_axes else _ratio(unshaped, shaper)
    run_time_s = move.run_time_s
    if speed != 1.0:
        unshaped, shaped = slow_down(unshaped, speed), slow_down(shaped, speed)
        run_time_s = None if run_time_s is None else run_time_s / speed
    time = np.linspace(0, shaped.duration_s, CURVE_SAMPLES)
    sampled = sample_trajectory(shaped, move.sample_time_ms / 1e3, run_time_s=run_time_s)
    known = move.robot.kind == "cartesian" or move.robot.lengths_m
    return PlannedMove(
        sampled=sampled,
        joints=plan_joints(sampled, move.robot, rate_hz=joint_rate_hz) if known else None,
        report=check_limits(shaped, unshaped, move),
        ratio=ratio,
        curve=TrajectoryCurve(
            time_s=time,
            unshaped_m=unshaped(time),
            shaped_m=shaped(time),
            unshaped_m_s2=unshaped(time, 2),
            shaped_m_s2=shaped(time, 2),
        ),
        speed=speed,
    )


def _ratio(unshaped: Trajectory, shaper: Shaper) -> ShaperRatio | None:
    """Return τ; None for a move that has none: straight up, or back to where it began."""
    try:
        return find_shaper_ratio(unshaped, shaper)
    except InputError:
        return None
