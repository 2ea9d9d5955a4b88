"""What a controller takes: the samples of a move as CSV, and a description beside it."""

import hashlib
import io
from typing import Any

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, SampledTrajectory
from tagsway.trajectories import MotionReport

TRAJECTORY_SCHEMA = "tagsway/trajectory/1"

DECIMALS = 9
"""Of a metre: a position rounded to 1 µm is an acceleration that is wrong by 1 m/s² after two differences at 1 kHz."""

CSV_HEADER = "index,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,ax_m_s2,ay_m_s2,az_m_s2"


def controller_csv(sampled: SampledTrajectory, *, format: str = "beckhoff") -> str:  # noqa: A002 - the option's name
    """Return the samples as a controller reads them.

    Parameters
    ----------
    sampled : SampledTrajectory
        One row a sample.
    format : {"beckhoff", "beckhoff-pva", "csv"}
        "beckhoff": ``index;x;y;z`` for the external set-point generator, no header. "beckhoff-pva": behind them
        velocity x;y;z, acceleration x;y;z and direction x;y;z (1, 0 or -1: the velocity's sign), as its feed function
        takes them. "csv": commas, a header with units, and the time.

    Returns
    -------
    str
        Metres in the robot's frame and their derivatives with nine decimals; index from 0; every row ends in a newline.
    """
    position, velocity = _rounded(sampled.position_m), _rounded(sampled.velocity_m_s)
    acceleration = _rounded(sampled.acceleration_m_s2)
    index = np.arange(len(position))[:, None]
    if format == "beckhoff":
        return _table([index, position], ["%d", "%.9f"], delimiter=";")
    if format == "beckhoff-pva":
        columns = [index, position, velocity, acceleration, np.sign(velocity)]
        return _table(columns, ["%d", "%.9f", "%.9f", "%.9f", "%d"], delimiter=";")
    if format == "csv":
        columns = [index, index * sampled.sample_time_s, position, velocity, acceleration]
        return f"{CSV_HEADER}\n" + _table(columns, ["%d", *["%.9f"] * 4], delimiter=",")
    raise InputError(f"controller format {format!r} is not known: expected beckhoff, beckhoff-pva or csv")


def describe_trajectory(
    sampled: SampledTrajectory,
    report: MotionReport,
    csv: str,
    *,
    format: str = "beckhoff",  # noqa: A002 - the option's name
    speed: float = 1.0,
) -> dict[str, Any]:
    """Return what trajectory.json says of a controller's CSV.

    Parameters
    ----------
    sampled : SampledTrajectory
        What the CSV holds.
    report : MotionReport
        Of the trajectory that was sampled: for a dry run, of the slow one.
    csv : str
        The CSV's text, whose UTF-8 bytes are hashed.
    format : str
        As for `controller_csv`.
    speed : float
        Share of the planned speed; below 1 it is a dry run.

    Returns
    -------
    dict
        Plain values for JSON; a peak jerk is null where the acceleration steps.
    """
    lost_pick, lost_place = report.lost_vertical_m
    return {
        "schema": TRAJECTORY_SCHEMA,
        "format": format,
        "unit": "m",
        "frame": "robot: x and y horizontal, z up",
        "sample_time_s": sampled.sample_time_s,
        "samples": len(sampled.position_m),
        "start": _rounded(sampled.position_m[0]).tolist(),
        "end": _rounded(sampled.position_m[-1]).tolist(),
        "duration_s": sampled.moving_s,
        "run_time_s": (len(sampled.position_m) - 1) * sampled.sample_time_s,
        "peak_velocity_m_s": list(report.peak_velocity_m_s),
        "peak_acceleration_m_s2": list(report.peak_acceleration_m_s2),
        "peak_jerk_m_s3": list(report.peak_jerk_m_s3),
        "path_deviation_mm": report.path_deviation_m * 1e3,
        "lost_vertical_mm": {"pick": lost_pick * 1e3, "place": lost_place * 1e3},
        "limits": [
            {"name": check.name, "limit": check.limit, "value": check.value, "kept": check.kept}
            for check in report.checks
        ],
        "speed": speed,
        "dry_run": speed < 1,
        "sha256": hashlib.sha256(csv.encode()).hexdigest(),
    }


def _rounded(values: FloatArray) -> FloatArray:
    """Return the values as they will be printed; adding 0 takes the sign off a zero."""
    rounded: FloatArray = np.round(values, DECIMALS) + 0.0
    return rounded


def _table(columns: list[Any], formats: list[str], *, delimiter: str) -> str:
    text = io.StringIO()
    each = [form for column, form in zip(columns, formats, strict=True) for _ in range(column.shape[1])]
    np.savetxt(text, np.hstack(columns), fmt=each, delimiter=delimiter)
    return text.getvalue()
