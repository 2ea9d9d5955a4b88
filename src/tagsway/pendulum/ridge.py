"""The ridge on which l and k/J trade against each other: a profile of the likelihood over l."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model import GRAVITY_M_S2, Estimate, FloatArray, RidgeCurve
from tagsway.model.estimate import NORMAL_95
from tagsway.pendulum.fit import Solution
from tagsway.pendulum.model import Unknown, angular_frequency, length_m, stiffness_over_inertia
from tagsway.pendulum.problem import Problem

POINTS = 15
"""Lengths of the profile, evenly on both sides of the best."""

REACH_STD = 3.5
"""How far it goes, in standard errors of ln l as the fit states it: a Δχ² of 12."""

LONGEST_REACH = 0.7
"""In ln l: a factor of two, beyond which no interval is told."""

CHORDS, LEAST_GAIN = 3, 0.01
"""Steps with one set of slopes, each of which leaves about as much of the way as the slopes change along it; the last
one gains less than this in χ²."""

FINE_POINTS, CONTRADICTED_CHI2 = 2001, 9.0
"""Of the profile as a density in k, and the χ² that k ≥ 0 may cost: three standard errors."""

NARROW_REACH = 0.05
"""Up to which the slopes at the best fit serve for all lengths."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ridge:
    """The best fit for each of several lengths.

    Parameters
    ----------
    solution : Solution
        The best of all.
    parameters : ndarray, shape (15, m)
        In the order of l.
    delta_chi2 : ndarray, shape (m,)
        What each costs more than the best.
    springs_only : bool
        Whether lengths that need a k below zero are ruled out beforehand.
    """

    solution: Solution
    parameters: FloatArray
    delta_chi2: FloatArray
    springs_only: bool = False

    @classmethod
    def of(cls, problem: Problem, solution: Solution, *, springs_only: bool = False) -> Self:
        """Return the profile over l of a fit.

        Parameters
        ----------
        problem : Problem
            What the fit made small.
        solution : Solution
            Its minimum.
        springs_only : bool
            As above.

        Notes
        -----
        With l fixed, all other unknowns follow by Gauss-Newton from where the covariance puts them; all lengths are
        simulated at a time. χ² counts the samples' part by the excess of the residuals, as the covariance does.
        """
        spread = solution.std(lambda p: p[Unknown.LOG_LENGTH], of_fit=True)
        reach = min(REACH_STD * spread, LONGEST_REACH) if math.isfinite(spread) else LONGEST_REACH
        shift = np.linspace(-reach, reach, POINTS)
        column = solution.covariance[:, Unknown.LOG_LENGTH]
        along = column / max(column[Unknown.LOG_LENGTH], 1e-300)
        along[Unknown.LOG_LENGTH] = 1.0
        parameters = solution.parameters[:, None] + along[:, None] * shift
        rows = len(problem.rows)
        best, slopes = problem.linearise(solution.parameters)
        weight = np.ones(len(best))
        weight[:-rows] = 1 / math.sqrt(solution.excess)

        left = problem.residuals(parameters)
        others = problem.free != Unknown.LOG_LENGTH
        every = [problem.linearise(p)[1] for p in parameters.T] if reach > NARROW_REACH else [slopes]
        best, cost = parameters, _cost(left, weight)
        steps = [np.linalg.pinv(np.nan_to_num(weight[:, None] * one[:, others])) for one in every]
        for _ in range(CHORDS):
            parameters = parameters.copy()
            for i in range(POINTS):
                step = steps[min(i, len(steps) - 1)]
                parameters[problem.free[others], i] -= step @ np.nan_to_num(weight * left[:, i])
            left = problem.residuals(parameters)
            now = _cost(left, weight)
            better = now < cost
            best, gained = np.where(better, parameters, best), np.max(cost - now)
            cost = np.minimum(now, cost)
            if not gained > LEAST_GAIN:
                break
        return cls(solution=solution, parameters=best, delta_chi2=cost - np.min(cost), springs_only=springs_only)

    def curve(self) -> RidgeCurve:
        """Return what is drawn."""
        drawn = np.isfinite(self.delta_chi2)
        return RidgeCurve(
            length_m=length_m(self.parameters)[drawn],
            stiffness_over_inertia_rad2_s2=stiffness_over_inertia(self.parameters)[drawn],
            delta_chi2=self.delta_chi2[drawn],
        )

    def estimate(self, quantity: Callable[[FloatArray], FloatArray]) -> Estimate:
        """Return a function of the parameters that hangs on l, with the interval of the profile.

        Parameters
        ----------
        quantity : callable
            Of parameters of shape (15, m), to shape (m,).

        Returns
        -------
        Estimate
            Its interval lies where Δχ² passes 3.84, wider where the bootstrap says more than the fit; what scatters
            beside l is added. Beyond the profile it ends with the profile. Where k ≥ 0 is stated, see `_hold`.
        """
        solution = self.solution
        value, std = float(quantity(solution.parameters[:, None])[0]), solution.std(quantity)
        of_fit = solution.std(quantity, of_fit=True)
        slope, of_length = self._slope(quantity), solution.std(lambda p: p[Unknown.LOG_LENGTH], of_fit=True)
        aside = math.sqrt(max(of_fit**2 - (slope * of_length) ** 2, 0.0))
        wider = std / of_fit if of_fit > 0 else 1.0
        if self.springs_only and (held := self._hold(quantity, wider)) is not None:
            return held
        middle = np.argmin(self.delta_chi2)
        sign = np.where(np.arange(POINTS) < middle, -1.0, 1.0)
        score = np.maximum.accumulate(sign * np.sqrt(self.delta_chi2))
        ends = np.interp([-NORMAL_95 * wider, NORMAL_95 * wider], score, quantity(self.parameters))
        gaps = np.hypot([min(*ends, value) - value, max(*ends, value) - value], NORMAL_95 * wider * aside)
        return Estimate(value=value, std=std, ci95=(value - float(gaps[0]), value + float(gaps[1])))

    def _hold(self, quantity: Callable[[FloatArray], FloatArray], wider: float) -> Estimate | None:
        """Return the mean of a quantity over the lengths that leave k ≥ 0, and the shortest interval of 95 %.

        The profile is taken for the posterior density, flat beforehand in k. None where the data leave such lengths
        next to nothing: the fit alone then says that they contradict it.
        """
        stiffness = stiffness_over_inertia(self.parameters)
        order = np.argsort(stiffness)
        fine = np.linspace(max(stiffness.min(), 0.0), stiffness.max(), FINE_POINTS)
        chi2 = np.interp(fine, stiffness[order], self.delta_chi2[order]) / wider**2
        if not (fine[-1] > fine[0] and np.min(chi2) < CONTRADICTED_CHI2):
            return None
        share = np.exp(-chi2 / 2)
        share /= np.sum(share)
        values = np.interp(fine, stiffness[order], quantity(self.parameters)[order])
        value = float(share @ values)
        aside = self._scatter_of_frequency(quantity)
        std = math.hypot(math.sqrt(float(share @ (values - value) ** 2)), aside)
        likely = np.argsort(-share, kind="stable")
        kept = likely[: 1 + np.searchsorted(np.cumsum(share[likely]), 0.95)]
        ends = np.array([values[kept].min(), values[kept].max()])
        gaps, beside = np.abs(ends - value), NORMAL_95 * aside
        # An edge is smeared by all of what scatters beside it, a bell's flank by its share.
        gaps = np.where((ends == values[0]) & (fine[0] == 0), gaps + beside, np.hypot(gaps, beside))
        low, high = value - gaps[0], value + gaps[1]
        if abs(values[0]) < 1e-9 * np.max(np.abs(values)):  # k itself, or what is in proportion to it
            low = max(low, 0.0)
        return Estimate(value=value, std=std, ci95=(float(low), float(high)))

    def _scatter_of_frequency(self, quantity: Callable[[FloatArray], FloatArray]) -> float:
        """Return what the error of f_n makes of a quantity where k/J is known: l follows from both."""
        best = self.solution.parameters[:, None]
        turn = np.zeros_like(best)
        turn[Unknown.LOG_FREQUENCY] = 1.0
        turn[Unknown.LOG_LENGTH] = -2 * angular_frequency(best) ** 2 * length_m(best) / GRAVITY_M_S2
        ends = quantity(np.hstack([best - 1e-6 * turn, best + 1e-6 * turn]))
        return abs(float(ends[1] - ends[0])) / 2e-6 * self.solution.std(lambda p: p[Unknown.LOG_FREQUENCY])

    def _slope(self, quantity: Callable[[FloatArray], FloatArray]) -> float:
        """Return how a quantity changes with ln l along the ridge."""
        step = np.zeros(len(Unknown))
        column = self.solution.covariance[:, Unknown.LOG_LENGTH]
        if column[Unknown.LOG_LENGTH] > 0:
            step = 1e-6 * column / column[Unknown.LOG_LENGTH]
        ends = quantity(self.solution.parameters[:, None] + np.stack([-step, step], axis=1))
        return float(ends[1] - ends[0]) / 2e-6


def _cost(left: FloatArray, weight: FloatArray) -> FloatArray:
    cost = np.sum((weight[:, None] * left) ** 2, axis=0)
    return np.where(np.isfinite(cost), cost, np.inf)
