"""What looks odd when the stages are held against each other: hints, never a refusal."""

import math

from tagsway.model import (
    GRAVITY_M_S2,
    EstimatorResult,
    ModalEstimate,
    Notice,
    PendulumEstimate,
    VideoInfo,
)

SLOW_FOR_ITS_RADIUS = 0.6
"""Of a point mass' frequency at the same radius: a long flat bag reaches 0.74 of it, a wrong frame rate much less."""

USUAL_FREQUENCIES_HZ = (0.05, 50.0)
LEAST_AMPLITUDE_M = 5e-5
"""What hangs from a robot sways within these; outside, a unit is the likelier explanation."""

DISAGREEMENT_STD = 4.0
DISAGREEMENT_SHARE = 0.02
"""Two estimators disagree where they differ by this many standard errors *and* by this share of the frequency."""

USUAL_CAPTURE_RATES_HZ = (120.0, 200.0, 240.0, 480.0, 500.0, 960.0, 1000.0)


def diagnose(
    modal: ModalEstimate | None, pendulum: PendulumEstimate | None, video: VideoInfo | None
) -> tuple[Notice, ...]:
    """Return hints on what may be wrong with a measurement although every stage was content.

    Parameters
    ----------
    modal : ModalEstimate or None
        The mode found.
    pendulum : PendulumEstimate or None
        The pendulum found.
    video : VideoInfo or None
        The video, None for a track.

    Returns
    -------
    tuple of Notice
        Codes `units_suspect`, `frame_rate_suspect`, `estimators_disagree`, `pendulum_disagrees`.
    """
    if modal is None or modal.natural_frequency_hz is None:
        return ()
    frequency = modal.natural_frequency_hz.value
    hints = [
        *_unusual_units(modal, frequency),
        *_slow_for_its_radius(frequency, pendulum, video),
        *_estimators_disagree(modal),
    ]
    if pendulum is not None and pendulum.determined and pendulum.implied is not None:
        implied = pendulum.implied.natural_frequency_hz
        if not abs(implied / frequency - 1) <= DISAGREEMENT_SHARE:
            hints.append(
                Notice(
                    code="pendulum_disagrees",
                    message=f"the fitted pendulum sways at {implied:.3f} Hz, its decay at {frequency:.3f} Hz: the "
                    "payload is not one pendulum, or the window holds more than its free decay",
                )
            )
    return tuple(hints)


def _unusual_units(modal: ModalEstimate, frequency: float) -> list[Notice]:
    low, high = USUAL_FREQUENCIES_HZ
    if low <= frequency <= high and (modal.amplitude_m is None or modal.amplitude_m.value >= LEAST_AMPLITUDE_M):
        return []
    swing = "" if modal.amplitude_m is None else f" with a swing of {1e3 * modal.amplitude_m.value:.3g} mm"
    return [
        Notice(
            code="units_suspect",
            message=f"{frequency:.3g} Hz{swing} is unusual for a payload: is the time in s, are positions in mm?",
        )
    ]


def _slow_for_its_radius(frequency: float, pendulum: PendulumEstimate | None, video: VideoInfo | None) -> list[Notice]:
    if pendulum is None or pendulum.tag_radius_m is None or video is None:
        return []
    point_mass = math.sqrt(GRAVITY_M_S2 / pendulum.tag_radius_m.value) / (2 * math.pi)
    if not frequency < SLOW_FOR_ITS_RADIUS * point_mass:
        return []
    wanted = video.fps_hz * point_mass / frequency
    usual = min(USUAL_CAPTURE_RATES_HZ, key=lambda rate: abs(math.log(rate / wanted)))
    return [
        Notice(
            code="frame_rate_suspect",
            message=f"{frequency:.3f} Hz is slow for a radius of {1e3 * pendulum.tag_radius_m.value:.0f} mm (a point "
            f"mass would sway at {point_mass:.2f} Hz): a body with much inertia, or filmed at another rate than the "
            f"file's {video.fps_hz:g} Hz; if the camera ran at {usual:g} Hz, say --fps {usual:g}",
        )
    ]


def _estimators_disagree(modal: ModalEstimate) -> list[Notice]:
    best = modal.operating_frequency_hz  # what the others see, too: the frequency at the swing of the window
    others: dict[str, EstimatorResult] = {
        "the Fourier transform": modal.estimates.fft,
        "the log decrement": modal.estimates.log_decrement,
        "the periods": modal.estimates.periods,
    }
    hints = []
    for name, other in others.items():
        estimate = other.natural_frequency_hz
        if best is None or estimate is None:
            continue
        gap = abs(estimate.value - best.value)
        if gap > DISAGREEMENT_STD * math.hypot(best.std, estimate.std) and gap > DISAGREEMENT_SHARE * best.value:
            hints.append(
                Notice(
                    code="estimators_disagree",
                    message=f"{name} gives {estimate.value:.3f} Hz, least squares {best.value:.3f} Hz: look "
                    "at the decay's figure for a beat, a second mode, or a window that is not a free decay",
                )
            )
    return hints
