"""A sampled trajectory as a path of the joints."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from tagsway.errors import InputError
from tagsway.model import BoolArray, FloatArray, JointPath, Robot, SampledTrajectory
from tagsway.robots.kinematics import find_joints, singularity_margin

MOST_SAMPLES = 1_000_000
"""Two minutes at 8 kHz; more is a mistyped rate."""

LEAST_MARGIN = 0.01
"""Nearer to a singularity the joints turn a hundred times as fast as the tool moves for its arms' length."""

ROUNDING_RAD = 1e-9
"""A joint may pass its limit by this much."""

_UNITS: Mapping[str, tuple[Literal["rad", "m"], ...]] = MappingProxyType(
    {"cartesian": ("m", "m", "m"), "delta": ("rad", "rad", "rad"), "scara": ("rad", "rad", "m")}
)

_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"cartesian": ("x", "y", "z"), "delta": ("joint_1", "joint_2", "joint_3"), "scara": ("joint_1", "joint_2", "z")}
)


def plan_joints(sampled: SampledTrajectory, robot: Robot, *, rate_hz: float | None = None) -> JointPath:
    """Return the joints' path for a sampled trajectory of the tool.

    Parameters
    ----------
    sampled : SampledTrajectory
        At rest at both ends.
    robot : Robot
        With its lengths and joint limits.
    rate_hz : float, optional
        At which the joints are sampled, such as the 8 kHz of a drive's own interpolator; by default at the tool's rate.

    Returns
    -------
    JointPath
        Through the joints of every sample of the tool, exactly; between them, and for the derivatives, a cubic spline
        at rest at both ends. Its error falls with the fourth power of the tool's sample time where the acceleration is
        smooth; where that steps, the spline's acceleration rounds the step off over a few samples.

    Raises
    ------
    InputError
        For the first point in time that the robot cannot reach, at which a joint passes its limit or the arms come to
        a singularity, and for a rate that cannot be.
    """
    position = sampled.position_m
    joints, margin = find_joints(robot, position), singularity_margin(robot, position)
    _refuse_unreachable(robot, sampled, joints, margin)
    units = _UNITS[robot.kind]
    rotary = [unit == "rad" for unit in units]
    joints[:, rotary] = np.unwrap(joints[:, rotary], axis=0)
    _refuse_beyond_limits(robot, sampled, joints)
    knots = np.arange(len(position)) * sampled.sample_time_s
    rate = 1 / sampled.sample_time_s if rate_hz is None else rate_hz
    time = knots if rate_hz is None else _grid(rate_hz, float(knots[-1]))
    spline = CubicSpline(knots, joints, bc_type="clamped")
    acceleration = spline(time, 2)
    acceleration[-1] = 0.0  # from there on it rests; the spline has the value that it arrives with
    return JointPath(
        sample_time_s=1 / rate,
        names=robot.joint_names or _NAMES[robot.kind],
        units=units,
        position=spline(time),
        velocity=spline(time, 1),
        acceleration=acceleration,
        singularity_margin=float(margin.min()),
    )


def _refuse_unreachable(robot: Robot, sampled: SampledTrajectory, joints: FloatArray, margin: FloatArray) -> None:
    if (lost := _first(~np.all(np.isfinite(joints), axis=1))) is not None:
        raise InputError(
            f"the {robot.kind} robot cannot reach {_place(sampled, lost)}: its arms are too short or too long for it; "
            "move the path into the workspace, or check the robot's lengths_m"
        )
    if (lost := _first(~(margin >= LEAST_MARGIN))) is not None:
        raise InputError(
            f"the {robot.kind} robot is at a singularity at {_place(sampled, lost)} (margin {margin[lost]:.2g}, "
            f"expected at least {LEAST_MARGIN:g} of 1): keep the path away from it"
        )


def _refuse_beyond_limits(robot: Robot, sampled: SampledTrajectory, joints: FloatArray) -> None:
    if not robot.joint_limits_deg:
        return
    rotary = _UNITS[robot.kind].count("rad")
    low, high = np.radians(np.broadcast_to(robot.joint_limits_deg, (rotary, 2))).T
    angles = joints[:, :rotary]
    beyond = (angles < low - ROUNDING_RAD) | (angles > high + ROUNDING_RAD)
    if (sample := _first(beyond.any(axis=1))) is not None:
        joint = int(np.argmax(beyond[sample]))
        raise InputError(
            f"joint {joint + 1} is at {math.degrees(angles[sample, joint]):.1f}° at {_place(sampled, sample)}, but its "
            f"limits are {math.degrees(low[joint]):g}° and {math.degrees(high[joint]):g}°: move the path, or turn the "
            "robot against it"
        )


def _first(faulty: BoolArray) -> int | None:
    return int(np.argmax(faulty)) if faulty.any() else None


def _place(sampled: SampledTrajectory, sample: int) -> str:
    point = ", ".join(f"{value + 0.0:.4g}" for value in np.round(sampled.position_m[sample], 9))
    return f"({point}) m, t = {sample * sampled.sample_time_s:.4g} s"


def _grid(rate_hz: float, total_s: float) -> FloatArray:
    if not (rate_hz > 0 and math.isfinite(rate_hz)):
        raise InputError(f"the joints' rate must be positive, not {rate_hz:g} Hz")
    cycles = total_s * rate_hz
    if not 1 <= cycles < MOST_SAMPLES:
        raise InputError(
            f"a joint rate of {rate_hz:g} Hz makes {cycles:.4g} samples of {total_s:.4g} s: expected at least 1 and at "
            f"most {MOST_SAMPLES}; it is in Hz, usually 1000 to 8000"
        )
    grid: FloatArray = np.minimum(np.arange(math.ceil(cycles - 1e-9) + 1) / rate_hz, total_s)
    return grid
