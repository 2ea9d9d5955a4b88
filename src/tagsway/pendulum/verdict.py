"""What a fitted pendulum may be said to know: whether l and k are told apart, and whether it is a point mass."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tagsway.model import Estimate, FloatArray
from tagsway.pendulum.fit import Solution
from tagsway.pendulum.model import angular_frequency, length_m, stiffness_over_inertia, tag_radius_m
from tagsway.pendulum.record import Record

LEAST_SWING_RAD = 0.3
"""Below this swing gravity is not seen to soften, and l and k are not told apart by it."""

LEAST_SWING_WITH_LIFT_RAD, LEAST_LIFT_M = 0.2, 0.05
"""A lift changes gravity's part alone: a smaller swing will do."""

LARGEST_SWING_RAD = 1.3
"""Beyond it springs and hoses are no longer linear, and the path hangs on every start value."""

INDICATIVE_RELEASE_RAD = 0.5
"""A decay alone splits l and k by its softening only; released above this swing it gives an idea of them."""

LARGEST_NOISE_M = 1e-4
"""Noise of one tag."""

LARGEST_EXCESS = 2.0
"""Mean square of the whitened residuals; beyond, the model misses something, and k takes it up.

A right model leaves 0.3 to 1; a spring that stiffens by 20 %/rad² leaves 2 where it moves k by a fifth.
"""

LARGEST_LENGTH_STD = 0.03
"""Relative standard error of l."""

LARGEST_STIFFNESS_STD, SLIGHT_STIFFNESS_STD = 0.1, 0.01
"""Standard error of k/J over k/J, or over ω_n² where the spring is slight beside gravity."""

POINT_MASS_STD = 3.0
"""r = l holds where they differ by less than this many standard errors of the difference."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is claimed.

    Parameters
    ----------
    kind : {"claim", "indicative", "refuse"}
        Whether l and k are told apart; are given as an idea only; or are not given.
    reason : str
        One sentence.
    """

    kind: Literal["claim", "indicative", "refuse"]
    reason: str


def judge(record: Record, solution: Solution) -> Verdict:
    """Return whether these data tell l and k apart, by the conditions above.

    Parameters
    ----------
    record : Record
        The data.
    solution : Solution
        The pendulum fitted to them.

    Returns
    -------
    Verdict
        A claim needs the pivot to move, a swing of 0.3 to 1.3 rad (from 0.2 with 50 mm of lift), noise up to 0.1 mm,
        residuals that noise explains, and the errors of l and k themselves.
    """
    swing = largest_swing(solution)
    length, stiffness = solution.estimate(length_m), solution.estimate(stiffness_over_inertia)
    square = float(angular_frequency(solution.parameters)) ** 2
    spread = length.std / length.value
    least = LEAST_SWING_WITH_LIFT_RAD if record.lift_m >= LEAST_LIFT_M else LEAST_SWING_RAD
    noise = solution.noise_m / math.sqrt(2)
    share = LARGEST_STIFFNESS_STD * abs(stiffness.value)
    if not np.all(np.isfinite([swing, spread, stiffness.std])):
        return _refuse("the fit did not converge")
    if not solution.excess <= LARGEST_EXCESS:
        return _refuse(
            f"the residuals are {math.sqrt(solution.excess):.1f} times what noise explains: the payload is more than "
            "one pendulum, or something touched it"
        )
    if not record.moved and not swing >= INDICATIVE_RELEASE_RAD:
        return _refuse(
            f"from a decay alone of {swing:.2f} rad l and k cannot be told apart: film the move too, with at least "
            f"{LEAST_SWING_RAD:g} rad of swing"
        )
    if not swing <= LARGEST_SWING_RAD:
        return _refuse(f"the payload swings to {swing:.2f} rad, beyond {LARGEST_SWING_RAD:g} rad: move more gently")
    if not swing >= least:
        return _refuse(f"a swing of {swing:.2f} rad is too small to tell l from k: expected at least {least:g} rad")
    if not noise <= LARGEST_NOISE_M:
        return _refuse(f"noise of {1e3 * noise:.2f} mm hides l and k: expected at most {1e3 * LARGEST_NOISE_M:g} mm")
    if not spread <= LARGEST_LENGTH_STD:
        return _refuse(f"l is known to {100 * spread:.1f} % only: film a move with more swing or lift")
    if stiffness.value < -2 * stiffness.std:
        return _refuse(
            f"k/J = {stiffness.value:.1f} ± {stiffness.std:.1f} rad²/s² is below zero, which is no spring: check the "
            "tags' sizes and the frame rate"
        )
    if not record.moved:
        return Verdict(kind="indicative", reason=f"indicative only: a release at {swing:.2f} rad, without a move")
    if not stiffness.std <= max(share, SLIGHT_STIFFNESS_STD * square):
        return Verdict(
            kind="indicative",
            reason=f"indicative only: k/J = {stiffness.value:.1f} ± {stiffness.std:.1f} rad²/s² is known too poorly",
        )
    return Verdict(
        kind="claim",
        reason=f"a move with {swing:.2f} rad of swing and {1e3 * record.lift_m:.0f} mm of lift tells l from k",
    )


def largest_swing(solution: Solution) -> float:
    """Return the largest angle of the fitted motion."""
    return float(np.max(np.abs(solution.angle_rad)))


def is_point_mass(solution: Solution) -> bool | None:
    """Return whether r = l within three standard errors; None where their difference is too uncertain to tell.

    Notes
    -----
    The error of the difference, not those of r and l, decides: the overall scale moves both together.
    """

    def difference(parameters: FloatArray) -> FloatArray:
        return length_m(parameters) - tag_radius_m(parameters)

    gap: Estimate = solution.estimate(difference)
    length = float(length_m(solution.parameters))
    if abs(gap.value) > POINT_MASS_STD * gap.std:
        return False
    return True if gap.std <= LARGEST_LENGTH_STD * length else None


def _refuse(reason: str) -> Verdict:
    return Verdict(kind="refuse", reason=reason)
