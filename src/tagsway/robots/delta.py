"""A delta robot with three rotary arms."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import FloatArray, Robot

MIRRORED_M = 1e-6
"""Forward kinematics that miss a point by more have found its mirror image below the elbows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Delta:
    """Lengths of a delta robot, and where its legs stand.

    Parameters
    ----------
    offset_m : float
        By how much the base's hinges lie farther out than the platform's: the two radii enter by their difference only.
    upper_m, lower_m : float
        The driven arm and the pair of rods.
    outward, along : ndarray, shape (3, 3)
        Unit vectors of each leg, one a row: away from the centre, and along its hinge.
    """

    offset_m: float
    upper_m: float
    lower_m: float
    outward: FloatArray
    along: FloatArray

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return the geometry that a robot states."""
        azimuth = math.radians(robot.leg_azimuth_deg) + 2 * math.pi / 3 * np.arange(3)
        zero = np.zeros(3)
        return cls(
            offset_m=robot.lengths_m["base"] - robot.lengths_m["platform"],
            upper_m=robot.lengths_m["upper"],
            lower_m=robot.lengths_m["lower"],
            outward=np.column_stack([np.cos(azimuth), np.sin(azimuth), zero]),
            along=np.column_stack([-np.sin(azimuth), np.cos(azimuth), zero]),
        )

    def find_joints(self, position_m: FloatArray) -> FloatArray:
        """Return the angles, shape (n, 3), of the arms below the horizontal, elbows outwards; NaN out of reach.

        In the plane of a leg, with d outwards and w along its hinge from the base's hinge to the tool's, the lower arm
        closes where d cos q - z sin q = (d² + w² + z² + upper² - lower²) / (2 upper).
        """
        d = position_m @ self.outward.T - self.offset_m
        w = position_m @ self.along.T
        z = position_m[:, 2:]
        closing = (d**2 + w**2 + z**2 + self.upper_m**2 - self.lower_m**2) / (2 * self.upper_m)
        with np.errstate(invalid="ignore"):
            beside = np.sqrt(d**2 + z**2 - closing**2)
        joints = _wrap(np.arctan2(-z, d) - np.arctan2(beside, closing))
        # The same elbows hold a point above them too, to which the arms cannot get.
        missed = np.linalg.norm(self.find_tool(joints) - position_m, axis=1)
        joints[~(missed < MIRRORED_M)] = np.nan
        return joints

    def find_tool(self, joints_rad: FloatArray) -> FloatArray:
        """Return the tool, shape (n, 3), below the elbows; NaN where the lower arms do not meet.

        It lies a lower arm from each of the three elbows, moved inwards by the platform: on the axis through the
        centre of their circumscribed circle.
        """
        first, second, third = np.moveaxis(self._elbows(joints_rad), 1, 0)
        to_second, to_third = second - first, third - first
        normal = np.cross(to_second, to_third)
        square = np.sum(normal**2, axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            to_centre = (
                np.sum(to_third**2, axis=1, keepdims=True) * np.cross(normal, to_second)
                + np.sum(to_second**2, axis=1, keepdims=True) * np.cross(to_third, normal)
            ) / (2 * square)
            height = np.sqrt(self.lower_m**2 - np.sum(to_centre**2, axis=1, keepdims=True))
            down = -normal * np.sign(normal[:, 2:])
            tool: FloatArray = first + to_centre + height * down / np.sqrt(square)
        return tool

    def joint_jacobian(self, position_m: FloatArray) -> FloatArray:
        """Return d(angles)/d(tool), shape (n, 3, 3), rad/m: a lower arm's length does not change."""
        rods, swing = self._arms(position_m)
        with np.errstate(divide="ignore"):
            jacobian: FloatArray = rods / np.sum(rods * swing, axis=2, keepdims=True)
        return jacobian

    def singularity_margin(self, position_m: FloatArray) -> FloatArray:
        """Return the least of two, shape (n,): of a stretched leg, and of a platform that three rods do not hold.

        The one is the cosine between a rod and the way of its elbow, the other the smallest singular value of the three
        rods' directions, 1 where they are perpendicular to one another.
        """
        rods, swing = self._arms(position_m)
        stretched = np.abs(np.sum(rods * swing, axis=2)).min(axis=1) / (self.upper_m * self.lower_m)
        known = np.isfinite(stretched)
        margin = np.full(len(position_m), np.nan)
        held = np.linalg.svd(rods[known] / self.lower_m, compute_uv=False)[:, -1]
        margin[known] = np.minimum(stretched[known], held)
        return margin

    def _elbows(self, joints_rad: FloatArray) -> FloatArray:
        """Return the elbows, each moved inwards by the platform's radius, shape (n, leg, 3)."""
        reach = self.offset_m + self.upper_m * np.cos(joints_rad)
        elbows = reach[:, :, None] * self.outward
        elbows[:, :, 2] -= self.upper_m * np.sin(joints_rad)
        return elbows

    def _arms(self, position_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rods from elbow to tool, and the derivative of each elbow, both of shape (n, leg, 3)."""
        joints = self.find_joints(position_m)
        swing = -self.upper_m * np.sin(joints)[:, :, None] * self.outward
        swing[:, :, 2] -= self.upper_m * np.cos(joints)
        return position_m[:, None, :] - self._elbows(joints), swing


def _wrap(angle_rad: FloatArray) -> FloatArray:
    """Return angles in [-π, π)."""
    wrapped: FloatArray = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped
