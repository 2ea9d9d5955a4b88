"""What is odd or weak about a free decay, in plain words."""

import numpy as np

from tagsway.modal.decay import COSINE, SINE
from tagsway.modal.delta import damping_at
from tagsway.modal.least_squares import DecayFit
from tagsway.modal.sway import Sway
from tagsway.model import ModalEstimate, Notice


def find_notices(modal: ModalEstimate, fit: DecayFit, sway: Sway) -> tuple[Notice, ...]:
    """Return the warnings that a free decay deserves.

    Parameters
    ----------
    modal : ModalEstimate
        The numbers.
    fit : DecayFit
        Where they come from.
    sway : Sway
        What was fitted.

    Returns
    -------
    tuple of Notice
        Empty for a long, clean, small decay.
    """
    found = []
    damping, frequency = modal.damping_ratio, modal.natural_frequency_hz
    assert frequency is not None
    if damping is None:
        found.append(
            Notice(code="growing", message="the vibration grows: it is driven, or beats; no damping ratio is given")
        )
    elif not damping.ci95[1] - damping.ci95[0] < damping.value:
        low, high = damping.ci95
        found.append(
            Notice(
                code="damping_uncertain",
                message=f"the record is too short or too noisy for the damping ratio: {low:.2g} to {high:.2g} (95 %)",
            )
        )
    if modal.cycles < 3:
        found.append(
            Notice(
                code="few_cycles", message=f"only {modal.cycles:.1f} cycles of free vibration were seen: film longer"
            )
        )
    if fit.inflation > 2:
        found.append(
            Notice(
                code="coloured_residual",
                message="what the fit leaves is not white noise (it swings with the sway): the errors are "
                f"{np.sqrt(fit.inflation):.1f} times larger for it",
            )
        )
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
    if fit.terms.drag and damping is not None:
        law = damping_at(fit, 1.0)[0], damping.value
        found.append(
            Notice(
                code="damping_depends_on_amplitude",
                message=f"damping falls with the amplitude, as drag's does: the ratio is {law[0]:.2g} at the window's "
                f"start, {law[1]:.2g} extrapolated to a small swing",
            )
        )
    return tuple(found)
