"""A move as numbers that an optimiser may turn: three phases, their durations, the accelerations at or in their cells.

Lift and lower are strictly vertical: they have no acceleration across, not a small one, which an optimiser would make a
run-up of. Without a limit on the jerk the acceleration is constant in each cell; with one it runs straight from node to
node and is zero at both ends.
"""

from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, Trajectory

PHASES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How a vector of unknowns is read.

    Parameters
    ----------
    cells : tuple of int
        In lift, carry and lower.
    linear : bool
        Whether the acceleration is linear in each cell (a jerk limit) or constant.
    start_m, end_m : ndarray, shape (3,)
        Of the move.
    scale_s, scale_m_s2 : float
        By which durations and accelerations are divided in the vector.
    fractions : tuple of ndarray
        Where the cells of each phase end, as shares of its duration; the last is 1.
    """

    cells: tuple[int, int, int]
    linear: bool
    start_m: FloatArray
    end_m: FloatArray
    scale_s: float
    scale_m_s2: float
    fractions: tuple[FloatArray, ...]

    @property
    def across(self) -> int:
        """How many accelerations across there are."""
        return self.cells[1] - 1 if self.linear else self.cells[1]

    @property
    def upward(self) -> int:
        """How many accelerations upward there are."""
        return sum(self.cells) - 1 if self.linear else sum(self.cells)

    @property
    def size(self) -> int:
        """Length of the vector: three durations, the accelerations across, those upward."""
        return PHASES + self.across + self.upward

    @property
    def way(self) -> FloatArray:
        """The horizontal way, shape (3,)."""
        way: FloatArray = (self.end_m - self.start_m) * np.array([1.0, 1.0, 0.0])
        return way

    def durations(self, vectors: FloatArray) -> FloatArray:
        """Return the three durations in s, shape (..., 3)."""
        scaled: FloatArray = vectors[..., :PHASES] * self.scale_s
        return scaled

    def breaks(self, vectors: FloatArray) -> FloatArray:
        """Return the times at which cells begin and the last one ends, shape (..., cells + 1)."""
        lasting = self.durations(vectors)
        begin = np.cumsum(lasting, axis=-1) - lasting
        parts = [begin[..., [i]] + lasting[..., [i]] * share for i, share in enumerate(self.fractions)]
        return np.concatenate([np.zeros((*lasting.shape[:-1], 1)), *parts], axis=-1)

    def accelerations(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the acceleration at the start and at the end of each cell, shapes (..., cells, 2): across, upward."""
        lift, _, lower = self.cells
        rest = vectors.shape[:-1]
        x = vectors[..., PHASES : PHASES + self.across] * self.scale_m_s2
        z = vectors[..., PHASES + self.across :] * self.scale_m_s2
        if not self.linear:
            across = np.concatenate([np.zeros((*rest, lift)), x, np.zeros((*rest, lower))], axis=-1)
            both = np.stack([across, z], axis=-1)
            return both, both
        across = np.concatenate([np.zeros((*rest, lift + 1)), x, np.zeros((*rest, lower + 1))], axis=-1)
        up = np.concatenate([np.zeros((*rest, 1)), z, np.zeros((*rest, 1))], axis=-1)
        nodes = np.stack([across, up], axis=-1)
        return nodes[..., :-1, :], nodes[..., 1:, :]

    def states(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity at the breaks, shapes (..., cells + 1, 2): along the way, and up."""
        low, high = self.accelerations(vectors)
        step = np.diff(self.breaks(vectors), axis=-1)[..., None]
        gained = (low + high) / 2 * step
        velocity = np.concatenate([np.zeros_like(gained[..., :1, :]), np.cumsum(gained, axis=-2)], axis=-2)
        gone = velocity[..., :-1, :] * step + (2 * low + high) / 6 * step**2
        position = np.concatenate([np.zeros_like(gone[..., :1, :]), np.cumsum(gone, axis=-2)], axis=-2)
        return position, velocity

    def within(self, vectors: FloatArray, share: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration inside every cell, each (..., cells, k, 2), at k shares of it."""
        low, high = (each[..., None, :] for each in self.accelerations(vectors))
        first, speed = (each[..., :-1, None, :] for each in self.states(vectors))
        step = np.diff(self.breaks(vectors), axis=-1)[..., None, None]
        u, change = share[:, None], high - low
        position = first + step * u * (speed + step * u * (low / 2 + change * u / 6))
        return position, speed + step * u * (low + change * u / 2), low + change * u

    def vector_of(self, trajectory: Trajectory, breaks_s: FloatArray) -> FloatArray:
        """Return the vector whose accelerations are nearest to a trajectory's, for phases that end at `breaks_s`."""
        lasting = np.diff(breaks_s)
        head = lasting / self.scale_s
        edges = self.breaks(np.concatenate([head, np.zeros(self.across + self.upward)]))
        speeds = trajectory(edges, 1)
        unit = self.way / np.linalg.norm(self.way)
        mean = np.diff(np.stack([speeds @ unit, speeds[:, 2]], axis=1), axis=0) / np.diff(edges)[:, None]
        if self.linear:
            mean = (mean[1:] + mean[:-1]) / 2
        first = self.cells[0]
        across = mean[first : first + self.across, 0]
        return np.concatenate([head, np.concatenate([across, mean[:, 1]]) / self.scale_m_s2])

    def trajectory(self, vector: FloatArray) -> Trajectory:
        """Return the motion: piecewise polynomials that end exactly at the end point, at rest to rounding."""
        breaks = self.breaks(vector)
        low, high = self.accelerations(vector)
        position, velocity = self.states(vector)
        step = np.diff(breaks)[:, None]
        unit = self.way / np.linalg.norm(self.way)
        plane = np.stack([position[:-1], velocity[:-1], low / 2, (high - low) / (6 * step)], axis=1)
        coefficients = plane[..., :1] * unit + plane[..., 1:] * np.array([0.0, 0.0, 1.0])
        coefficients[:, 0] += self.start_m
        return Trajectory(breaks_s=breaks, coefficients=coefficients if self.linear else coefficients[:, :3])
