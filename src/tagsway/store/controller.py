"""What a controller takes: the samples of a move as CSV, and a description beside it."""

import hashlib
import math
from typing import Any

import numpy as np

from tagsway.errors import InputError
from tagsway.model import JointPath, SampledTrajectory
from tagsway.store.joints import joint_csv, ros_trajectory
from tagsway.store.tables import number_table, rounded
from tagsway.trajectories import MotionReport, ShaperRatio

TRAJECTORY_SCHEMA = "tagsway/trajectory/1"

CONTROLLER_FORMATS = ("beckhoff", "beckhoff-pva", "csv", "joints", "ros")

JOINT_FORMATS = ("joints", "ros")
"""Those that hold the robot's joints, not its tool."""

CSV_HEADER = "index,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,ax_m_s2,ay_m_s2,az_m_s2"


def controller_text(
    sampled: SampledTrajectory,
    joints: JointPath | None = None,
    *,
    format: str = "beckhoff",  # noqa: A002 - the option's name
) -> str:
    """Return the samples as a controller reads them.

    Parameters
    ----------
    sampled : SampledTrajectory
        One row a sample.
    joints : JointPath, optional
        The same motion in the joints of the robot, for "joints" and "ros".
    format : {"beckhoff", "beckhoff-pva", "csv", "joints", "ros"}
        "beckhoff": ``index;x;y;z`` for the external set-point generator, no header. "beckhoff-pva": behind them
        velocity x;y;z, acceleration x;y;z and direction x;y;z (1, 0 or -1: the velocity's sign), as its feed function
        takes them. "csv": commas, a header with units, and the time. "joints" and "ros": see `joint_csv` and
        `ros_trajectory`.

    Returns
    -------
    str
        Metres in the robot's frame and their derivatives with nine decimals; index from 0; every row ends in a newline.
    """
    if format in JOINT_FORMATS:
        if joints is None:
            raise InputError(
                f"format {format} needs the robot's joints: give [robot] kind and lengths_m in the move file"
            )
        return joint_csv(joints) if format == "joints" else ros_trajectory(joints)
    position, velocity = rounded(sampled.position_m), rounded(sampled.velocity_m_s)
    acceleration = rounded(sampled.acceleration_m_s2)
    index = np.arange(len(position))[:, None]
    if format == "beckhoff":
        return number_table([index, position], ["%d", "%.9f"], delimiter=";")
    if format == "beckhoff-pva":
        columns = [index, position, velocity, acceleration, np.sign(velocity)]
        return number_table(columns, ["%d", "%.9f", "%.9f", "%.9f", "%d"], delimiter=";")
    if format == "csv":
        columns = [index, index * sampled.sample_time_s, position, velocity, acceleration]
        return f"{CSV_HEADER}\n" + number_table(columns, ["%d", *["%.9f"] * 4], delimiter=",")
    raise InputError(f"controller format {format!r} is not known: expected one of {', '.join(CONTROLLER_FORMATS)}")


def describe_trajectory(
    sampled: SampledTrajectory,
    report: MotionReport,
    text: str,
    joints: JointPath | None = None,
    *,
    format: str = "beckhoff",  # noqa: A002 - the option's name
    speed: float = 1.0,
) -> dict[str, Any]:
    """Return what trajectory.json says of a controller's file.

    Parameters
    ----------
    sampled : SampledTrajectory
        The tool's motion.
    report : MotionReport
        Of the trajectory that was sampled: for a dry run, of the slow one.
    text : str
        What the file holds; its UTF-8 bytes are hashed.
    joints : JointPath, optional
        The joints' motion.
    format : str
        As for `controller_text`.
    speed : float
        Share of the planned speed; below 1 it is a dry run.

    Returns
    -------
    dict
        Plain values for JSON; a peak jerk is null where the acceleration steps.
    """
    lost_pick, lost_place = report.lost_vertical_m
    file_joints = joints if format in JOINT_FORMATS else None
    shown = joints if joints is not None and joints.turn else file_joints
    return {
        "schema": TRAJECTORY_SCHEMA,
        "format": format,
        "unit": "m",
        "frame": "robot: x and y horizontal, z up",
        "sample_time_s": file_joints.sample_time_s if file_joints else sampled.sample_time_s,
        "samples": len(file_joints.position) if file_joints else len(sampled.position_m),
        "start": rounded(sampled.position_m[0]).tolist(),
        "end": rounded(sampled.position_m[-1]).tolist(),
        "duration_s": sampled.moving_s,
        "run_time_s": (len(sampled.position_m) - 1) * sampled.sample_time_s,
        "peak_velocity_m_s": list(report.peak_velocity_m_s),
        "peak_acceleration_m_s2": list(report.peak_acceleration_m_s2),
        "peak_jerk_m_s3": list(report.peak_jerk_m_s3),
        "path_deviation_mm": report.path_deviation_m * 1e3,
        "joints": None if shown is None else _describe_joints(shown, degrees=format == "joints"),
        "lost_vertical_mm": {"pick": lost_pick * 1e3, "place": lost_place * 1e3},
        "limits": [
            {"name": check.name, "limit": check.limit, "value": check.value, "kept": check.kept}
            for check in report.checks
        ],
        "speed": speed,
        "dry_run": speed < 1,
        "sha256": hashlib.sha256(text.encode()).hexdigest(),
    }


def describe_ratio(ratio: ShaperRatio | None) -> dict[str, Any] | None:
    """Return τ = t_shaper / t_acc by both definitions of t_acc; null where a move has no acceleration of that kind."""
    if ratio is None:
        return None
    return {
        "with_blend": ratio.ratio if math.isfinite(ratio.ratio) else None,
        "without_blend": ratio.level_ratio if math.isfinite(ratio.level_ratio) else None,
        "shaper_s": ratio.shaper_s,
        "acceleration_s": ratio.acceleration_s,
        "level_acceleration_s": ratio.level_acceleration_s,
    }


def _describe_joints(joints: JointPath, *, degrees: bool) -> dict[str, Any]:
    """Return what there is to say of the joints, in the units of the file."""
    factor = np.array([math.degrees(1) if degrees and unit == "rad" else 1.0 for unit in joints.units])
    return {
        "names": list(joints.names),
        "units": ["deg" if degrees and unit == "rad" else unit for unit in joints.units],
        "start": rounded(joints.position[0] * factor).tolist(),
        "end": rounded(joints.position[-1] * factor).tolist(),
        "peak_velocity": (np.abs(joints.velocity).max(axis=0) * factor).tolist(),
        "peak_acceleration": (np.abs(joints.acceleration).max(axis=0) * factor).tolist(),
        "singularity_margin": joints.singularity_margin,
    }
