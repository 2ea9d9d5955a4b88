"""A motion in time: piecewise polynomials that can be evaluated at any time and order."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.model.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """A rest-to-rest motion of three axes.

    Parameters
    ----------
    breaks_s : ndarray, shape (k + 1,)
        Where the pieces begin and the last one ends; the first is 0.
    coefficients : ndarray, shape (k, order + 1, 3)
        Of rising powers of (t - breaks_s[i]), for x, y and z, in metres.
    """

    breaks_s: FloatArray
    coefficients: FloatArray

    def __post_init__(self) -> None:
        pieces, _, axes = self.coefficients.shape
        if axes != 3 or len(self.breaks_s) != pieces + 1 or not np.all(np.diff(self.breaks_s) > 0):
            raise InputError("a trajectory needs rising breaks, one piece between two of them, and three axes")

    @property
    def duration_s(self) -> float:
        """When it is at rest again."""
        return float(self.breaks_s[-1])

    def __call__(self, time_s: FloatArray | float, order: int = 0) -> FloatArray:
        """Return position, or its derivative, at any times; at rest before the start and after the end.

        Parameters
        ----------
        time_s : ndarray, shape (...)
            Times. At a break the piece that begins there holds.
        order : int
            0 for position in m, 1 for velocity, 2 for acceleration, 3 for jerk.

        Returns
        -------
        ndarray, shape (..., 3)
            x, y and z.
        """
        time = np.asarray(time_s, dtype=float)
        inside = np.clip(time, 0.0, self.duration_s)
        piece = np.searchsorted(self.breaks_s[1:-1], inside, side="right")
        offset = (inside - self.breaks_s[piece])[..., None]
        degree = self.coefficients.shape[1] - 1
        value = np.zeros((*time.shape, 3))
        for power in range(degree, order - 1, -1):
            value = value * offset + math.perm(power, order) * self.coefficients[piece, power]
        if order > 0:
            value[(time < 0) | (time >= self.duration_s)] = 0.0
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledTrajectory:
    """A trajectory on the controller's grid.

    Parameters
    ----------
    sample_time_s : float
        Between two samples.
    position_m, velocity_m_s, acceleration_m_s2 : ndarray, shape (n, 3)
        x, y and z in the robot's frame; the last sample is the place point, at rest.
    moving_s : float
        When the motion ends (the samples may go on, at rest).
    """

    sample_time_s: float
    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    moving_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPath:
    """A trajectory as the robot's joints run it.

    Parameters
    ----------
    sample_time_s : float
        Between two samples.
    names : tuple of str
        Of the joints.
    units : tuple of {"rad", "m"}
        Of each joint's position: an angle, or the way of a sliding axis.
    position, velocity, acceleration : ndarray, shape (n, 3)
        Of each joint, in its unit, per s and per s².
    singularity_margin : float
        The least along the path: 1 far from every singularity, 0 on one.
    """

    sample_time_s: float
    names: tuple[str, ...]
    units: tuple[Literal["rad", "m"], ...]
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    singularity_margin: float

    @property
    def turn(self) -> bool:
        """Whether any joint turns: a cartesian robot's only slide."""
        return "rad" in self.units
