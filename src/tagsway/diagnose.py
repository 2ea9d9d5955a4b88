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

SLOW_FOR_ITS_RADIUS, FAST_FOR_ITS_RADIUS = 0.6, 3.0
"""Of a point mass' frequency at the same radius: a long flat bag reaches 0.74 of it, a wrong frame rate much less;
above it is what a stiff joint holds."""

TOO_SLOW_FOR_ITS_RADIUS = 0.4
"""Where much inertia is less likely than slow motion, which begins at a factor of four."""

SLOW_FOR_ITS_LENGTH = 0.93
"""Of the frequency of the equivalent length, which no payload that gravity pulls back goes below; and a film that is
played slowly shows the length itself as it is."""

SENSIBLE_SHARES = (0.74, FAST_FOR_ITS_RADIUS)
"""Of a point mass' frequency: where another capture rate would put a payload that makes sense, from a long flat bag to
a stiff joint."""

USUAL_FREQUENCIES_HZ = (0.05, 50.0)
LEAST_AMPLITUDE_M = 5e-5
"""What hangs from a robot sways within these; outside, a unit is the likelier explanation."""

DISAGREEMENT_STD = 4.0
DISAGREEMENT_SHARE = 0.02
"""Two estimators disagree where they differ by this many standard errors *and* by this share of the frequency."""

USUAL_CAPTURE_RATES_HZ = (30.0, 60.0, 100.0, 120.0, 200.0, 240.0, 480.0, 500.0, 960.0, 1000.0, 2000.0)
"""Of phones and of high-speed cameras."""

FEWEST_IMAGES = 4.0
"""To a cycle: with less than two a sway looks like a slower one, and with little more nobody can tell."""

PLAYBACK_HZ = 61.0
"""Slow motion is played at the rate of a screen or of television; a file that says more says how it was filmed."""


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
        Codes `units_suspect`, `alias_possible`, `frame_rate_suspect`, `slow_for_its_radius`, `fast_for_its_radius`,
        `estimators_disagree`.
    """
    if modal is None or modal.natural_frequency_hz is None:
        return ()
    frequency = modal.natural_frequency_hz.value
    hints = [
        *_unusual_units(modal, frequency),
        *_possible_alias(frequency, video),
        *_odd_for_its_size(frequency, pendulum, video),
        *_estimators_disagree(modal),
    ]
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


def _possible_alias(frequency: float, video: VideoInfo | None) -> list[Notice]:
    if video is None or FEWEST_IMAGES * frequency <= video.fps_hz:
        return []
    words = (
        f"{video.fps_hz:.4g} Hz gives {video.fps_hz / frequency:.2g} images to a cycle of {frequency:.3g} Hz: one of "
        f"{video.fps_hz - frequency:.3g} Hz would look the same; film at {2 * FEWEST_IMAGES * frequency:.2g} Hz or more"
    )
    return [Notice(code="alias_possible", message=words)]


def _odd_for_its_size(frequency: float, pendulum: PendulumEstimate | None, video: VideoInfo | None) -> list[Notice]:
    """Hold the frequency against √(g/r)/2π: r of the arc, or the length where the tool's motion gave that."""
    if pendulum is None or video is None:
        return []
    if pendulum.determined and pendulum.length_m is not None:
        size, name = pendulum.length_m.value, "an equivalent length"
        slow = too_slow = SLOW_FOR_ITS_LENGTH
    elif pendulum.tag_radius_m is not None:
        size, name = pendulum.tag_radius_m.value, "a radius"
        slow, too_slow = SLOW_FOR_ITS_RADIUS, TOO_SLOW_FOR_ITS_RADIUS
    else:
        return []
    expected = math.sqrt(GRAVITY_M_S2 / size) / (2 * math.pi)
    share = frequency / expected
    if slow <= share <= FAST_FOR_ITS_RADIUS:
        return []
    stated = f"--fps says, {video.fps_hz:g} Hz" if video.time_source == "option" else f"the file's {video.fps_hz:g} Hz"
    better = _better_rates(share, video.fps_hz)
    is_slow, suspect = share < slow, share < too_slow and bool(better) and _may_be_played_slowly(video)
    return [
        Notice(
            code="frame_rate_suspect" if suspect else "slow_for_its_radius" if is_slow else "fast_for_its_radius",
            message=f"{frequency:.3g} Hz is {'slow' if is_slow else 'fast'} for {name} of {1e3 * size:.0f} mm (a point "
            f"mass sways at {expected:.3g} Hz there): {'a body with much inertia' if is_slow else 'a stiff joint'}, or "
            f"filmed at another rate than {stated}; {_advise_rate(better, video.fps_hz / share)}",
        )
    ]


def _may_be_played_slowly(video: VideoInfo) -> bool:
    return video.time_source == "container" and video.fps_hz < PLAYBACK_HZ


def _better_rates(share: float, fps_hz: float) -> list[float]:
    """Return the usual capture rates that make sense of a frequency, the nearest to a point mass first."""
    low, high = SENSIBLE_SHARES
    sensible = (rate for rate in USUAL_CAPTURE_RATES_HZ if low <= share * rate / fps_hz <= high)
    return sorted(sensible, key=lambda rate: abs(math.log(share * rate / fps_hz)))


def _advise_rate(better: list[float], wanted_hz: float) -> str:
    if not better:
        return f"none of the usual rates makes sense of it, which would have to be about {wanted_hz:.2g} Hz"
    first, *others = (f"{rate:g}" for rate in better)
    advice = f"if the camera ran at {first} Hz, say --fps {first}"
    if not others:
        return advice
    return f"{advice}; {' or '.join(others)} Hz would make sense, too, with a stiffer joint"


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
