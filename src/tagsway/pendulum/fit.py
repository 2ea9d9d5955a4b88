"""Least squares of a pendulum on its record, with errors that hold the input's noise and the camera's scale."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagsway.model import BoolArray, Estimate, FloatArray
from tagsway.pendulum.arc import LEAST_STD_M, LEAST_STD_RAD
from tagsway.pendulum.assumed import Belief, rows_of
from tagsway.pendulum.blocks import block_covariance
from tagsway.pendulum.model import Unknown, angular_frequency, predict
from tagsway.pendulum.problem import Problem, SharedErrors, measured
from tagsway.pendulum.record import Record
from tagsway.pendulum.search import search
from tagsway.pendulum.tangent import Tangent
from tagsway.pendulum.unmodelled import find_sizes, find_ways, share_errors

LEAST_GAIN = 12.0
"""By which dry friction has to lower χ² to be believed in: about twice what an information criterion asks for."""

DRIVEN_STD = 1.5
"""By which the drag may come out below zero: no air drives a sway, and dry friction passes for that."""

MOST_STEPS, ROUGH, FINE = 60, 0.1, 1e-3
"""Of a search, and the gain in χ² at which it ends: a tenth is a third of a standard error."""

LARGEST_EXCESS = 2.0
"""Mean square of the whitened residuals that still counts as explained; a right model leaves 0.3 to 1."""

WRONG_SIZE_STD, LEAST_WRONG_SIZE = 0.3, 0.05
"""Of a tag whose stated size is another's, or with its margin; and how wrong it must be to be told from a spring."""

SPIKE_STD = 6.0
"""Beyond this many of a channel's own deviations a sample is a false detection."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """A fitted pendulum.

    Parameters
    ----------
    parameters : ndarray, shape (15,)
        See `Unknown`.
    covariance : ndarray, shape (15, 15)
        Of noise, of the pivot's path and of the priors together.
    scattered : ndarray, shape (15, 15)
        The same by a block bootstrap of the residuals: larger where they are coloured.
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
    largest_pull : float
        By how many of its standard deviations the fit leaves a prior, at most.
    left_out : float
        Share of the samples of the sway that were taken for spikes.
    alone : float
        The excess before anything unmodelled was allowed for: of one pendulum alone.
    tag_ratio : float
        How large the tags would have to be, over what was stated, for one pendulum to explain what is left after all;
        1 where it does, or where no size would.
    """

    parameters: FloatArray
    covariance: FloatArray
    scattered: FloatArray
    predicted: FloatArray
    angle_rad: FloatArray
    noise_m: float
    excess: float
    rms_m: float
    max_m: float
    largest_pull: float
    left_out: float
    alone: float
    tag_ratio: float

    @property
    def rubbed(self) -> bool:
        """Whether dry friction took part."""
        return bool(self.covariance[Unknown.FRICTION, Unknown.FRICTION] > 0)

    def estimate(self, quantity: Callable[[FloatArray], FloatArray], *, low: float = -math.inf) -> Estimate:
        """Return a function of the parameters with its standard error, by the delta method.

        Parameters
        ----------
        quantity : callable
            Of parameters of shape (15, m), to shape (m,).
        low : float
            Below which the quantity cannot lie.

        Returns
        -------
        Estimate
            With a normal interval, cut off at `low`.
        """
        return Estimate.normal(float(quantity(self.parameters[:, None])[0]), self.std(quantity), low=low)

    def std(self, quantity: Callable[[FloatArray], FloatArray], *, of_fit: bool = False) -> float:
        """Return the standard error of a function of the parameters.

        Parameters
        ----------
        quantity : callable
            Of parameters of shape (15, m), to shape (m,).
        of_fit : bool
            That of the fit; by default the larger of it and the bootstrap's.
        """
        step = 1e-6
        around = self.parameters[:, None] + step * np.hstack([np.eye(len(Unknown)), -np.eye(len(Unknown))])
        values = quantity(around)
        gradient = (values[: len(Unknown)] - values[len(Unknown) :]) / (2 * step)
        variance = float(gradient @ self.covariance @ gradient)
        if not of_fit:
            variance = max(variance, float(gradient @ self.scattered @ gradient))
        return math.sqrt(max(variance, 0.0))


def fit_record(record: Record, beliefs: tuple[Belief, ...], starts: list[FloatArray]) -> tuple[Problem, Solution]:
    """Fit a pendulum to a record.

    Parameters
    ----------
    record : Record
        The data.
    beliefs : tuple of Belief
        The priors.
    starts : list of ndarray, shape (15,)
        Each is polished for a few steps; the least cost goes on.

    Returns
    -------
    Problem
        What was made small in the end.
    Solution
        The parameters and their errors.

    Notes
    -----
    The fit runs three times. First the soft-L1 loss over x, z and the angle, as if the pivot's path were known: its
    residuals say how large each channel's noise is, and which samples are spikes. The input's noise moves the whole
    response and not a sample [1]_, so the second fit is generalised least squares: the covariance of a sample is its
    noise plus the scatter of the responses to draws of the pivot's path, and what a coder may have taken from all of
    the angles (`tagsway.pendulum.shortfall`). What one pendulum does not explain is then sized, and the third fit
    counts it among the errors: see `tagsway.pendulum.unmodelled`. What is left should be white with unit variance;
    where it is larger, the noise's share of the errors is widened by as much.

    References
    ----------
    .. [1] L. Ljung, System Identification, 2nd ed. (1999), on errors in the input.
    """
    std, seen = _stated(record), np.isfinite(measured(record))
    seen[:2] = np.all(seen[:2], axis=0)
    priors = rows_of(beliefs)
    first = Problem(record, priors, std, seen)
    if len(starts) > 1:
        tried = [search(first, start, steps=8, tolerance=ROUGH, loss="soft_l1") for start in starts]
        starts = [min(tried, key=lambda one: one[1])[0]]
    parameters, _ = search(first, starts[0], steps=MOST_STEPS, tolerance=ROUGH, loss="soft_l1")

    std, seen = _judge_noise(first, parameters)
    problem = Problem(record, priors, std, seen)
    draws = Tangent.of(record, parameters).of_velocity(record.velocity_draws_m_s - record.velocity_m_s[:, :, None])
    short = np.zeros(problem.measured.shape)
    short[2] = record.angle_short_rad
    together = [problem.scaled(draws) / math.sqrt(draws.shape[2]), problem.scaled(short)[:, None]]
    problem = problem.but(shared=SharedErrors.of(np.concatenate(together, axis=1)))
    parameters, cost = search(problem, parameters, steps=MOST_STEPS, tolerance=FINE, loss="linear")
    rubbed = problem.but(rubbed=True)
    least = LEAST_GAIN * max(1.0, cost / len(problem.look(parameters)[0]))
    if rubbed.gain(parameters, Unknown.FRICTION) > least or _is_driven(problem, parameters):
        parameters, _ = search(rubbed, parameters, steps=MOST_STEPS, tolerance=FINE, loss="linear")
        problem, parameters = _without_push(rubbed, parameters)
    alone = _excess(problem, parameters)
    ratio = _find_tag_ratio(problem, parameters) if alone > LARGEST_EXCESS else 1.0
    ways = find_ways(problem, parameters)
    sizes = find_sizes(problem, parameters, ways)
    if sizes.lift > 0:
        ways = find_ways(problem, parameters, pushing=True)
        sizes = find_sizes(problem, parameters, ways)
    if any(sizes):
        problem = problem.but(shared=share_errors(problem, ways, sizes))
        parameters, _ = search(problem, parameters, steps=MOST_STEPS, tolerance=FINE, loss="linear")
        problem, parameters = _without_push(problem, parameters)
    return problem, _solve(problem, parameters, alone=alone, tag_ratio=ratio)


def _without_push(problem: Problem, parameters: FloatArray) -> tuple[Problem, FloatArray]:
    """Return the fit without dry friction where that came out below zero: what pushes a payload on is something else.

    The damping would pay for it: free of each other, the two go up and down together.
    """
    if not problem.rubs or parameters[Unknown.FRICTION] > 0:
        return problem, parameters
    held = parameters.copy()
    held[Unknown.FRICTION] = 0.0
    problem = problem.but(rubbed=False)
    return problem, search(problem, held, steps=MOST_STEPS, tolerance=FINE, loss="linear")[0]


def _is_driven(problem: Problem, parameters: FloatArray) -> bool:
    """Whether the drag is surely below zero: what the payload loses of a swing rises as that falls."""
    _, jacobian = problem.linearise(parameters)
    k = int(np.flatnonzero(problem.free == Unknown.DRAG)[0])
    variance = float(np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)[k, k])
    return float(parameters[Unknown.DRAG]) < -DRIVEN_STD * math.sqrt(max(variance, 0.0))


def _find_tag_ratio(problem: Problem, parameters: FloatArray) -> float:
    """Return how much larger tags would leave no more than noise; 1 where none would.

    Gravity is known, so lengths are told by the move's lift and the swing, though far less well than by the tags.
    """
    rows = problem.rows.copy()
    of_scale = rows[:, Unknown.SCALE] > 0
    rows[of_scale, Unknown.SCALE] = 1 / WRONG_SIZE_STD
    freed = problem.but(rows=rows)
    parameters, _ = search(freed, parameters, steps=MOST_STEPS, tolerance=ROUGH, loss="linear")
    scale = float(parameters[Unknown.SCALE])
    explained = _excess(freed, parameters) <= LARGEST_EXCESS and abs(scale) > LEAST_WRONG_SIZE
    return 1 / (1 + scale) if explained else 1.0


def _excess(problem: Problem, parameters: FloatArray) -> float:
    """Return the mean square of the whitened residuals, of all or of those that err together: 1, never less."""
    left, _ = problem.look(parameters)
    samples = left[: -len(problem.rows)]
    everywhere = float(np.sum(samples**2)) / max(len(samples) - len(problem.free), 1)
    # A misfit is smooth and hides where the pivot's uncertain path could explain it: those few directions count alone.
    along_input = 0.0 if problem.shared is None else problem.shared.excess(samples)
    return max(1.0, everywhere, along_input)


def _judge_noise(problem: Problem, parameters: FloatArray) -> tuple[FloatArray, BoolArray]:
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


def _solve(problem: Problem, parameters: FloatArray, *, alone: float, tag_ratio: float) -> Solution:
    """Return the solution at the second fit's minimum."""
    record, rows = problem.record, len(problem.rows)
    residual, jacobian = problem.linearise(parameters)
    samples, slopes = residual[:-rows], jacobian[:-rows]
    excess = _excess(problem, parameters)
    prior = jacobian[-rows:].T @ jacobian[-rows:]
    inverse = np.asarray(np.linalg.pinv(slopes.T @ slopes + prior, hermitian=True), dtype=float)
    scattered = inverse @ (_scatter(problem, samples, slopes, parameters) + prior) @ inverse
    stated = np.asarray(np.linalg.pinv(slopes.T @ slopes / excess + prior, hermitian=True), dtype=float)

    predicted = predict(record, parameters[:, None])[:, :, 0]
    both = problem.seen[0]
    distance = np.hypot(*(problem.measured - predicted)[:2, both])
    return Solution(
        parameters=parameters,
        covariance=_spread(problem, stated),
        scattered=_spread(problem, scattered),
        predicted=predicted,
        angle_rad=predicted[2] - parameters[Unknown.TAG_ANGLE],
        noise_m=float(np.sqrt(np.mean(problem.std[:2, both] ** 2))),
        excess=excess,
        rms_m=float(np.sqrt(np.mean(distance**2))),
        max_m=float(np.max(distance)),
        largest_pull=float(np.max(np.abs(residual[-rows:]))),
        alone=alone,
        tag_ratio=tag_ratio,
        left_out=1 - np.count_nonzero(both) / np.count_nonzero(np.all(np.isfinite(record.sway_m), axis=1)),
    )


def _scatter(problem: Problem, samples: FloatArray, slopes: FloatArray, parameters: FloatArray) -> FloatArray:
    """Return the covariance of Jᵀ r over records whose residuals come in another order, in blocks of a period."""
    residual, jacobian = np.zeros(problem.seen.shape), np.zeros((*problem.seen.shape, slopes.shape[1]))
    residual[problem.seen], jacobian[problem.seen] = samples, slopes
    step = float(np.median(np.diff(problem.record.time_s)))
    period = 2 * np.pi / float(angular_frequency(parameters))
    return block_covariance(jacobian, residual, block=round(period / step))


def _spread(problem: Problem, covariance: FloatArray) -> FloatArray:
    """Return the covariance of the whole vector."""
    whole = np.zeros((len(Unknown), len(Unknown)))
    whole[np.ix_(problem.free, problem.free)] = covariance
    return whole


def _stated(record: Record) -> FloatArray:
    return np.stack([*record.sway_std_m.T, record.angle_std_rad])


def white_noise(residual: FloatArray) -> float:
    """Return the noise that third differences show: what a misfit leaves is smooth and hardly enters them."""
    if len(residual) < 8:
        return 0.0
    # The weights 1, 3, 3, 1 of a third difference have the squared sum 20.
    return 1.4826 * float(np.median(np.abs(np.diff(residual, 3)))) / math.sqrt(20)
