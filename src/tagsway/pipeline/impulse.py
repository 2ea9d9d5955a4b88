"""From records of hammer blows to the robot's first frequency, and its distance from the payload's."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import t as student_t

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.impulse import average_spectra, find_blows, find_first_peak, lowest_frequency, measure_blow
from tagsway.model import (
    Blow,
    BlowResult,
    Estimate,
    FloatArray,
    ImpulseResult,
    ImpulseSpectra,
    Mode,
    Notice,
    PayloadDistance,
    RepeatSummary,
    Shaper,
)
from tagsway.repeats import summarise_repeats
from tagsway.shapers import residual_vibration
from tagsway.store.impulses import read_impulses

AMPLIFICATION = 0.05
"""Enlargement of a command at the payload's frequency by the arm's own spring, up to which the arm counts as rigid.

A base on a spring follows a harmonic command of frequency f enlarged by 1 / (1 - (f / f_robot)²): S. S. Rao,
Mechanical Vibrations, ch. 3. 5 % is what most shapers are designed to leave.
"""

SCATTER_PERCENT = 25.0
"""± deviation above which the blows hardly show one and the same mode; 13 % were measured on a delta robot."""


def identify_impulses(
    files: Sequence[Path],
    *,
    payload_hz: float | None = None,
    shaper: Shaper | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
) -> tuple[ImpulseResult, ImpulseSpectra]:
    """Identify the robot's first frequency from what its joints answer to a hammer.

    Parameters
    ----------
    files : sequence of Path
        Records of one robot in one pose: axes, directions and repeats.
    payload_hz : float, optional
        The payload's natural frequency.
    shaper : Shaper, optional
        That was designed for it.
    lowest_hz, highest_hz : float, optional
        Where the first peak is looked for; by default from three periods in the shortest answer to a third of the
        sampling rate.

    Returns
    -------
    result : ImpulseResult
    spectra : ImpulseSpectra
        What a figure draws.

    Raises
    ------
    InputError
        Where a file or a frequency cannot be used.
    NotIdentifiableError
        Where no blow, or no peak, stands out.
    """
    for name, value in {"--frequency": payload_hz, "--lowest": lowest_hz, "--highest": highest_hz}.items():
        if value is not None and not (value > 0 and np.isfinite(value)):
            raise InputError(f"{name} is {value:g}: expected a frequency in Hz, more than 0")
    blows = _all_blows(files)
    spectra = average_spectra(blows)
    low = lowest_frequency(blows) if lowest_hz is None else lowest_hz
    high = 1 / (3 * blows[0].step_s) if highest_hz is None else highest_hz
    if not low < high:
        raise InputError(f"no frequency lies between --lowest {low:.4g} and --highest {high:.4g} Hz")
    near = find_first_peak(spectra, lowest_hz=low, highest_hz=high)
    pairs = zip(blows, spectra.each, strict=True)
    measured = [measure_blow(blow, each, spectra.frequency_hz, near_hz=near) for blow, each in pairs]
    found = tuple(blow for blow in measured if blow is not None)
    if not found:
        raise NotIdentifiableError(f"no blow shows the averaged spectrum's peak at {near:.4g} Hz", code="no_peak")
    peaks = np.array([blow.peak_hz for blow in found])
    mean, summary = _mean_of(peaks, found[0].duration_s), summarise_repeats(peaks)
    damping = _summary([blow.damping_ratio for blow in found])
    result = ImpulseResult(
        files=tuple(file.name for file in files),
        first_frequency_hz=mean,
        peaks=summary,
        natural_frequency_hz=_summary([blow.natural_frequency_hz for blow in found]),
        damping_ratio=damping,
        resolution_hz=1 / min(blow.duration_s for blow in found),
        bin_hz=float(spectra.frequency_hz[1]),
        blows=found,
        payload=None if payload_hz is None else _distance(mean.value, damping, payload_hz, shaper),
        warnings=_notices(summary, found, lost=len(blows) - len(found)),
    )
    return result, spectra


def _mean_of(peaks_hz: FloatArray, duration_s: float) -> Estimate:
    """Return the mean with Student's interval: three answers know their scatter badly. Of one, half a resolution."""
    mean, n = float(peaks_hz.mean()), len(peaks_hz)
    if n == 1:
        return Estimate.normal(mean, 0.5 / duration_s)
    std = float(peaks_hz.std(ddof=1)) / math.sqrt(n)
    half = float(student_t.ppf(0.975, n - 1)) * std
    return Estimate(value=mean, std=std, ci95=(mean - half, mean + half))


def _all_blows(files: Sequence[Path]) -> list[Blow]:
    blows: list[Blow] = []
    for file in files:
        time_s, channels = read_impulses(file)
        for name, values in channels.items():
            blows += find_blows(time_s, values, channel=f"{file.stem}: {name}" if len(files) > 1 else name)
    return blows


def _summary(estimates: Sequence[Estimate | None]) -> RepeatSummary | None:
    values: FloatArray = np.array([estimate.value for estimate in estimates if estimate is not None])
    return summarise_repeats(values) if len(values) > 1 else None


def _distance(
    robot_hz: float, damping: RepeatSummary | None, payload_hz: float, shaper: Shaper | None
) -> PayloadDistance:
    ratio = robot_hz / payload_hz
    amplification = 1 / (ratio**2 - 1) if ratio > 1 else float("inf")
    leaves = None
    if shaper is not None:
        mode = Mode(natural_frequency_hz=robot_hz, damping_ratio=0.0 if damping is None else max(damping.median, 0.0))
        leaves = 100 * float(residual_vibration(shaper, mode))
    return PayloadDistance(
        payload_frequency_hz=payload_hz,
        ratio=ratio,
        amplification_percent=min(100 * amplification, 1e6),
        far_enough=amplification <= AMPLIFICATION,
        shaper_leaves_percent=leaves,
    )


def _notices(summary: RepeatSummary, found: tuple[BlowResult, ...], *, lost: int) -> tuple[Notice, ...]:
    notices = []
    if lost:
        message = f"{lost} of {lost + len(found)} answers do not show the first mode, and are left out"
        notices.append(Notice(code="blows_left_out", message=message))
    if len(found) < 3:
        message = f"{len(found)} answers do not tell the scatter: strike three times in each direction"
        notices.append(Notice(code="few_blows", message=message))
    if summary.deviation_percent is not None and summary.deviation_percent > SCATTER_PERCENT:
        message = f"the peaks scatter by ± {summary.deviation_percent:.1f} %: they may belong to different modes"
        notices.append(Notice(code="peaks_scatter", message=message))
    return tuple(notices)
