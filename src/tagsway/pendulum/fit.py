"""Least squares of a pendulum on its record, with errors that hold the input's noise and the camera's scale."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from scipy.optimize import least_squares

from tagsway.model import SCALE_STD, BoolArray, Estimate, FloatArray
from tagsway.pendulum.arc import LEAST_STD_M, LEAST_STD_RAD, SOFTNESS_STD, Arc
from tagsway.pendulum.model import Unknown, predict
from tagsway.pendulum.priors import RELATIVE_SCALE_STD, TILT_STD_RAD, VERTICAL_SCALE_STD
from tagsway.pendulum.record import Record

PRIOR_STD = {
    Unknown.LOG_LENGTH: 1.0,
    Unknown.LOG_RADIUS: 1.0,
    Unknown.DRAG: 0.1,
    Unknown.SCALE: SCALE_STD,
    Unknown.RELATIVE_SCALE: RELATIVE_SCALE_STD,
    Unknown.VERTICAL_SCALE: VERTICAL_SCALE_STD,
    Unknown.TILT: TILT_STD_RAD,
}
"""Priors about the start (lengths, to a factor e) and about zero (the rest): they bound what the data leave open.

Air drag on payloads of this size is about 0.05 per rad, and stays below 0.2.
"""

DIFFERENCE = 1e-6
"""Step of the Jacobian's forward differences: half of double precision's digits, with all parameters of order one."""

LEAST_MODE = 1e-2
"""A way in which the pivot's path moves the samples by less than this share of their noise is left out."""

SPIKE_STD = 6.0
"""Beyond this many of a channel's own deviations a sample is a false detection."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A fitted pendulum.

    Parameters
    ----------
    parameters : ndarray, shape (14,)
        See `Unknown`.
    covariance : ndarray, shape (14, 14)
        Of noise, of the pivot's path and of the priors together.
    predicted : ndarray, shape (3, n)
        x and z of the sway in m, the tag's angle in rad.
    angle_rad : ndarray, shape (n,)
        The pendulum's angle.
    noise_m : float
        White noise of a sample of the sway, along one axis.
    excess : float
        Mean square of the whitened residuals, of all or of those that the pivot's path moves most: 1 (never less) if
        noise and that path explain all that is left.
    rms_m, max_m : float
        Of the distance between measured and predicted sway, spikes left out.
    """

    parameters: FloatArray
    covariance: FloatArray
    predicted: FloatArray
    angle_rad: FloatArray
    noise_m: float
    excess: float
    rms_m: float
    max_m: float

    def estimate(self, quantity: Callable[[FloatArray], FloatArray], *, low: float = -math.inf) -> Estimate:
        """Return a function of the parameters with its standard error, by the delta method.

        Parameters
        ----------
        quantity : callable
            Of parameters of shape (14, m), to shape (m,).
        low : float
            Below which the quantity cannot lie.

        Returns
        -------
        Estimate
            With a normal interval, cut off at `low`.
        """
        step = 1e-6
        around = self.parameters[:, None] + step * np.hstack([np.eye(len(Unknown)), -np.eye(len(Unknown))])
        values = quantity(around)
        gradient = (values[: len(Unknown)] - values[len(Unknown) :]) / (2 * step)
        std = math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))
        return Estimate.normal(float(quantity(self.parameters[:, None])[0]), std, low=low)


@dataclass(frozen=True, slots=True, kw_only=True)
class _InputModes:
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
        return np.asarray(samples - (self.modes * (1 - 1 / np.sqrt(1 + self.size**2))) @ (self.modes.T @ samples))

    def excess(self, whitened: FloatArray) -> float:
        """Return the mean square of whitened samples along the modes that matter more than noise."""
        leading = self.modes[:, self.size > 1]
        return float(np.mean((leading.T @ whitened) ** 2)) if leading.shape[1] else 0.0


class _Problem:
    """Whitened residuals of a record, and their Jacobian, from one simulation of all its columns."""

    def __init__(self, record: Record, prior_mean: FloatArray, std: FloatArray, seen: BoolArray) -> None:
        self.record = record
        self.prior_mean = prior_mean
        self.std = std
        self.seen = seen
        self.input_modes: _InputModes | None = None
        self.measured = measured(record)
        self.free = np.array([u for u in Unknown if u != Unknown.TAG_ANGLE or np.any(seen[2])])
        self.prior_std = np.array([PRIOR_STD.get(Unknown(int(u)), math.inf) for u in self.free])
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

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
        full = self.prior_mean.copy()
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
            columns = np.repeat(self.parameters(free)[:, None], len(free) + 1, axis=1)
            columns[self.free, np.arange(1, len(free) + 1)] += DIFFERENCE
            # A trial step may fly off; the optimiser turns back from what is not finite.
            with np.errstate(all="ignore"):
                simulated = predict(self.record, columns)
                slopes = self.whiten((simulated[:, :, 1:] - simulated[:, :, :1]) / DIFFERENCE)
                samples = self.whiten(simulated[:, :, 0] - self.measured)
            prior = (free - self.prior_mean[self.free]) / self.prior_std
            jacobian = np.vstack([slopes, np.diag(1 / self.prior_std)])
            self._last = (free.copy(), np.concatenate([samples, prior]), jacobian)
        return self._last[1], self._last[2]


def measured(record: Record) -> FloatArray:
    """Return x and z of the sway and the tag's angle, shape (3, n)."""
    return np.stack([*record.sway_m.T, record.angle_rad])


def fit_record(record: Record, arc: Arc, starts: list[FloatArray]) -> Solution:
    """Fit a pendulum to a record.

    Parameters
    ----------
    record : Record
        The data.
    arc : Arc
        Its radius is the prior's centre of r and l.
    starts : list of ndarray, shape (14,)
        Each is polished for a few steps; the least cost goes on.

    Returns
    -------
    Solution
        The parameters and their errors.

    Notes
    -----
    The fit runs twice. First the soft-L1 loss over x, z and the angle, as if the pivot's path were known: its residuals
    say how large each channel's noise is, and which samples are spikes. The input's noise moves the whole response and
    not a sample [1]_, so the second fit is generalised least squares: the covariance of a sample is its noise plus the
    scatter of the responses to draws of the pivot's path. What is then left should be white with unit variance; where
    it is larger, the noise's share of the errors is widened by as much.

    References
    ----------
    .. [1] L. Ljung, System Identification, 2nd ed. (1999), on errors in the input.
    """
    std, seen = _stated(record), np.isfinite(measured(record))
    seen[:2] = np.all(seen[:2], axis=0)
    prior_mean = np.zeros(len(Unknown))
    prior_mean[[Unknown.LOG_LENGTH, Unknown.LOG_RADIUS]] = math.log(arc.radius_m)
    first = _Problem(record, prior_mean, std, seen)
    if len(starts) > 1:
        starts = [min((_minimise(first, start, steps=8) for start in starts), key=lambda one: one[1])[0]]
    parameters, _ = _minimise(first, starts[0], steps=25)

    std, seen = _judge_noise(first, parameters)
    second = _Problem(record, prior_mean, std, seen)
    second.input_modes = _InputModes.of(second.scaled(_responses(record, parameters)))
    parameters, _ = _minimise(second, parameters, steps=12, loss="linear")
    return _solve(second, parameters)


def _minimise(
    problem: _Problem, start: FloatArray, *, steps: int, loss: Literal["soft_l1", "linear"] = "soft_l1"
) -> tuple[FloatArray, float]:
    solution = least_squares(
        problem.residual,
        start[problem.free],
        jac=problem.jacobian,
        loss=loss,
        f_scale=SOFTNESS_STD,
        x_scale="jac",
        xtol=1e-7,
        ftol=1e-7,
        gtol=1e-7,
        max_nfev=steps,
    )
    return problem.parameters(solution.x), float(solution.cost)


def _judge_noise(problem: _Problem, parameters: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return each sample's noise as the residuals show it, and which samples are no spikes."""
    left = problem.measured - predict(problem.record, parameters[:, None])[:, :, 0]
    std, seen = problem.std.copy(), problem.seen.copy()
    for channel in range(3):
        row, here = left[channel] / problem.std[channel], problem.seen[channel]
        if not np.any(here):
            continue
        least = (LEAST_STD_M, LEAST_STD_M, LEAST_STD_RAD)[channel] / float(np.max(problem.std[channel, here]))
        factor = max(white_noise(row[here]), 1.0 if problem.record.std_stated else least)
        # A tag that does not quite turn with the product is a poorer witness than its noise says.
        typical = 1.4826 * float(np.median(np.abs(row[here])))
        std[channel] *= max(factor, typical) if channel == 2 else factor
        seen[channel, here] &= np.abs(row[here]) <= SPIKE_STD * max(factor, typical)
    seen[:2] = np.all(seen[:2], axis=0)
    return std, seen


def _responses(record: Record, parameters: FloatArray) -> FloatArray:
    """Return what each draw of the pivot's path changes of the samples, shape (3, n, draws)."""
    draws = record.velocity_draws_m_s
    columns = np.repeat(parameters[:, None], draws.shape[2], axis=1)
    shifted = predict(record, columns, draws) - predict(record, parameters[:, None])
    return np.where(np.isfinite(shifted), shifted, 0.0)


def _solve(problem: _Problem, parameters: FloatArray) -> Solution:
    """Return the solution at the second fit's minimum."""
    record, free = problem.record, parameters[problem.free]
    residual, jacobian = problem.residual(free), problem.jacobian(free)
    samples = residual[: -len(free)]
    everywhere = float(np.sum(samples**2)) / max(len(samples) - len(free), 1)
    # A misfit is smooth and hides where the pivot's uncertain path could explain it: those few directions count alone.
    along_input = 0.0 if problem.input_modes is None else problem.input_modes.excess(samples)
    excess = max(1.0, everywhere, along_input)
    noise_only = jacobian[: -len(free)]
    information = noise_only.T @ noise_only / excess + np.diag(problem.prior_std**-2.0)
    covariance = np.zeros((len(Unknown), len(Unknown)))
    covariance[np.ix_(problem.free, problem.free)] = np.linalg.pinv(information, hermitian=True)

    predicted = predict(record, parameters[:, None])[:, :, 0]
    both = problem.seen[0]
    distance = np.hypot(*(problem.measured - predicted)[:2, both])
    return Solution(
        parameters=parameters,
        covariance=covariance,
        predicted=predicted,
        angle_rad=predicted[2] - parameters[Unknown.TAG_ANGLE],
        noise_m=float(np.sqrt(np.mean(problem.std[:2, both] ** 2))),
        excess=excess,
        rms_m=float(np.sqrt(np.mean(distance**2))),
        max_m=float(np.max(distance)),
    )


def _stated(record: Record) -> FloatArray:
    return np.stack([*record.sway_std_m.T, record.angle_std_rad])


def white_noise(residual: FloatArray) -> float:
    """Return the noise that third differences show: what a misfit leaves is smooth and hardly enters them."""
    if len(residual) < 8:
        return 0.0
    # The weights 1, 3, 3, 1 of a third difference have the squared sum 20.
    return 1.4826 * float(np.median(np.abs(np.diff(residual, 3)))) / math.sqrt(20)
