"""What takes joints: a table in degrees, and a ROS JointTrajectory."""

import json

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, JointPath
from tagsway.store.tables import number_table, rounded

ROS_DECIMALS = 9


def joint_csv(joints: JointPath) -> str:
    """Return a joint path as a table in degrees.

    Parameters
    ----------
    joints : JointPath
        One row a sample; at least one joint must turn.

    Returns
    -------
    str
        A header with units, then index, time and position, velocity and acceleration of each joint: degrees with nine
        decimals (metres for a sliding axis), commas, a newline at the end of every row.

    Raises
    ------
    InputError
        For a robot that has no joint that turns: `csv` already holds its axes.
    """
    if not joints.turn:
        raise InputError(
            'a cartesian robot has no joints to give in degrees: expected [robot] kind = "delta" or "scara" with its '
            "lengths_m in the move file, or --format csv"
        )
    factor = np.array([180 / np.pi if unit == "rad" else 1.0 for unit in joints.units])
    units = ["deg" if unit == "rad" else unit for unit in joints.units]
    index = np.arange(len(joints.position))[:, None]
    columns = [index, index * joints.sample_time_s]
    header = ["index", "time_s"]
    for values, prefix, per in (
        (joints.position, "", ""),
        (joints.velocity, "v_", "_s"),
        (joints.acceleration, "a_", "_s2"),
    ):
        columns.append(rounded(values * factor))
        header += [f"{prefix}{_plain(name)}_{unit}{per}" for name, unit in zip(joints.names, units, strict=True)]
    return ",".join(header) + "\n" + number_table(columns, ["%d", *["%.9f"] * 4], delimiter=",")


def ros_trajectory(joints: JointPath) -> str:
    """Return a joint path as the YAML of a ROS 2 `trajectory_msgs/msg/JointTrajectory`.

    Parameters
    ----------
    joints : JointPath
        One point a sample.

    Returns
    -------
    str
        Radians and metres, as ROS has them; every point with its position, velocity, acceleration and time from the
        start. Names are quoted, so that no name can be anything else than text.
    """
    step_ns = joints.sample_time_s * 1e9
    lines = [
        "# trajectory_msgs/msg/JointTrajectory (ROS 2): rad and m, per s and per s²",
        "header:",
        "  stamp: {sec: 0, nanosec: 0}",
        '  frame_id: ""',
        f"joint_names: [{', '.join(json.dumps(name, ensure_ascii=False) for name in joints.names)}]",
        "points:",
    ]
    rows = zip(joints.position, joints.velocity, joints.acceleration, strict=True)
    for sample, (position, velocity, acceleration) in enumerate(rows):
        seconds, nanoseconds = divmod(round(sample * step_ns), 1_000_000_000)
        lines += [
            f"- positions: {_flow(position)}",
            f"  velocities: {_flow(velocity)}",
            f"  accelerations: {_flow(acceleration)}",
            f"  time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}",
        ]
    return "\n".join(lines) + "\n"


def _flow(values: FloatArray) -> str:
    return "[" + ", ".join(f"{value:.{ROS_DECIMALS}f}" for value in rounded(values)) + "]"


def _plain(name: str) -> str:
    """Return a joint's name for a header: letters, digits and underscores."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)
