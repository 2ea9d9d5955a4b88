"""The search for the parameters that leave least: Levenberg's and Marquardt's, with a loss that spikes cannot pull."""

from typing import Literal

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from tagsway.model import FloatArray
from tagsway.pendulum.arc import SOFTNESS_STD
from tagsway.pendulum.problem import Problem

LONGEST_STEP = 0.5
"""In the logarithms of f, l and r: beyond, the slopes promise nothing."""

Loss = Literal["soft_l1", "linear"]

FIRST_DAMPING, LARGEST_DAMPING = 1e-4, 1e8
"""Of the step, in shares of the curvature along each unknown."""

LEAST_DAMPING, EASE, PRESS = 1e-9, 0.1, 5.0
"""A step that keeps its promise eases the damping so much, one that does not help presses it; in between, by Nielsen's
rule, a step that helped less than it promised leaves the damping about as it is."""


def search(
    problem: Problem, start: FloatArray, *, steps: int, tolerance: float, loss: Loss
) -> tuple[FloatArray, float]:
    """Return the parameters that leave least, and χ² there.

    Parameters
    ----------
    problem : Problem
        Residuals and slopes.
    start : ndarray, shape (15,)
        Where to begin.
    steps : int
        At most so many.
    tolerance : float
        The search ends where the next step promises to lower χ² by less; where the model leaves more than noise, by
        less than so many times its mean square: the errors are wider by as much.
    loss : {"soft_l1", "linear"}
        What is summed: 2 C² (√(1 + r²/C²) - 1) with C = 2, or r².

    Returns
    -------
    ndarray, shape (15,)
        The best parameters that were met.
    float
        Their sum; infinite where even the start flies off.

    Notes
    -----
    `scipy.optimize.least_squares` decomposes the whole Jacobian at each step, which with thousands of samples and 14
    unknowns takes four times as long as simulating them. The weights of the loss are its slope over that of the
    square, which bound it from above: a step lowers it wherever the slopes hold.
    """
    best, damping = start, FIRST_DAMPING
    left, tangent = problem.look(best)
    cost = _sum(left, loss)
    for _ in range(steps):
        slopes = problem.slopes(tangent)
        if not np.isfinite(cost) or not np.all(np.isfinite(slopes)):
            break
        weighted = _weights(left, loss)[:, None] * slopes
        gradient, information = weighted.T @ left, weighted.T @ slopes
        scale = np.maximum(np.diag(information), 1e-30)
        enough = tolerance * max(1.0, cost / len(left))
        while damping < LARGEST_DAMPING:
            step = _solve(information + np.diag(damping * scale), gradient)
            if step is None or not np.max(np.abs(step)[problem.logarithms]) <= LONGEST_STEP:
                damping *= PRESS
                continue
            promised = float(step @ gradient)
            trial = best.copy()
            trial[problem.free] -= step
            now, ahead = problem.look(trial)
            after = _sum(now, loss)
            if after < cost:
                break
            if promised < enough:
                return best, cost
            damping *= PRESS
        else:
            break
        kept = (cost - after) / max(promised, 1e-30)
        best, left, tangent, cost = trial, now, ahead, after
        damping = max(damping * max(EASE, 1 - (2 * kept - 1) ** 3), LEAST_DAMPING)
        if promised < enough:
            break
    return best, cost


def _solve(information: FloatArray, gradient: FloatArray) -> FloatArray | None:
    try:
        return np.asarray(cho_solve(cho_factor(information), gradient))
    except LinAlgError:
        return None


def _sum(left: FloatArray, loss: Loss) -> float:
    with np.errstate(over="ignore"):
        square = left**2
    if loss == "soft_l1":
        square = 2 * SOFTNESS_STD**2 * (np.sqrt(1 + square / SOFTNESS_STD**2) - 1)
    total = float(np.sum(square))
    return total if np.isfinite(total) else np.inf


def _weights(left: FloatArray, loss: Loss) -> FloatArray:
    """Return what each residual counts: the loss's slope over the square's, so that no step can overshoot for it."""
    return np.ones_like(left) if loss == "linear" else (1 + (left / SOFTNESS_STD) ** 2) ** -0.5
