"""The residuals that a pendulum's fit makes small, and their slopes, for one set of parameters or many at a time."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import BoolArray, FloatArray
from tagsway.pendulum.model import Unknown, predict
from tagsway.pendulum.record import Record

DIFFERENCE = 1e-6
"""Step of the Jacobian's forward differences: half of double precision's digits, with all parameters of order one."""

LEAST_MODE = 1e-2
"""A way in which the pivot's path moves the samples by less than this share of their noise is left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputModes:
    """How the pivot's uncertain path moves the whitened samples: covariance 1 + U S² Uᵀ beside the noise's 1."""

    modes: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, responses: FloatArray) -> Self:
        """Return the modes of responses of shape (samples, draws) to draws of the path."""
        # By the draws' Gram matrix: ten times as quick as a singular value decomposition, and what it loses of the
        # small modes is far below the noise's 1.
        square, vectors = np.linalg.eigh(responses.T @ responses / responses.shape[1])
        kept = square > LEAST_MODE**2
        size = np.sqrt(square[kept])
        return cls(modes=responses @ (vectors[:, kept] / (size * math.sqrt(responses.shape[1]))), size=size)

    def whiten(self, samples: FloatArray) -> FloatArray:
        """Return (1 + U S² Uᵀ)^(-1/2) of samples of shape (samples, ...)."""
        flat = samples.reshape(len(samples), -1)
        played_down = (self.modes * (1 - 1 / np.sqrt(1 + self.size**2))) @ (self.modes.T @ flat)
        return np.asarray(samples - played_down.reshape(samples.shape))

    def excess(self, whitened: FloatArray) -> float:
        """Return the mean square of whitened samples along the modes that matter more than noise."""
        leading = self.modes[:, self.size > 1]
        return float(np.mean((leading.T @ whitened) ** 2)) if leading.shape[1] else 0.0


class Problem:
    """Whitened residuals of a record, and their Jacobian, from one simulation of all its columns."""

    def __init__(
        self,
        record: Record,
        priors: tuple[FloatArray, FloatArray],
        std: FloatArray,
        seen: BoolArray,
        *,
        rubbed: bool = False,
    ) -> None:
        self.record = record
        self.rows, self.target = priors
        self.std = std
        self.seen = seen
        self.input_modes: InputModes | None = None
        self.measured = measured(record)
        held = ([] if rubbed else [Unknown.FRICTION]) + ([] if np.any(seen[2]) else [Unknown.TAG_ANGLE])
        self.free = np.array([u for u in Unknown if u not in held])
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def rubbed(self) -> "Problem":
        """Return the same problem with dry friction free."""
        same = Problem(self.record, (self.rows, self.target), self.std, self.seen, rubbed=True)
        same.input_modes = self.input_modes
        return same

    def gain(self, parameters: FloatArray, unknown: Unknown) -> float:
        """Return by how much χ² would fall if this one of the free unknowns were, by one step of Gauss-Newton."""
        left, slopes = self.linearise(parameters[:, None])
        others = self.free != unknown
        costs = [np.linalg.lstsq(columns, left[:, 0])[1] for columns in (slopes[:, others, 0], slopes[:, :, 0])]
        return float(costs[0][0] - costs[1][0]) if all(len(cost) for cost in costs) else 0.0

    def scaled(self, camera: FloatArray) -> FloatArray:
        """Return the samples that are seen, of shape (3, n, ...), over their noise, in one column each."""
        extra = (1,) * (camera.ndim - 2)
        return np.asarray((camera / self.std.reshape(*self.std.shape, *extra))[self.seen])

    def whiten(self, camera: FloatArray) -> FloatArray:
        """Return the scaled samples, what the pivot's path makes uncertain played down."""
        scaled = self.scaled(camera)
        return scaled if self.input_modes is None else self.input_modes.whiten(scaled)

    def parameters(self, free: FloatArray) -> FloatArray:
        """Return the full vector."""
        full = np.zeros(len(Unknown))
        full[self.free] = free
        return full

    def residual(self, free: FloatArray) -> FloatArray:
        """Return what is left, priors last."""
        return self._both(free)[0]

    def jacobian(self, free: FloatArray) -> FloatArray:
        """Return its slopes."""
        return self._both(free)[1]

    def _both(self, free: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self._last is None or not np.array_equal(self._last[0], free):
            left, slopes = self.linearise(self.parameters(free)[:, None])
            self._last = (free.copy(), left[:, 0], slopes[:, :, 0])
        return self._last[1], self._last[2]

    def linearise(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals, shape (rows, m), and slopes, shape (rows, free, m), of m sets of parameters, (15, m)."""
        m, width = parameters.shape[1], len(self.free)
        columns = np.repeat(parameters[:, None, :], width + 1, axis=1)
        columns[self.free, np.arange(1, width + 1)] += DIFFERENCE
        # A trial step may fly off; the optimiser turns back from what is not finite.
        with np.errstate(all="ignore"):
            simulated = predict(self.record, columns.reshape(len(Unknown), -1))
            simulated = simulated.reshape(*simulated.shape[:2], width + 1, m)
            slopes = self.whiten((simulated[:, :, 1:] - simulated[:, :, :1]) / DIFFERENCE)
        prior = np.repeat(self.rows[:, self.free, None], m, axis=2)
        return self._residuals(simulated[:, :, 0], parameters), np.concatenate([slopes, prior])

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Return residuals alone, shape (rows, m), of m sets of parameters, shape (15, m)."""
        with np.errstate(all="ignore"):
            return self._residuals(predict(self.record, parameters), parameters)

    def _residuals(self, simulated: FloatArray, parameters: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            samples = self.whiten(simulated - self.measured[:, :, None])
        return np.concatenate([samples, self.rows @ parameters - self.target[:, None]])


def measured(record: Record) -> FloatArray:
    """Return x and z of the sway and the tag's angle, shape (3, n)."""
    return np.stack([*record.sway_m.T, record.angle_rad])
