"""What a fitted pendulum may be said to know: whether l and k are told apart, and whether it is a point mass."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tagsway.model import GRAVITY_M_S2, Estimate, FloatArray, Notice, PendulumEstimate, Prior
from tagsway.model.estimate import NORMAL_95
from tagsway.pendulum.assumed import STATED
from tagsway.pendulum.fit import LARGEST_EXCESS, Solution
from tagsway.pendulum.model import length_m, stiffness_over_inertia, tag_radius_m
from tagsway.pendulum.record import Record
from tagsway.pendulum.ridge import Ridge

LEAST_SWING_RAD = 0.3
"""Below this swing gravity is not seen to soften, and l and k are not told apart by it."""

LEAST_SWING_WITH_LIFT_RAD, LEAST_LIFT_M = 0.2, 0.05
"""A lift changes gravity's part alone: a smaller swing will do."""

LARGEST_SWING_RAD = 1.3
"""Beyond it springs and hoses are no longer linear, and the path hangs on every start value."""

INDICATIVE_RELEASE_RAD = 0.5
"""A decay alone splits l and k by its softening only; released above this swing it gives an idea of them."""

LARGEST_NOISE_M = 1.2e-4
"""Noise of one tag: a claim holds to 0.1 mm, and the noise itself is known to a tenth or two."""

MOST_LEFT_OUT = 0.1
"""Share of samples that may be spikes; where more lie off the fitted motion, it is not the payload's."""

LARGEST_LENGTH_STD = 0.03
"""Relative standard error of l."""

SURE_LENGTH = 0.01
"""Half of the 95 % interval of l, over l, of a claim: it is one of 1 %."""

LARGEST_STIFFNESS_STD = 0.1
"""Standard error of k/J over k/J, or what the longer half of the profile's interval makes of it."""

LARGEST_PULL_STD = 3.0
"""By more than this a fit leaves a stated value only where the motion contradicts it."""

POINT_MASS_STD = 3.0
"""r = l holds where they differ by less than this many standard errors of the difference."""


FREE_SHARE = 0.01
"""Of gravity's part: a spring that is surely weaker, and perhaps none, is known well enough."""


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


def judge(record: Record, solution: Solution, ridge: Ridge, priors: tuple[Prior, ...]) -> Verdict:
    """Return whether these data tell l and k apart, by the conditions above.

    Parameters
    ----------
    record : Record
        The data.
    solution : Solution
        The pendulum fitted to them.
    ridge : Ridge
        Its profile: k/J is as sure as the longer half of the interval there says.
    priors : tuple of Prior
        What was assumed: where l, or r = l, is stated, neither a move nor a swing is needed.

    Returns
    -------
    Verdict
        A claim needs the pivot to move, a swing of 0.3 to 1.3 rad (from 0.2 with 50 mm of lift), noise up to 0.1 mm,
        residuals that noise explains, and the errors of l and k themselves.
    """
    swing = largest_swing(solution)
    length, stiffness = ridge.estimate(length_m), ridge.estimate(stiffness_over_inertia)
    stated = any(prior.name in STATED for prior in priors)
    if not np.all(np.isfinite([swing, length.std, stiffness.std])):
        return _refuse("the fit did not converge")
    refusal = _refuse_for_the_motion(record, solution, swing, stated=stated)
    if refusal is not None:
        return refusal
    if not length.std <= LARGEST_LENGTH_STD * length.value:
        spread = 100 * length.std / length.value
        return _refuse(f"l is known to {spread:.1f} % only: film a move with more swing or lift")
    if stiffness.value < -2 * stiffness.std:
        return _refuse(
            f"k/J = {stiffness.value:.1f} ± {stiffness.std:.1f} rad²/s² is below zero, which is no spring: check the "
            "tags' sizes and the frame rate"
        )
    if not (record.moved or stated):
        return Verdict(kind="indicative", reason=f"indicative only: a release at {swing:.2f} rad, without a move")
    half = NORMAL_95 * length.std / length.value
    if not half <= SURE_LENGTH:
        return Verdict(
            kind="indicative",
            reason=f"indicative only: l is known to ±{100 * half:.2f} % (95 %), expected ±{100 * SURE_LENGTH:g} %",
        )
    low, high = stiffness.ci95
    if low <= 0 and high <= FREE_SHARE * GRAVITY_M_S2 / length.value:
        return Verdict(kind="claim", reason="gravity alone turns it back: no spring beside it is left room for")
    longer = max(stiffness.value - low, high - stiffness.value) / NORMAL_95
    if not max(longer, stiffness.std) <= LARGEST_STIFFNESS_STD * stiffness.value:
        return Verdict(
            kind="indicative",
            reason=f"l is known, k is not: k/J = {stiffness.value:.1f} ± {stiffness.std:.1f} rad²/s² is too uncertain "
            "for a claim",
        )
    if stated:
        return Verdict(kind="claim", reason="what was stated of the arm tells l from k")
    return Verdict(
        kind="claim",
        reason=f"a move with {swing:.2f} rad of swing and {1e3 * record.lift_m:.0f} mm of lift tells l from k",
    )


def _refuse_for_the_motion(record: Record, solution: Solution, swing: float, *, stated: bool) -> Verdict | None:
    """Return why this motion cannot tell l from k, or that no pendulum makes it."""
    least = LEAST_SWING_WITH_LIFT_RAD if record.lift_m >= LEAST_LIFT_M else LEAST_SWING_RAD
    noise = solution.noise_m / math.sqrt(2)
    if not solution.excess <= LARGEST_EXCESS:
        return _refuse(
            f"the residuals are {math.sqrt(solution.excess):.1f} times what noise explains: the payload is more than "
            "one pendulum, or something touched it"
        )
    if not solution.left_out <= MOST_LEFT_OUT:
        return _refuse(
            f"{100 * solution.left_out:.0f} % of the samples lie off the path of one pendulum: the product slipped in "
            "its grip, something touched it, or its spring stiffens"
        )
    if not (record.moved or stated or swing >= INDICATIVE_RELEASE_RAD):
        return _refuse(
            f"from a decay alone of {swing:.2f} rad l and k cannot be told apart: film the move too, with at least "
            f"{LEAST_SWING_RAD:g} rad of swing, or state --point-mass or --length"
        )
    if not swing <= LARGEST_SWING_RAD:
        return _refuse(f"the payload swings to {swing:.2f} rad, beyond {LARGEST_SWING_RAD:g} rad: move more gently")
    if not (stated or swing >= least):
        return _refuse(f"a swing of {swing:.2f} rad is too small to tell l from k: expected at least {least:g} rad")
    if not noise <= LARGEST_NOISE_M:
        return _refuse(f"noise of {1e3 * noise:.2f} mm hides l and k: expected at most {1e3 * LARGEST_NOISE_M:g} mm")
    return None


def describe(verdict: Verdict, estimate: PendulumEstimate, solution: Solution) -> tuple[Notice, ...]:
    """Return the notices that go with a verdict."""
    notices = []
    over_inertia = estimate.stiffness_over_inertia_rad2_s2
    if verdict.kind == "refuse":
        notices.append(not_determined(verdict.reason))
    elif over_inertia is not None and over_inertia.value < 2 * over_inertia.std:
        notices.append(
            Notice(
                code="no_spring",
                message=f"k/J = {over_inertia.value:.2f} ± {over_inertia.std:.2f} rad²/s² is zero within its error: "
                "the payload hangs freely, as far as this shows",
            )
        )
    elif verdict.kind == "indicative":
        notices.append(Notice(code="pendulum_indicative", message=verdict.reason))
    if solution.alone > LARGEST_EXCESS and (verdict.kind != "refuse" or solution.tag_ratio != 1):
        notices.append(_unmodelled(solution))
    if estimate.point_mass is False and estimate.stiffness_n_m_per_rad is not None:
        notices.append(
            Notice(
                code="point_mass_equivalent",
                message="the payload is no point mass at its tag (l differs from r): k and b are those of a point mass "
                "that moves alike; k/J and b/J are what is known",
            )
        )
    if any(prior.at_least for prior in estimate.priors):
        notices.append(Notice(code="prior_stated", message="taken as stated: k ≥ 0"))
    stated = [prior for prior in estimate.priors if prior.name in STATED]
    for prior in stated:
        words = f"{STATED[prior.name]} = {prior.value:g} ± {prior.std:.2g} {'' if prior.unit == '1' else prior.unit}"
        notices.append(Notice(code="prior_stated", message=f"taken as stated: {words.strip()}"))
    if stated and not solution.largest_pull <= LARGEST_PULL_STD:
        notices.append(
            Notice(
                code="prior_disagrees",
                message=f"the motion contradicts what was stated by {solution.largest_pull:.1f} standard deviations: "
                "check it, or leave it out",
            )
        )
    return tuple(notices)


def _unmodelled(solution: Solution) -> Notice:
    left = f"one pendulum leaves {math.sqrt(solution.alone):.1f} times what noise explains"
    if solution.tag_ratio != 1:
        cause = (
            f", but not were the tags {solution.tag_ratio:.2f} times as large as stated: measure the side of their "
            "black squares, and check --tag-size; every length is as wrong"
        )
    else:
        cause = (
            ": a second body, a spring that stiffens, a slip or a sway towards the camera takes part; "
            "the errors hold it"
        )
    return Notice(code="pendulum_unmodelled", message=left + cause)


def not_determined(reason: str) -> Notice:
    """Return the notice of a pendulum whose l and k are not told apart."""
    return Notice(code="pendulum_not_determined", message=reason)


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
