"""A shaper corrected by the residual that it left, and what that should gain."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagsway.design.motion import TAIL_PERIODS
from tagsway.design.residual import (
    DAMPING,
    LOG_F,
    LOG_LENGTH,
    OFFSET,
    PivotVelocity,
    PriorPayload,
    ResidualFit,
    ResidualRecord,
    find_phasor,
    fit_residual,
    lay_nodes,
    simulate_sways,
)
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, DesignMode, Estimate, FloatArray, Mode, Notice, Shaper, Spread
from tagsway.shapers import IMPULSE_TYPES, SHAPER_TYPES, design_shaper, residual_vibration

DRAWS = 200

WORTHWHILE = 2.0
"""A gain of fewer standard errors may be none."""

NEGLIGIBLE = 0.15
"""Of the residual: a gain that is surely smaller, or a loss, tells that its cause is not the shaper's frequency."""

SMALL = 1e-3
"""Of the move: so slow a copy of it that the pendulum is linear, and its lift nothing."""

REST_STD = 0.35
"""Relative: lift and width of the swing leave as much of another shaper's move, to within a third."""

Replan = Callable[[Shaper], tuple[PivotVelocity, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Retuned:
    """A corrected shaper, and what it should gain.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : Estimate
        Of a small swing, as the residual tells them.
    amplitude_m, phase_rad : Estimate
        Of the residual at the end of the move: sway = A cos(φ + ω_d (t - end)) while it is small.
    shaper : Shaper
        Designed anew, for the same operating amplitude.
    residual_m, expected_m : Estimate
        Largest residual with the old shaper, and what is expected with the new one for the same payload.
    notices : tuple of Notice
        Where nothing is gained, or the gain is too uncertain to tell.
    """

    natural_frequency_hz: Estimate
    damping_ratio: Estimate
    amplitude_m: Estimate
    phase_rad: Estimate
    shaper: Shaper
    residual_m: Estimate
    expected_m: Estimate
    notices: tuple[Notice, ...] = ()

    @property
    def gain(self) -> Estimate:
        """Share of the residual that is expected to go, with its error; below zero where it grows."""
        return _gain(self.residual_m, self.expected_m)


def retune_shaper(
    record: ResidualRecord,
    shaper: Shaper,
    prior: PriorPayload,
    *,
    spread_percent: float | None = None,
    replan: Replan | None = None,
    rng: np.random.Generator,
) -> Retuned:
    """Correct a shaper's frequency and damping by the residual that it left.

    Parameters
    ----------
    record : ResidualRecord
        Of the second video.
    shaper : Shaper
        That was used; designed for one mode.
    prior : PriorPayload
        The payload as it was thought to be.
    spread_percent : float, optional
        Standard deviation of the frequency between repeats, for the new shaper's residual.
    replan : callable, optional
        Of a shaper, the velocity and the duration of the move with it: then what is expected is simulated. Without it
        the part of the residual that a small level swing would leave follows V, and the rest, which lift and width of
        the swing make, is taken to stay.
    rng : numpy.random.Generator
        Draws the payloads that the errors leave possible.

    Raises
    ------
    InputError
        For a shaper of several modes, or by hand.
    NotIdentifiableError
        Where too little of the residual was seen, or nothing but noise is left.

    Notes
    -----
    See `fit_residual`. What the fitted pendulum did not explain of this residual is expected of the next one too.
    """
    if len(shaper.modes) != 1 or shaper.type not in {*SHAPER_TYPES, *IMPULSE_TYPES}:
        raise InputError(
            f"a shaper of type {shaper.type!r} and {len(shaper.modes)} modes cannot be designed anew: expected one of "
            f"{', '.join(SHAPER_TYPES)} for one mode"
        )
    fit = fit_residual(record, prior)
    corrected = _design_anew(shaper, fit, prior, spread_percent)
    draws = fit.draw(DRAWS, rng=rng)
    if replan is None:
        left = _scaled_residuals(record, prior, fit, draws, (shaper, corrected), rng=rng)
    else:
        left = _simulated_residuals(*replan(corrected), draws, prior)
    expected = np.hypot(left, fit.unexplained_m)
    residual = Estimate.normal(math.hypot(fit.largest_m, fit.unexplained_m), fit.error_m, low=0.0)
    next_residual = Estimate.normal(float(np.mean(expected)), float(np.std(expected)), low=0.0)
    return Retuned(
        natural_frequency_hz=fit.natural_frequency_hz,
        damping_ratio=fit.damping_ratio,
        amplitude_m=Estimate.normal(fit.amplitude_m, fit.error_m, low=0.0),
        phase_rad=Estimate.normal(fit.phase_rad, fit.error_m / fit.amplitude_m),
        shaper=corrected,
        residual_m=residual,
        expected_m=next_residual,
        notices=_notices(_gain(residual, next_residual), simulated=replan is not None),
    )


def _design_anew(shaper: Shaper, fit: ResidualFit, prior: PriorPayload, spread_percent: float | None) -> Shaper:
    between = None
    if spread_percent is not None:
        between = Spread(source="--frequency-spread", natural_frequency_std_percent=spread_percent, n=None)
    design = shaper.modes[0]
    mode = DesignMode(
        frequency_hz=fit.natural_frequency_hz.value * _softening(design, fit, prior),
        damping_ratio=fit.damping_ratio.value,
        amplitude_m=design.amplitude_m,
    )
    return design_shaper(shaper.type, mode, spread=between, source="retuned")


def _softening(design: DesignMode, fit: ResidualFit, prior: PriorPayload) -> float:
    """Return f at the design's amplitude over f of a small swing: 1 - q0²/16 times gravity's share of ω²."""
    if design.amplitude_m is None:
        return 1.0
    swing = min(design.amplitude_m / prior.tag_radius_m, 1.0)
    share = GRAVITY_M_S2 / math.exp(fit.parameters[LOG_LENGTH]) / (2 * math.pi * fit.natural_frequency_hz.value) ** 2
    return 1 - min(share, 1.0) * swing**2 / 16


def _simulated_residuals(
    velocity: PivotVelocity, duration_s: float, draws: FloatArray, prior: PriorPayload
) -> FloatArray:
    nodes = lay_nodes(0.0, duration_s + TAIL_PERIODS / math.exp(draws[:, LOG_F].min()))
    sways = simulate_sways(velocity, nodes, draws, prior, nodes[nodes >= duration_s])
    largest: FloatArray = np.abs(sways - draws[:, OFFSET]).max(axis=0)
    return largest


def _scaled_residuals(
    record: ResidualRecord,
    prior: PriorPayload,
    fit: ResidualFit,
    draws: FloatArray,
    shapers: tuple[Shaper, Shaper],
    *,
    rng: np.random.Generator,
) -> FloatArray:
    """Return what is left of a move that is not known: the linear part scaled by V, the rest nearly as it is."""
    end = record.end_s + TAIL_PERIODS / math.exp(fit.parameters[LOG_F])
    nodes = lay_nodes(record.start_s, end)
    time = nodes[nodes >= record.end_s]
    here = fit.parameters[None]

    def slow(time_s: FloatArray) -> FloatArray:
        return SMALL * record.velocity(time_s) * [1.0, 0.0]

    whole, level = (
        simulate_sways(velocity, nodes, here, prior, time)[:, 0] - fit.parameters[OFFSET]
        for velocity in (record.velocity, slow)
    )
    rest = float(np.abs(whole - level / SMALL).max())
    linear, _, _ = find_phasor(
        time - record.end_s, level / SMALL, fit.natural_frequency_hz.value, fit.damping_ratio.value
    )
    old, new = (_residuals_v(shaper, draws) for shaper in shapers)
    rests = rest * np.exp(REST_STD * rng.normal(size=len(draws)) + 1j * rng.uniform(0, 2 * np.pi, len(draws)))
    left: FloatArray = np.abs(linear * new / np.maximum(old, 1e-6) + rests)
    return left


def _residuals_v(shaper: Shaper, draws: FloatArray) -> FloatArray:
    modes = (Mode(natural_frequency_hz=math.exp(row[LOG_F]), damping_ratio=row[DAMPING]) for row in draws.tolist())
    return np.array([residual_vibration(shaper, mode) for mode in modes])


def _gain(now: Estimate, then: Estimate) -> Estimate:
    share = then.value / now.value
    std = share * math.hypot(now.std / now.value, then.std / max(then.value, 1e-12))
    return Estimate.normal(1 - share, std, high=1.0)


def _notices(gain: Estimate, *, simulated: bool) -> tuple[Notice, ...]:
    if gain.value > WORTHWHILE * gain.std:
        return ()
    words = f"{100 * gain.value:.0f} ± {100 * gain.std:.0f} % are no sure gain: "
    if gain.value + WORTHWHILE * gain.std < NEGLIGIBLE:
        words += (
            "what is left comes of the lift, the width of the swing or another body, not of the shaper's frequency; "
            "keep the shaper, or design a gentler move"
        )
        return (Notice(code="nothing_to_gain", message=words),)
    more = "film more of the swing that is left, or a run more"
    words += "too uncertain to tell whether the corrected shaper is the better one; "
    words += more if simulated else f"give the move that was run and its shaped axes (--move), or {more}"
    return (Notice(code="gain_uncertain", message=words),)
