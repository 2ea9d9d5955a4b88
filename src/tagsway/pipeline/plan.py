"""Before filming: what a decay of a given length can tell at best, and what a wanted error takes."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq

from tagsway.errors import InputError
from tagsway.modal.bound import find_bound
from tagsway.model import CameraHints, Need, Notice, Plan, PlannedError, PlannedMeasurement

DURATIONS_S = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0)
"""Rows of the table; shorter than a period and a half tells nothing."""

LEAST_CYCLES = 1.5
SAMPLES_PER_CYCLE = 64.0
"""More samples of a period are replaced by so many with less noise: the bound of the many is the same."""

LONGEST_DECAYS = 3.0
"""Time constants after which more of a decay adds less than 1 % to what is known of it."""

LONGEST_S = 600.0
"""Nobody films longer."""

TAG_NOISE_PX: Mapping[str, float] = MappingProxyType(
    {"raw": 0.0032, "mjpeg": 0.004, "h264_crf10": 0.011, "h264_crf18": 0.028}
)
"""Standard error of the centre of a 60 px tag, one axis: alignment of the known pattern, grey noise 3 of 255."""

REFERENCE_SIDE_PX = 60.0
LEAST_SIDE_PX = 24.0
"""Three pixels to a cell of a 36h11 tag (8 cells): below, detection becomes unsure."""

USUAL_NOISE_M = 5e-5
"""Where neither a noise nor a scale is stated: a 60 px tag of 30 mm in H.264 as cameras write it, twice over."""


def plan_measurement(
    measurement: PlannedMeasurement,
    *,
    duration_s: float | None = None,
    frequency_error_percent: float | None = None,
    damping_error_percent: float | None = None,
    scale_mm_per_px: float | None = None,
    tag_size_m: float | None = None,
) -> Plan:
    """Return what a decay can tell over its length, and what wanted errors take.

    Parameters
    ----------
    measurement : PlannedMeasurement
        The decay and the camera.
    duration_s : float, optional
        Of a record: added to the table, and the length of the repeats.
    frequency_error_percent, damping_error_percent : float, optional
        Wanted standard errors.
    scale_mm_per_px : float, optional
        In the tags' plane: gives the hints for exposure and tag.
    tag_size_m : float, optional
        Side of the printed tag.

    Returns
    -------
    Plan

    Raises
    ------
    InputError
        For numbers that cannot be.

    Notes
    -----
    The Cramér-Rao bound of a single decaying cosine with an offset, in white noise, at the worst phase of four: no
    unbiased estimator does better, and least squares reaches it. Noise that is not white, a second mode, and a tool
    that still moves cost more. It is the error of *this* record: repeats with a new pick differ by far more, and no
    length of record tells by how much.
    """
    for name, value in {
        "--duration": duration_s,
        "--wanted-frequency-error": frequency_error_percent,
        "--wanted-damping-error": damping_error_percent,
        "--scale": scale_mm_per_px,
        "--tag-size": tag_size_m,
    }.items():
        if value is not None and not 0 < value < math.inf:
            raise InputError(f"{name} is {value:g}: expected a positive number")
    shortest = LEAST_CYCLES / measurement.frequency_hz
    if duration_s is not None and not shortest <= duration_s <= LONGEST_S:
        raise InputError(
            f"--duration is {duration_s:g} s: expected {shortest:.2g} s (a period and a half) to {LONGEST_S:g} s"
        )
    wanted = {*DURATIONS_S, *([] if duration_s is None else [duration_s])}
    table = tuple(find_errors(measurement, length) for length in sorted(wanted) if length >= shortest)
    needs = [
        find_need(measurement, quantity, error, duration_s)
        for quantity, error in (
            ("natural frequency", frequency_error_percent),
            ("damping ratio", damping_error_percent if measurement.damping_ratio > 0 else None),
        )
        if error is not None
    ]
    hints = None if scale_mm_per_px is None else _hints(measurement, scale_mm_per_px, tag_size_m)
    return Plan(
        measurement=measurement,
        table=table,
        needs=tuple(needs),
        camera=hints,
        notices=_notices(measurement, hints, damping_error_percent),
    )


def find_errors(measurement: PlannedMeasurement, duration_s: float) -> PlannedError:
    """Return the bound of a record of one length, in percent; ζ's is None without damping."""
    m = measurement
    rate = min(m.fps_hz, SAMPLES_PER_CYCLE * m.frequency_hz)
    count = max(int(duration_s * rate) + 1, 8)
    time = np.arange(count) / rate
    bounds = [
        find_bound(
            time,
            natural_frequency_hz=m.frequency_hz,
            damping_ratio=m.damping_ratio,
            amplitude=m.amplitude_m,
            noise=m.noise_m * math.sqrt(rate / m.fps_hz),
            phase_rad=phase,
        )
        for phase in np.arange(4) * np.pi / 4
    ]
    damping = max(bound.damping_ratio for bound in bounds)
    return PlannedError(
        duration_s=duration_s,
        cycles=duration_s * m.frequency_hz,
        frequency_error_percent=100 * max(bound.natural_frequency_hz for bound in bounds) / m.frequency_hz,
        damping_error_percent=100 * damping / m.damping_ratio if m.damping_ratio > 0 else None,
    )


def find_need(
    measurement: PlannedMeasurement, quantity: str, wanted_percent: float, duration_s: float | None = None
) -> Need:
    """Return the length of one record, or the number of repeats, that a wanted error takes.

    Parameters
    ----------
    measurement : PlannedMeasurement
        The decay.
    quantity : {"natural frequency", "damping ratio"}
        Whose error.
    wanted_percent : float
        1σ, of the value.
    duration_s : float, optional
        Length of each repeat; by default the longest that tells more.

    Returns
    -------
    Need
        The mean of n records has an error of 1/√n of one's: as long as nothing but noise makes them differ.
    """
    m = measurement

    def error(length: float) -> float:
        errors = find_errors(m, length)
        value = errors.frequency_error_percent if quantity == "natural frequency" else errors.damping_error_percent
        assert value is not None
        return value

    decay = 1 / (2 * math.pi * m.frequency_hz * m.damping_ratio) if m.damping_ratio > 0 else math.inf
    shortest = LEAST_CYCLES / m.frequency_hz
    longest = max(min(LONGEST_DECAYS * decay, LONGEST_S), shortest)
    single: float | None = None
    if error(shortest) <= wanted_percent:
        single = shortest
    elif error(longest) <= wanted_percent:
        logarithm = brentq(
            lambda x: math.log(error(math.exp(x)) / wanted_percent), math.log(shortest), math.log(longest), xtol=1e-3
        )
        single = math.exp(logarithm)
    repeat = duration_s if duration_s is not None else min(longest, single or longest)
    return Need(
        quantity=quantity,
        wanted_error_percent=wanted_percent,
        duration_s=single,
        repeats=max(1, math.ceil((error(repeat) / wanted_percent) ** 2 * (1 - 1e-2))),
        repeat_duration_s=repeat,
    )


def expected_noise_m(scale_mm_per_px: float, tag_size_m: float | None = None, *, video: str = "h264_crf18") -> float:
    """Return the noise of product against tool that a picture of tags gives, one axis, in m.

    Parameters
    ----------
    scale_mm_per_px : float
        In the tags' plane.
    tag_size_m : float, optional
        Side of the tag; by default what is 60 px.
    video : {"raw", "mjpeg", "h264_crf10", "h264_crf18"}
        What the camera writes.

    Notes
    -----
    √2 of one tag's; that goes as the inverse of the tag's side: a larger tag has as many more pixels on its edges, each
    of which is as sure.
    """
    side = REFERENCE_SIDE_PX if tag_size_m is None else 1e3 * tag_size_m / scale_mm_per_px
    return math.sqrt(2) * TAG_NOISE_PX[video] * REFERENCE_SIDE_PX / side * scale_mm_per_px / 1e3


def _hints(measurement: PlannedMeasurement, scale_mm_per_px: float, tag_size_m: float | None) -> CameraHints:
    speed = 2 * math.pi * measurement.frequency_hz * measurement.amplitude_m
    return CameraHints(
        scale_mm_per_px=scale_mm_per_px,
        peak_speed_m_s=speed,
        longest_exposure_s=min(scale_mm_per_px / 1e3 / speed, 1 / measurement.fps_hz),
        tag_side_px=None if tag_size_m is None else 1e3 * tag_size_m / scale_mm_per_px,
        expected_noise_mm={
            kind: 1e3 * expected_noise_m(scale_mm_per_px, tag_size_m, video=kind) for kind in TAG_NOISE_PX
        },
    )


def _notices(m: PlannedMeasurement, hints: CameraHints | None, wanted_damping: float | None) -> tuple[Notice, ...]:
    notices = []
    if wanted_damping is not None and m.damping_ratio == 0:
        notices.append(Notice(code="no_damping", message="a damping ratio of 0 has no error in percent: say --damping"))
    if hints is not None and hints.tag_side_px is not None and hints.tag_side_px < LEAST_SIDE_PX:
        message = (
            f"the tag is {hints.tag_side_px:.0f} px wide: expected {LEAST_SIDE_PX:.0f} px at least, and 60 px for the "
            "noise above; print it larger or move the camera nearer"
        )
        notices.append(Notice(code="tag_too_small", message=message))
    return tuple(notices)
