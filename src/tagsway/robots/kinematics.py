"""One way to ask any robot: which joints, which point, how fast, how far from a singularity."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Robot
from tagsway.robots.delta import Delta
from tagsway.robots.scara import Scara


class _Kinematics(Protocol):
    def find_joints(self, position_m: FloatArray) -> FloatArray: ...
    def find_tool(self, joints: FloatArray) -> FloatArray: ...
    def joint_jacobian(self, position_m: FloatArray) -> FloatArray: ...
    def singularity_margin(self, position_m: FloatArray) -> FloatArray: ...


class _Cartesian:
    """A robot whose joints are its axes."""

    def find_joints(self, position_m: FloatArray) -> FloatArray:
        return position_m.copy()

    def find_tool(self, joints: FloatArray) -> FloatArray:
        return joints.copy()

    def joint_jacobian(self, position_m: FloatArray) -> FloatArray:
        return np.tile(np.eye(3), (len(position_m), 1, 1))

    def singularity_margin(self, position_m: FloatArray) -> FloatArray:
        return np.ones(len(position_m))


def find_joints(robot: Robot, position_m: FloatArray) -> FloatArray:
    """Return the joints that put the tool at given points: the inverse kinematics.

    Parameters
    ----------
    robot : Robot
        With its lengths. A delta has its elbows outwards, as it is built; a SCARA's elbow is on the side it states.
    position_m : ndarray, shape (n, 3) or (3,)
        Points of the tool, in the robot's frame: its origin in the middle of a delta's hinges, or in a SCARA's first
        joint; z up.

    Returns
    -------
    ndarray, shape (n, 3) or (3,)
        Delta: the angle of each driven arm, in rad, 0 horizontal and outwards, positive below it. SCARA: the first
        angle from the x axis, the second from the inner arm, in rad, and z in m; the axis that turns the tool is not
        commanded. Angles lie in [-π, π); NaN where the robot cannot reach. Joint limits are `plan_joints`' business.

    Raises
    ------
    InputError
        For a robot whose lengths are not given.
    """
    return _by_row(_kinematics(robot).find_joints, position_m)


def find_tool(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return where given joints put the tool: the forward kinematics.

    Parameters
    ----------
    robot : Robot
        With its lengths.
    joints : ndarray, shape (n, 3) or (3,)
        As `find_joints` returns them.

    Returns
    -------
    ndarray, shape (n, 3) or (3,)
        Points in m; of a delta, the one below its elbows. NaN where its arms do not meet.
    """
    return _by_row(_kinematics(robot).find_tool, joints)


def joint_jacobian(robot: Robot, position_m: FloatArray) -> FloatArray:
    """Return how fast the joints turn for a velocity of the tool.

    Parameters
    ----------
    robot : Robot
        With its lengths.
    position_m : ndarray, shape (n, 3) or (3,)
        Points of the tool.

    Returns
    -------
    ndarray, shape (n, 3, 3) or (3, 3)
        J with q̇ = J ẋ, in rad/m (1 for a sliding axis); its elements grow without bound towards a singularity.
    """
    return _by_row(_kinematics(robot).joint_jacobian, position_m)


def singularity_margin(robot: Robot, position_m: FloatArray) -> FloatArray:
    """Return how far points are from where the robot loses control of its tool.

    Parameters
    ----------
    robot : Robot
        With its lengths.
    position_m : ndarray, shape (n, 3) or (3,)
        Points of the tool.

    Returns
    -------
    ndarray, shape (n,) or ()
        Between 0, on a singularity, and 1. Delta: the smaller of the least cosine between a lower arm and the way of
        its elbow (0: the leg is stretched or folded) and the smallest singular value of the matrix of the lower arms'
        directions (0: they do not hold the platform). SCARA: |sin| of the second angle. NaN out of reach.
    """
    return _by_row(_kinematics(robot).singularity_margin, position_m)


def _kinematics(robot: Robot) -> _Kinematics:
    if robot.kind == "cartesian":
        return _Cartesian()
    if not robot.lengths_m:
        raise InputError(f"a {robot.kind} robot's joints need its lengths: give [robot.lengths_m] in metres")
    return Delta.of(robot) if robot.kind == "delta" else Scara.of(robot)


def _by_row(find: Callable[[FloatArray], FloatArray], values: FloatArray) -> FloatArray:
    """Return a function of rows for one row or many."""
    rows = np.asarray(values, dtype=float)
    if rows.ndim not in (1, 2) or rows.shape[-1] != 3:
        raise InputError(f"points and joints are rows of three numbers, not an array of shape {rows.shape}")
    found = find(np.atleast_2d(rows))
    return found if rows.ndim == 2 else found[0]
