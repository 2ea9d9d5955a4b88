"""The residuals that a pendulum's fit makes small, and their slopes."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import BoolArray, FloatArray
from tagsway.pendulum.model import Unknown, predict
from tagsway.pendulum.record import Record
from tagsway.pendulum.tangent import Tangent

LEAST_MODE = 1e-2
"""A way in which the samples err together by less than this share of their noise is left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedErrors:
    """How whitened samples err together, as the pivot's uncertain path makes them: covariance 1 + U S² Uᵀ."""

    modes: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, responses: FloatArray) -> Self:
        """Return the modes of responses of shape (samples, m) to independent standard normal numbers."""
        # By their Gram matrix: ten times as quick as a singular value decomposition, and what it loses of the small
        # modes is far below the noise's 1.
        square, vectors = np.linalg.eigh(responses.T @ responses)
        kept = square > LEAST_MODE**2
        size = np.sqrt(square[kept])
        return cls(modes=responses @ (vectors[:, kept] / size), size=size)

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
    """Whitened residuals of a record, priors last, and their slopes."""

    def __init__(
        self,
        record: Record,
        priors: tuple[FloatArray, FloatArray],
        std: FloatArray,
        seen: BoolArray,
        *,
        shared: SharedErrors | None = None,
        rubbed: bool = False,
    ) -> None:
        self.record = record
        self.rows, self.target = priors
        self.std = std
        self.seen = seen
        self.shared = shared
        self.measured = measured(record)
        held = ([] if rubbed else [Unknown.FRICTION]) + ([] if np.any(seen[2]) else [Unknown.TAG_ANGLE])
        self.free = np.array([u for u in Unknown if u not in held])
        self.logarithms = self.free <= Unknown.LOG_RADIUS
        self.rubs = rubbed

    def but(
        self, *, rows: FloatArray | None = None, shared: SharedErrors | None = None, rubbed: bool | None = None
    ) -> "Problem":
        """Return the same problem with other priors or shared errors, or with dry friction free."""
        return Problem(
            self.record,
            (self.rows if rows is None else rows, self.target),
            self.std,
            self.seen,
            shared=self.shared if shared is None else shared,
            rubbed=self.rubs if rubbed is None else rubbed,
        )

    def gain(self, parameters: FloatArray, unknown: Unknown) -> float:
        """Return by how much χ² would fall if this one of the free unknowns were, by one step of Gauss-Newton."""
        left, slopes = self.linearise(parameters)
        others = self.free != unknown
        costs = [np.linalg.lstsq(columns, left)[1] for columns in (slopes[:, others], slopes)]
        return float(costs[0][0] - costs[1][0]) if all(len(cost) for cost in costs) else 0.0

    def scaled(self, camera: FloatArray) -> FloatArray:
        """Return the samples that are seen, of shape (3, n, ...), over their noise, in one column each."""
        extra = (1,) * (camera.ndim - 2)
        return np.asarray((camera / self.std.reshape(*self.std.shape, *extra))[self.seen])

    def whiten(self, camera: FloatArray) -> FloatArray:
        """Return the scaled samples, what errs together played down."""
        scaled = self.scaled(camera)
        return scaled if self.shared is None else self.shared.whiten(scaled)

    def look(self, parameters: FloatArray) -> tuple[FloatArray, Tangent]:
        """Return residuals, shape (rows,), at parameters of shape (15,), and the motion that `slopes` are of."""
        # A trial step may fly off; the search turns back from what is not finite.
        with np.errstate(all="ignore"):
            tangent = Tangent.of(self.record, parameters)
            samples = self.whiten(tangent.seen() - self.measured)
        return np.append(samples, self.rows @ parameters - self.target), tangent

    def slopes(self, tangent: Tangent) -> FloatArray:
        """Return the residuals' slopes in the free unknowns, shape (rows, free)."""
        with np.errstate(all="ignore"):
            samples = self.whiten(tangent.of_parameters(self.free))
        return np.concatenate([samples, self.rows[:, self.free]])

    def linearise(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals, shape (rows,), and slopes, shape (rows, free), at parameters of shape (15,)."""
        left, tangent = self.look(parameters)
        return left, self.slopes(tangent)

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Return residuals alone, shape (rows, m), of m sets of parameters, shape (15, m)."""
        with np.errstate(all="ignore"):
            samples = self.whiten(predict(self.record, parameters) - self.measured[:, :, None])
        return np.concatenate([samples, self.rows @ parameters - self.target[:, None]])


def measured(record: Record) -> FloatArray:
    """Return x and z of the sway and the tag's angle, shape (3, n)."""
    return np.stack([*record.sway_m.T, record.angle_rad])
