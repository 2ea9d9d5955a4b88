"""The heart of a free vibration: extremes in even time, whose swings get smaller."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import find_peaks as find_local_maxima

from tagsway.modal.least_squares import Samples
from tagsway.modal.noise import grid_places
from tagsway.modal.rests import estimate_noise
from tagsway.modal.spectrum import find_peaks_of, find_spectrum
from tagsway.modal.sway import remove_spikes
from tagsway.model import FloatArray

PER_PERIOD = 16
"""Averages in a period: each flattens the swing by 0.6 %."""

LEAST_PER_PERIOD = 5
"""Samples, to tell extremes from noise."""

ABOVE_NOISE = 4.0
"""A swing's least size, over the noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Core:
    """A run of even swings, and their period."""

    start_s: float
    end_s: float
    period_s: float


def find_core(samples: Samples) -> Core | None:
    """Find the strongest run of at least three extremes, even in time and swinging less and less.

    Parameters
    ----------
    samples : Samples
        Along one axis.

    Returns
    -------
    Core or None
        Without the run's outermost extremes: a payload that is still held has one before it swings.
    """
    noise = estimate_noise(remove_spikes(samples.value))
    best, best_score = None, 0.0
    fastest = 1 / (LEAST_PER_PERIOD * float(np.median(np.diff(samples.time_s))))
    for hz in (hz for hz in top_frequencies(samples) if hz < fastest):
        thin = average_over(samples, 1 / hz)
        floor = ABOVE_NOISE * noise * float(np.sqrt(len(thin.time_s) / len(samples.time_s)))
        time, height = _find_extremes(thin, 1 / hz)
        for first, last in _even_runs(time, height, 1 / hz, floor=floor):
            score = float(np.sum(np.diff(height[first : last + 1]) ** 2))
            if score > best_score:
                inner = time[first + 1 : last] if last - first >= 4 else time[first : last + 1]
                best = Core(start_s=float(inner[0]), end_s=float(inner[-1]), period_s=1 / hz)
                best_score = score
    return best


def top_frequencies(samples: Samples) -> list[float]:
    """Return the frequencies of the highest peaks of the spectrum in Hz, with and without a drift; highest first."""
    time, value = samples.time_s, remove_spikes(samples.value)
    span = float(time[-1] - time[0])
    trend = np.polyval(np.polyfit(time, value, 1), time)
    tops: list[float] = []
    for shape in (value, value - trend):
        for hz in find_peaks_of(find_spectrum(time, shape), lowest_hz=0.8 / span, count=3):
            if all(abs(hz - other) > 0.2 / span for other in tops):
                tops.append(hz)
    return tops


def average_over(samples: Samples, period_s: float) -> Samples:
    """Return averages over a sixteenth of a period each, single spikes taken off; the same where there are few."""
    step = float(np.median(np.diff(samples.time_s)))
    count = int(period_s / step / PER_PERIOD)
    if count < 2:
        return samples
    _, block = np.unique(grid_places(samples.time_s) // count, return_inverse=True)
    weight = samples.spread**-2.0
    total = np.bincount(block, weight)
    spread = np.asarray(total**-0.5, dtype=float)
    return replace(
        samples,
        time_s=np.bincount(block, samples.time_s * weight) / total,
        value=np.bincount(block, remove_spikes(samples.value) * weight) / total,
        spread=spread / float(np.median(spread)),
    )


def _find_extremes(samples: Samples, period_s: float) -> tuple[FloatArray, FloatArray]:
    """Return times and values of maxima and minima in turn; of two of a kind beside each other, the farther one."""
    time, value = samples.time_s, samples.value
    apart = max(1, int(0.6 * period_s / float(np.median(np.diff(time)))))
    smooth = np.convolve(np.pad(value, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    kinds = [(find_local_maxima(sign * smooth, distance=apart)[0], sign) for sign in (1.0, -1.0)]
    kept: list[tuple[int, float]] = []
    for i, sign in sorted((int(i), sign) for found, sign in kinds for i in found):
        if kept and kept[-1][1] == sign and time[i] - time[kept[-1][0]] < 0.75 * period_s:
            if sign * smooth[i] > sign * smooth[kept[-1][0]]:
                kept[-1] = (i, sign)
            continue
        kept.append((i, sign))
    index = [i for i, _ in kept]
    return time[index], smooth[index]


def _even_runs(time_s: FloatArray, value: FloatArray, period_s: float, *, floor: float) -> list[tuple[int, int]]:
    half, swing = np.diff(time_s) / (period_s / 2), np.abs(np.diff(value))
    runs, first = [], 0
    for k in range(len(half) + 1):
        fits = k < len(half) and 0.75 < half[k] < 1.3 and swing[k] > floor
        follows = fits and (k == first or 0.25 < swing[k] / swing[k - 1] < 1.2)
        if follows:
            continue
        if k - first >= 2:
            runs.append((first, k))
        first = k if fits else k + 1
    return runs
