"""Peaks of a decay, and what they say: periods and the logarithmic decrement."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks as find_local_maxima
from scipy.stats import linregress
from scipy.stats import t as student_t

from tagsway.model import Estimate, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Peaks:
    """Extremes of a decay in turn, maxima and minima alternating.

    Parameters
    ----------
    time_s, value : ndarray, shape (k,)
        Vertices of parabolas through the samples around each extreme.
    number : ndarray of int, shape (k,)
        Half periods since the first; a number is left out where a gap swallowed an extreme.
    """

    time_s: FloatArray
    value: FloatArray
    number: FloatArray


def find_peaks(time_s: FloatArray, value: FloatArray, period_s: float) -> Peaks:
    """Return maxima and minima, by a parabola over a quarter of a period around each.

    Parameters
    ----------
    time_s, value : ndarray, shape (n,)
        The samples that exist.
    period_s : float
        Known to some 20 %.

    Returns
    -------
    Peaks
        An extreme beside a gap is left out.
    """
    if len(time_s) < 5:
        return Peaks(time_s=np.empty(0), value=np.empty(0), number=np.empty(0))
    step = float(np.median(np.diff(time_s)))
    width = max(1, int(period_s / 12 / step)) | 1
    smooth = np.convolve(np.pad(value, width // 2, mode="edge"), np.ones(width) / width, mode="valid")
    apart = max(1, int(0.6 * period_s / step))
    found = [
        (*vertex, sign)
        for sign in (1.0, -1.0)
        for i in find_local_maxima(sign * smooth, distance=apart)[0]
        if (vertex := _vertex(time_s, value, float(time_s[i]), period_s / 8, sign)) is not None
    ]
    found.sort()
    kept: list[tuple[float, float, float]] = []
    for peak in found:
        if kept and kept[-1][2] == peak[2] and peak[0] - kept[-1][0] < 0.75 * period_s:
            if peak[2] * peak[1] > peak[2] * kept[-1][1]:
                kept[-1] = peak
            continue
        kept.append(peak)
    if not kept:
        return Peaks(time_s=np.empty(0), value=np.empty(0), number=np.empty(0))
    when, height, _ = np.array(kept).T
    number = np.cumsum(np.concatenate([[0.0], np.maximum(np.rint(np.diff(when) / (period_s / 2)), 1)]))
    return Peaks(time_s=when, value=height, number=number)


def _vertex(
    time_s: FloatArray, value: FloatArray, near_s: float, half_s: float, sign: float
) -> tuple[float, float] | None:
    for _ in range(2):
        inside = slice(*np.searchsorted(time_s, (near_s - half_s, near_s + half_s)))
        x = (time_s[inside] - near_s) / half_s
        if len(x) < 3 or not (x[0] < -0.4 and x[-1] > 0.4) or float(np.max(np.diff(x))) > 0.8:
            return None
        c, b, a = _fit_parabola(x, value[inside])
        if not sign * a < 0 or not abs(b) < 2 * abs(a):
            return None
        shift = -b / (2 * a)
        near_s += float(np.clip(shift, -1, 1)) * half_s
    return (near_s, float(c - b**2 / (4 * a))) if abs(shift) < 1 else None


def _fit_parabola(x: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """Return c, b and a of c + b x + a x²: from -1 to 1 the normal equations are well conditioned."""
    rows = np.stack([np.ones(len(x)), x, x * x])
    c, b, a = np.linalg.solve(rows @ rows.T, rows @ y).tolist()
    return c, b, a


def measure_period(peaks: Peaks) -> Estimate | None:
    """Return the damped period from a line through the peaks' times.

    Parameters
    ----------
    peaks : Peaks
        At least 3.

    Returns
    -------
    Estimate or None
        In s, its error from the scatter about the line.
    """
    if len(peaks.time_s) < 3:
        return None
    line = linregress(peaks.number, peaks.time_s)
    return _slope_estimate(2 * line.slope, 2 * line.stderr, len(peaks.time_s))


def measure_decay_rate(peaks: Peaks, *, noise: float) -> Estimate | None:
    """Return α from the logarithmic decrement of successive peak-to-peak swings.

    Parameters
    ----------
    peaks : Peaks
        At least 4 in turn.
    noise : float
        Swings below 6 of it are left out: their logarithm is biased.

    Returns
    -------
    Estimate or None
        In 1/s.

    Notes
    -----
    The difference of successive extremes is free of the equilibrium; a line through its logarithms is the decrement
    over all cycles: δ = α T_d and ζ = δ / √((2π)² + δ²).
    """
    next_to = np.diff(peaks.number) == 1
    swing = np.abs(np.diff(peaks.value))
    large = next_to & (swing > 6 * noise) & (swing > 0)
    if np.count_nonzero(large) < 3:
        return None
    middle = 0.5 * (peaks.time_s[1:] + peaks.time_s[:-1])
    line = linregress(middle[large], np.log(swing[large]))
    return _slope_estimate(-line.slope, line.stderr, int(np.count_nonzero(large)))


def measure_decrement(peaks: Peaks, *, noise: float) -> tuple[int, Estimate | None]:
    """Return the logarithmic decrement from two swings n cycles apart, and n.

    Parameters
    ----------
    peaks : Peaks
        At least 4.
    noise : float
        Of a sample: a swing below 6 of it is left out; a peak's own error is taken as one of it.

    Returns
    -------
    int
        n, the most cycles between two swings that were seen; 0 where there are none.
    Estimate or None
        δ per cycle.
    """
    next_to = np.diff(peaks.number) == 1
    swing, number = np.abs(np.diff(peaks.value)), peaks.number[:-1]
    large = next_to & (swing > 6 * noise) & (swing > 0)
    swing, number = swing[large], number[large]
    whole = (number - number[0]) % 2 == 0 if len(number) else np.zeros(0, dtype=bool)
    swing, number = swing[whole], number[whole]
    if len(number) < 2:
        return 0, None
    cycles = round(float(number[-1] - number[0]) / 2)
    error = float(np.hypot(noise / swing[0], noise / swing[-1])) * np.sqrt(2) / cycles
    return cycles, Estimate.normal(float(np.log(swing[0] / swing[-1])) / cycles, error)


def _slope_estimate(value: float, std: float, n: int) -> Estimate:
    half = float(student_t.ppf(0.975, n - 2)) * float(std)
    return Estimate(value=float(value), std=float(std), ci95=(float(value) - half, float(value) + half))
