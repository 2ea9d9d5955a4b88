"""A SCARA robot: two arms in the plane, and a vertical axis."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import FloatArray, Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class Scara:
    """Lengths of a SCARA whose first joint is the origin, and the side of its elbow.

    Parameters
    ----------
    inner_m, outer_m : float
        The arms.
    side : float
        The sign of the second angle: 1 with the elbow on the right, -1 on the left.
    """

    inner_m: float
    outer_m: float
    side: float

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return the geometry that a robot states."""
        lengths = robot.lengths_m
        return cls(inner_m=lengths["inner"], outer_m=lengths["outer"], side=1.0 if robot.elbow == "right" else -1.0)

    def find_joints(self, position_m: FloatArray) -> FloatArray:
        """Return both angles, the outer arm's from the inner one's, and z, shape (n, 3); NaN out of reach."""
        x, y, z = position_m.T
        product = 2 * self.inner_m * self.outer_m
        cosine = (x**2 + y**2 - self.inner_m**2 - self.outer_m**2) / product
        with np.errstate(invalid="ignore"):
            second = self.side * np.arctan2(np.sqrt(1 - cosine**2), cosine)
        bend = np.arctan2(self.outer_m * np.sin(second), self.inner_m + self.outer_m * np.cos(second))
        first = (np.arctan2(y, x) - bend + np.pi) % (2 * np.pi) - np.pi
        return np.column_stack([first, second, np.where(np.isfinite(second), z, np.nan)])

    def find_tool(self, joints: FloatArray) -> FloatArray:
        """Return the tool, shape (n, 3)."""
        first, second, z = joints.T
        x = self.inner_m * np.cos(first) + self.outer_m * np.cos(first + second)
        y = self.inner_m * np.sin(first) + self.outer_m * np.sin(first + second)
        return np.column_stack([x, y, z])

    def joint_jacobian(self, position_m: FloatArray) -> FloatArray:
        """Return d(joints)/d(tool), shape (n, 3, 3): rad/m, and 1 for z."""
        x, y, _ = position_m.T
        first, second, _ = self.find_joints(position_m).T
        jacobian = np.zeros((len(position_m), 3, 3))
        outer = self.outer_m * np.column_stack([np.cos(first + second), np.sin(first + second)])
        with np.errstate(divide="ignore", invalid="ignore"):
            area = (self.inner_m * self.outer_m * np.sin(second))[:, None]
            jacobian[:, 0, :2] = outer / area
            jacobian[:, 1, :2] = -np.column_stack([x, y]) / area
        jacobian[:, 2, 2] = 1.0
        return jacobian

    def singularity_margin(self, position_m: FloatArray) -> FloatArray:
        """Return |sin| of the second angle, shape (n,): 0 with the arms in one line."""
        margin: FloatArray = np.abs(np.sin(self.find_joints(position_m)[:, 1]))
        return margin
