"""The zero-padded Fourier transform, of what samples there are."""

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len
from scipy.optimize import minimize_scalar

from tagsway.modal.noise import grid_places
from tagsway.model import FloatArray, SpectrumCurve

PADDING = 8
"""How many times the record's length is transformed, at least: up to a length that is transformed fast."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrumPeak:
    """The highest peak: a *damped* frequency, in Hz, and its error from white noise of unit variance."""

    frequency_hz: float
    unit_std_hz: float


def find_spectrum(time_s: FloatArray, value: FloatArray) -> SpectrumCurve:
    """Return the amplitude spectrum under a Hann window, zero-padded.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, n at least 4; each sample is put on the nearest point of the even grid.
    value : ndarray, shape (n,)
        The mean is removed.

    Returns
    -------
    SpectrumCurve
        A steady oscillation of amplitude A has a peak of height A. The resolution is 2 over the record's length,
        however far it is padded.
    """
    place = grid_places(time_s)
    window = _hann(time_s)
    level = float(window @ value / np.sum(window))
    grid = np.zeros(int(place[-1]) + 1)
    grid[place] = window * (value - level)
    n = next_fast_len(PADDING * len(grid), real=True)
    step = (time_s[-1] - time_s[0]) / max(int(place[-1]), 1)
    amplitude = 2 * np.abs(np.fft.rfft(grid, n)) / np.sum(window)
    return SpectrumCurve(frequency_hz=np.fft.rfftfreq(n, step), amplitude=amplitude)


def find_peaks_of(curve: SpectrumCurve, *, lowest_hz: float, count: int) -> list[float]:
    """Return the frequencies of the highest peaks, parabolas laid through them.

    Parameters
    ----------
    curve : SpectrumCurve
        On an even grid.
    lowest_hz : float
        What lies below is drift.
    count : int
        At most so many.

    Returns
    -------
    list of float
        In Hz, highest peak first.
    """
    a, f = curve.amplitude, curve.frequency_hz
    top = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:]) & (f[1:-1] >= lowest_hz)) + 1
    top = top[np.argsort(-a[top])][:count]
    left, middle, right = (np.log(np.maximum(a[top + k], 1e-300)) for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    return [float(x) for x in f[top] + shift * (f[1] - f[0])]


def find_spectrum_peak(time_s: FloatArray, value: FloatArray, *, near_hz: float) -> SpectrumPeak:
    """Return the peak of the Hann-windowed transform at the samples' true times.

    Parameters
    ----------
    time_s, value : ndarray, shape (n,)
        The decay.
    near_hz : float
        The padded transform's peak, or any frequency within half the resolution of it.

    Returns
    -------
    SpectrumPeak
    """
    window = _hann(time_s)
    middle = time_s - time_s.mean()
    weighted = window * (value - window @ value / np.sum(window))

    def power(hz: float) -> float:
        return -float(np.abs(np.exp(-2j * np.pi * hz * middle) @ weighted) ** 2)

    half = 1 / (time_s[-1] - time_s[0])
    low = max(near_hz - half, 0.1 * near_hz)
    best = float(minimize_scalar(power, bounds=(low, near_hz + half), method="bounded", options={"xatol": 1e-9}).x)
    # The peak is where P' = 0: noise e moves it by -δP'/P'', linear in e.
    kernel = np.exp(-2j * np.pi * best * middle)
    x, x1, x2 = (kernel * (-2j * np.pi * middle) ** k @ weighted for k in range(3))
    second = 2 * (abs(x1) ** 2 + (x.conjugate() * x2).real)
    pull = 2 * (np.conj(kernel) * x1 + x.conjugate() * (-2j * np.pi * middle) * kernel).real * window
    return SpectrumPeak(frequency_hz=best, unit_std_hz=float(np.linalg.norm(pull) / max(abs(second), 1e-300)))


def measure_half_power(time_s: FloatArray, value: FloatArray, *, near_hz: float) -> tuple[float, float, float] | None:
    """Return peak, ζ = Δf / (2 f) and the bin of the padded transform without a window.

    Parameters
    ----------
    time_s, value : ndarray, shape (n,)
        The decay.
    near_hz : float
        The peak within a factor of 1.5 of this is taken.

    Returns
    -------
    tuple of float or None
        In Hz, 1 and Hz; None where the peak does not fall to 1/√2 on both sides.

    Notes
    -----
    The record's length alone makes a width of 0.89 over it: shown for comparison, never used.
    """
    place = grid_places(time_s)
    grid = np.zeros(int(place[-1]) + 1)
    grid[place] = value - np.mean(value)
    step = (time_s[-1] - time_s[0]) / max(int(place[-1]), 1)
    n = next_fast_len(PADDING * len(grid), real=True)
    f, a = np.fft.rfftfreq(n, step), np.abs(np.fft.rfft(grid, n))
    inside = (f > near_hz / 1.5) & (f < near_hz * 1.5)
    if np.count_nonzero(inside) < 3:
        return None
    top = int(np.argmax(np.where(inside, a, 0.0)))
    low = np.flatnonzero(a[:top] < a[top] / np.sqrt(2))
    high = np.flatnonzero(a[top:] < a[top] / np.sqrt(2))
    if low.size == 0 or high.size == 0:
        return None
    width = float(f[top + high[0]] - f[low[-1]])
    return float(f[top]), width / (2 * float(f[top])), float(f[1])


def _hann(time_s: FloatArray) -> FloatArray:
    span = time_s[-1] - time_s[0]
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * (time_s - time_s[0]) / span), dtype=float)
