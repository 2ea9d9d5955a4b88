"""A solution that is known without damping, followed to a damping ratio."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import root

from tagsway.model import FloatArray

LARGEST_STEP = 0.02
"""Of the damping ratio, from one solution to the start of the next."""

SMALLEST_STEP = 1e-4
"""Where not even this step finds a solution, the branch has ended."""

LARGEST_CHANGE = 0.5
"""Of any unknown (radians, amplitudes, frequency ratios) in one step; more is a leap to another branch."""

SOLVED = 1e-10
"""Largest fault of an equation."""

Solve = Callable[[FloatArray, float], FloatArray | None]


def follow_branch(start: FloatArray, damping_ratio: float, solve: Solve) -> tuple[FloatArray, float]:
    """Return the unknowns and the damping ratio that was reached: below the one asked for where the branch ends."""
    unknowns, zeta, step = start, 0.0, LARGEST_STEP
    while zeta < damping_ratio and step >= SMALLEST_STEP:
        ahead = min(zeta + step, damping_ratio)
        found = solve(unknowns, ahead)
        if found is None:
            step /= 2
        else:
            unknowns, zeta = found, ahead
    return unknowns, zeta


def solve_near(faults: Callable[[FloatArray], FloatArray], start: FloatArray) -> FloatArray | None:
    """Return the solution near `start`, None where there is none."""
    with np.errstate(over="ignore", invalid="ignore"):  # a step that goes astray is caught below
        found = np.asarray(root(faults, start, method="hybr", tol=1e-13).x)
        solved = np.max(np.abs(faults(found))) < SOLVED
    return found if solved and np.max(np.abs(found - start)) < LARGEST_CHANGE else None
