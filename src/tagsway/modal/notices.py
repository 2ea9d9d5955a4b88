"""What is odd or weak about a free decay, in plain words."""

from dataclasses import replace

import numpy as np

from tagsway.modal.bound import pole_places, to_modal
from tagsway.modal.decay import ALPHA, COSINE, DRAG, FRICTION, OMEGA, SINE, SOFTENING, SQUARE
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.delta import damping_at, sees
from tagsway.modal.least_squares import DecayFit, Samples, fit_decay
from tagsway.modal.sway import Sway
from tagsway.model import ModalEstimate, Notice

CLOSE = 0.2
"""Relative distance of two modes' frequencies below which they are called a beat."""

DISAGREE = 4.0
"""Standard errors of the difference beyond which two estimators disagree."""

CYCLES_PER_MODE = 3.0
"""Below which the envelope is not seen well enough to say what damps it."""

COLOURED = 6.0
"""Power density at the sway's frequency over that of white noise from which it is told: a codec's has up to 4.5."""

REJECTED = 1.5
"""Residual of a linear decay over that of the fit with drag or friction from which it is told: chance makes 1.1."""

MISFIT = 0.005
"""Part of the amplitude that a fit may leave, coloured, before it is called wrong."""


def find_notices(modal: ModalEstimate, fit: DecayFit, sway: Sway, *, held: bool = False) -> tuple[Notice, ...]:
    """Return the warnings that a free decay deserves.

    Parameters
    ----------
    modal : ModalEstimate
        The numbers.
    fit : DecayFit
        Where they come from.
    sway : Sway
        What was fitted.
    held : bool
        Whether the decay contradicts the softening that the arc implies.

    Returns
    -------
    tuple of Notice
        Empty for a long, clean, small decay.
    """
    found = [
        *_of_damping(modal),
        *_of_cycles(modal, 1 + fit.terms.further),
        *_of_modes(modal, fit),
        *_of_estimators(modal),
    ]
    if held:
        found.append(
            Notice(
                code="softening_contradicts_arc",
                message="the frequency does not change with the swing as that of a pendulum on this arc: a spring that "
                "stiffens, or a clock, a length or a camera that drifts; the arc's softening is taken for the small "
                "swing, and its error holds the difference",
            )
        )
    return (*found, *_of_residual(fit), *_of_amplitude(modal, fit, sway))


def _of_damping(modal: ModalEstimate) -> list[Notice]:
    found, damping = [], modal.damping_ratio
    if damping is None:
        found.append(
            Notice(code="growing", message="the vibration grows: it is driven, or beats; no damping ratio is given")
        )
    elif not damping.ci95[1] - damping.ci95[0] < damping.value:
        low, high = damping.ci95
        found.append(
            Notice(
                code="damping_uncertain",
                message=f"the damping ratio is {low:.2g} to {high:.2g} (95 %): the record is too short or noisy for "
                "it, or does not tell it from drag and dry friction",
            )
        )
    return found


def _of_cycles(modal: ModalEstimate, modes: int) -> list[Notice]:
    if modal.cycles >= CYCLES_PER_MODE * modes:
        return []
    of = f", and {modes} modes share them: drag may pass for damping" if modes > 1 else ""
    message = f"only {modal.cycles:.1f} cycles of free vibration were seen{of}: film longer"
    return [Notice(code="few_cycles", message=message)]


def _of_residual(fit: DecayFit) -> list[Notice]:
    """Say where the fit leaves what no noise would."""
    found = []
    if fit.inflation > COLOURED:
        found.append(
            Notice(
                code="coloured_residual",
                message="what the fit leaves is not white noise (it swings with the sway): the errors are "
                f"{np.sqrt(fit.inflation):.1f} times larger for it",
            )
        )
    size = float(np.hypot(*fit.parameters[[COSINE, SINE]]))
    if fit.scale > MISFIT * size and fit.inflation > 5:
        found.append(
            Notice(
                code="model_misfit",
                message=f"the fit leaves {100 * fit.scale / size:.1f} % of the swing, and what it leaves swings with "
                "it: this is no decay of that form (friction, a very large swing, or a vibration that is driven)",
            )
        )
    return found


def _of_amplitude(modal: ModalEstimate, fit: DecayFit, sway: Sway) -> list[Notice]:
    """Say what a large swing changes."""
    found = []
    damping, frequency = modal.damping_ratio, modal.natural_frequency_hz
    assert frequency is not None
    angle = sway.curvature * float(np.hypot(*fit.parameters[[COSINE, SINE]]))
    if angle > 1.0:
        found.append(
            Notice(
                code="large_swing",
                message=f"the swing reaches {np.degrees(angle):.0f} degrees: the small-amplitude frequency is "
                "extrapolated; release it at a smaller angle",
            )
        )
    operating = modal.operating_frequency_hz
    if operating is not None and abs(operating.value / frequency.value - 1) > 0.005:
        found.append(
            Notice(
                code="frequency_depends_on_amplitude",
                message=f"the frequency depends on the amplitude: {operating.value:.4g} Hz at the mean amplitude, "
                f"{frequency.value:.4g} Hz for a small swing; a shaper is designed for the former",
            )
        )
    if (sees(fit, DRAG) or sees(fit, FRICTION)) and damping is not None:
        first, last = damping_at(fit, 1.0)[0], damping_at(fit, max(_last(fit, modal), 0.05))[0]
        cause = "falls with the amplitude, as drag's does" if first > last else "rises as the amplitude falls: friction"
        viscous = float(to_modal(fit.parameters)[0][1])
        found.append(
            Notice(
                code="damping_depends_on_amplitude",
                message=f"damping {cause}: the ratio is {first:.2g} at the window's start, {last:.2g} at its end, "
                f"{viscous:.2g} its viscous part; a shaper is designed for the mean amplitude's",
            )
        )
    return found


def reject_linear(samples: Samples, fit: DecayFit) -> tuple[Notice, ...]:
    """Say what a linear decay leaves, where drag or friction stands out: that is why it is not the one.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        With all its terms.

    Returns
    -------
    tuple of Notice
        Empty where nothing but viscous damping is seen, or a linear decay leaves as little.
    """
    if not (sees(fit, DRAG) or sees(fit, FRICTION)):
        return ()
    terms = replace(fit.terms, softening=False, square=False, drag=False, friction=False)
    start = fit.parameters.copy()
    start[[DRAG, FRICTION, SOFTENING, SQUARE]] = 0.0
    start[ALPHA] += float(np.sum(fit.parameters[[DRAG, FRICTION]]))
    linear = fit_decay(samples, start, terms, scale=fit.scale)
    if not linear.scale > REJECTED * fit.scale:
        return ()
    size = float(np.hypot(*linear.parameters[[COSINE, SINE]]))
    (frequency, ratio), _ = to_modal(linear.parameters)
    message = (
        f"a linear decay is rejected by its residual: it leaves {100 * linear.scale / size:.2g} % of the swing, "
        f"{linear.scale / fit.scale:.1f} times as much as the fit that is used, and would give {frequency:.4g} Hz and "
        f"a damping ratio of {ratio:.2g}"
    )
    return (Notice(code="linear_decay_rejected", message=message),)


def _last(fit: DecayFit, modal: ModalEstimate) -> float:
    p = fit.parameters
    span = np.array([modal.cycles * 2 * np.pi / p[OMEGA]])
    return float(find_envelope(span, p[ALPHA], p[DRAG], p[FRICTION])[0][0])


def _of_estimators(modal: ModalEstimate) -> list[Notice]:
    """Say where an estimator that was asked for contradicts the one that decides; none of them is averaged."""
    best, found = modal.estimates.maximum_likelihood, []
    for name, one in (
        ("the spectrum", modal.estimates.fft),
        ("the periods", modal.estimates.periods),
        ("the logarithmic decrement", modal.estimates.log_decrement),
    ):
        pairs = [("damping ratio", one.damping_ratio, best.damping_ratio)]
        if name != "the logarithmic decrement":
            pairs = [("frequency", one.natural_frequency_hz, best.natural_frequency_hz)]
        for what, rival, decided in pairs:
            if rival is None or decided is None:
                continue
            if abs(rival.value - decided.value) > DISAGREE * np.hypot(rival.std, decided.std):
                found.append(
                    Notice(
                        code="estimators_disagree",
                        message=f"{name} gives a {what} of {rival.value:.4g} ± {rival.std:.1g}, least squares "
                        f"{decided.value:.4g} ± {decided.std:.1g}: look at the decay before you use either",
                    )
                )
    return found


def _of_modes(modal: ModalEstimate, fit: DecayFit) -> list[Notice]:
    found = []
    first = fit.parameters[OMEGA]
    for mode, one in enumerate(modal.modes[1:], start=1):
        omega = fit.parameters[pole_places(mode)[0]]
        frequency, damping = one.natural_frequency_hz, one.damping_ratio
        if abs(omega / first - 1) < CLOSE:
            found.append(
                Notice(
                    code="beating",
                    message=f"the swing beats: a second mode at {frequency.value:.5g} Hz (damping ratio "
                    f"{damping.value:.2g}) is close to the first, as a sway out of the plane is; both were fitted, "
                    "and the numbers are the larger one's",
                )
            )
        else:
            found.append(
                Notice(
                    code="further_mode",
                    message=f"a further mode swings at {frequency.value:.4g} Hz (damping ratio {damping.value:.2g}): "
                    "it was fitted along, and the first mode's numbers are free of it",
                )
            )
    return found
