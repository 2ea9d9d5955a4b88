"""A fitted pendulum against the decay's own mode."""

import math
from dataclasses import replace

import numpy as np

from tagsway.model import Estimate, FloatArray, ModalDeviation, ModalEstimate, Notice
from tagsway.pendulum.fit import Solution
from tagsway.pendulum.model import Unknown, angular_frequency
from tagsway.pendulum.record import Record

LEAST_FREQUENCY_SHARE, LEAST_DAMPING_SHARE, LEAST_DAMPING = 0.01, 0.25, 2e-3
"""A pendulum and its decay disagree by more than these, and than their errors."""

DISAGREEMENT_STD = 4.0

DOUBTFUL_STD = 2.5
"""Between the two f_n, beyond which the way from one to the other is an error: of a right pendulum's one in eighty."""


def doubt_by_mode(solution: Solution, modal: ModalEstimate) -> Solution:
    """Return a pendulum as unsure as its f_n is apart from the decay's.

    Parameters
    ----------
    solution : Solution
        The pendulum.
    modal : ModalEstimate
        The decay's mode.

    Returns
    -------
    Solution
        The same where both f_n agree, or the decay has none.

    Notes
    -----
    For a release, which tells l by its softening alone: the decay tells f_n by hundreds of samples, and a pendulum that
    leaves it has followed what is not a pendulum's. All that its errors let follow f_n, C e / eᵀ C e for each unit of
    it, is in doubt by the gap. Not for a move: there the motion of the pivot tells l, and either f_n may be the wrong
    one.
    """
    frequency = modal.natural_frequency_hz
    own = float(solution.covariance[Unknown.LOG_FREQUENCY, Unknown.LOG_FREQUENCY])
    if frequency is None or not (frequency.value > 0 and own > 0):
        return solution
    gap = float(solution.parameters[Unknown.LOG_FREQUENCY]) - math.log(frequency.value)
    if not abs(gap) > DOUBTFUL_STD * math.hypot(math.sqrt(own), frequency.std / frequency.value):
        return solution
    way = gap / own * solution.covariance[:, Unknown.LOG_FREQUENCY]
    return replace(solution, scattered=solution.scattered + np.outer(way, way))


def compare_with_mode(
    record: Record, solution: Solution, modal: ModalEstimate
) -> tuple[ModalDeviation | None, Notice | None]:
    """Return how far the fitted pendulum's f_n and ζ lie from the decay's, and a notice where that is too far.

    Parameters
    ----------
    record : Record
        The data; the end of the free vibration gives the swing where the modal stage names none.
    solution : Solution
        The pendulum.
    modal : ModalEstimate
        The decay's mode.

    Returns
    -------
    ModalDeviation or None
        None where the decay has no frequency.
    Notice or None
        Code `pendulum_disagrees`.

    Notes
    -----
    f_n are those of a small swing. Damping is compared at the decay's mean swing A, where drag and dry friction take
    part: ζ(A) = ζ + 4 d A / (3 π) + 2 (c/ω_n²) / (π A).
    """
    frequency = modal.natural_frequency_hz
    if frequency is None:
        return None, None
    found = solution.estimate(lambda p: angular_frequency(p) / (2 * np.pi))
    percent = 100 * (found.value / frequency.value - 1)
    faults = []
    if _apart(found, frequency, LEAST_FREQUENCY_SHARE * frequency.value):
        faults.append(f"sways at {found.value:.4g} Hz, its decay at {frequency.value:.4g} Hz")
    damping = modal.operating_damping_ratio or modal.damping_ratio
    damping_percent = None
    if damping is not None and modal.amplitude_m is not None and damping.value > 0:
        swing = modal.amplitude_m.value / float(np.exp(solution.parameters[Unknown.LOG_RADIUS]))
        loss = solution.estimate(lambda p: _damping_at(p, swing))
        damping_percent = 100 * (loss.value / damping.value - 1)
        if _apart(loss, damping, max(LEAST_DAMPING_SHARE * damping.value, LEAST_DAMPING)):
            faults.append(f"is damped by {loss.value:.3g} at this swing, its decay by {damping.value:.3g}")
    deviation = ModalDeviation(natural_frequency_percent=percent, damping_ratio_percent=damping_percent)
    if not faults:
        return deviation, None
    message = f"the fitted pendulum {' and '.join(faults)}: the payload is not one pendulum, or the window holds more "
    return deviation, Notice(code="pendulum_disagrees", message=message + "than its free decay")


def _damping_at(parameters: FloatArray, swing_rad: float) -> FloatArray:
    drag = 4 / (3 * math.pi) * parameters[Unknown.DRAG] * swing_rad
    friction = 2 / math.pi * parameters[Unknown.FRICTION] / swing_rad
    return np.asarray(parameters[Unknown.DAMPING_RATIO] + drag + friction)


def _apart(one: Estimate, other: Estimate, least: float) -> bool:
    gap = abs(one.value - other.value)
    return gap > max(least, DISAGREEMENT_STD * math.hypot(one.std, other.std))
