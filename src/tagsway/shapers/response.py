"""What a shaper does to a step, to a sine, and to a mode that is not the one it was made for: curves as arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from tagsway.errors import InputError
from tagsway.model import FloatArray, Mode, Shaper
from tagsway.shapers.prefilters import state_space
from tagsway.shapers.residual import residual_curve, residual_vibration
from tagsway.shapers.shortest import ComplexArray

SAMPLES_PER_PERIOD = 200
"""Of the mode, where extremes and crossings of the step response are looked for before they are solved for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResponse:
    """A mode's answer to a unit step that went through a shaper; both arrays of shape (n,)."""

    time_s: FloatArray
    position: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class StepIndicators:
    """A step response in a few numbers.

    Parameters
    ----------
    overshoot_percent : float
        Of the step; 0 where the response never passes 1.
    settling_s : float
        When it enters the band for good; inf where it never does.
    delay_s, rise_s : float
        Until it first reaches 50 %, and from 10 to 90 %.
    """

    overshoot_percent: float
    settling_s: float
    delay_s: float
    rise_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FrequencyResponse:
    """Gain and phase of a shaper over the frequency of a sine, shape (n,)."""

    frequency_hz: FloatArray
    gain: FloatArray
    phase_rad: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SensitivityCurves:
    """V where the mode's frequency, or its damping ratio, is not the designed one, all shape (n,).

    Parameters
    ----------
    ratio : ndarray
        Actual over designed.
    over_frequency : ndarray
        V with the natural frequency at that ratio, the damping ratio as designed.
    over_damping : ndarray
        V with the damping ratio at that ratio, the natural frequency as designed; NaN where it would reach 1.
    """

    ratio: FloatArray
    over_frequency: FloatArray
    over_damping: FloatArray


def step_response(shaper: Shaper, mode: Mode, time_s: FloatArray) -> StepResponse:
    """Return the answer of y'' + 2ζω y' + ω² y = ω² u to a unit step u that went through the shaper.

    Parameters
    ----------
    shaper : Shaper
        Impulses, box and filter; its time scale does not change a step.
    mode : Mode
        The mode that answers.
    time_s : ndarray, shape (n,)
        From the step.

    Returns
    -------
    StepResponse
        Exact at each time, whatever their distance.
    """
    time = np.asarray(time_s, dtype=float)
    position = np.zeros_like(time)
    for impulse in shaper.impulses:
        position += impulse.amplitude * _boxed(shaper, mode, time - impulse.time_s)
    return StepResponse(time_s=time, position=position)


def step_indicators(shaper: Shaper, mode: Mode, *, band: float = 0.05) -> StepIndicators:
    """Return overshoot, settling time, delay and rise of a step through a shaper.

    Parameters
    ----------
    shaper : Shaper
        As for `step_response`.
    mode : Mode
        The mode that answers.
    band : float
        Around 1, in which it has settled; in (0, 1).
    """
    if not 0 < band < 1:
        raise InputError(f"a settling band must lie between 0 and 1, not {band:g}")

    def answer(time_s: float) -> float:
        return float(step_response(shaper, mode, np.array([time_s])).position[0])

    time = _horizon(shaper, mode, band)
    position = step_response(shaper, mode, time).position
    top = int(np.argmax(position))
    sides = (float(time[max(top - 1, 0)]), float(time[min(top + 1, len(time) - 1)]))
    peak = minimize_scalar(lambda t: -answer(t), bounds=sides, method="bounded", options={"xatol": 1e-9})
    overshoot = 100 * max(float(position[top]), -float(peak.fun), 1.0) - 100
    if mode.damping_ratio == 0 and _left(shaper, mode) > band:
        settling = math.inf
    else:
        outside = np.flatnonzero(np.abs(position - 1) > band)
        last = int(outside[-1])
        edges = float(time[last]), float(time[min(last + 1, len(time) - 1)])
        settling = float(brentq(lambda t: abs(answer(t) - 1) - band, *edges, xtol=1e-12))
    half, low, high = (_first_reach(answer, time, position, level) for level in (0.5, 0.1, 0.9))
    return StepIndicators(
        overshoot_percent=overshoot if overshoot > 1e-9 else 0.0, settling_s=settling, delay_s=half, rise_s=high - low
    )


def frequency_response(shaper: Shaper, frequency_hz: FloatArray) -> FrequencyResponse:
    """Return the shaper's gain |H(j2πf)| and phase.

    Parameters
    ----------
    shaper : Shaper
        Impulses, box and filter.
    frequency_hz : ndarray, shape (n,)
        Of the sine that goes through; 0 or more.

    Notes
    -----
    This is no residual vibration: with damping V vanishes at the mode where H does not; at ω_d the gain of a ZV is
    (1 - K) / (1 + K).
    """
    frequency = np.asarray(frequency_hz, dtype=float)
    if not np.all((frequency >= 0) & np.isfinite(frequency)):
        raise InputError("a frequency response needs frequencies in Hz that are 0 or more, some are not")
    s = 2j * np.pi * frequency
    time, amplitude = _impulses(shaper)
    response = np.exp(-np.multiply.outer(s, time)) @ amplitude
    if shaper.box_s is not None:
        response = response * np.sinc(frequency * shaper.box_s) * np.exp(-s * shaper.box_s / 2)
    if shaper.filter is not None:
        response = response * np.polyval(shaper.filter.numerator, s) / np.polyval(shaper.filter.denominator, s)
    return FrequencyResponse(
        frequency_hz=frequency, gain=np.abs(response), phase_rad=np.unwrap(np.angle(response)) if s.size else s.real
    )


def sensitivity_curves(shaper: Shaper, mode: Mode, ratio: FloatArray) -> SensitivityCurves:
    """Return V over the natural frequency and over the damping ratio.

    Parameters
    ----------
    shaper : Shaper
        To be judged.
    mode : Mode
        What it was designed for.
    ratio : ndarray, shape (n,)
        Actual over designed, positive.
    """
    ratios = np.asarray(ratio, dtype=float)
    frequency = mode.natural_frequency_hz * ratios
    damping = mode.damping_ratio * ratios
    real = damping < 1
    over_damping = np.full(ratios.shape, np.nan)
    same = np.full(int(real.sum()), mode.natural_frequency_hz)
    over_damping[real] = residual_curve(shaper, same, damping[real]).residual
    return SensitivityCurves(
        ratio=ratios,
        over_frequency=residual_curve(shaper, frequency, mode.damping_ratio).residual,
        over_damping=over_damping,
    )


def centroid_delay(shaper: Shaper) -> float:
    """Return by how much a slow command is late, in s: Σ A_i t_i, half the box, and the filter's delay at rest.

    Notes
    -----
    -dφ/dω at ω = 0. A command of constant velocity lags by this times the velocity; the duration says when it ends.
    """
    time, amplitude = _impulses(shaper)
    delay = float(time @ amplitude) + (shaper.box_s or 0.0) / 2
    if shaper.filter is not None:
        above, below = ((0.0, *part)[-2:] for part in (shaper.filter.numerator, shaper.filter.denominator))
        delay += below[0] / below[1] - above[0] / above[1]
    return delay


def _impulses(shaper: Shaper) -> tuple[FloatArray, FloatArray]:
    time = np.array([impulse.time_s for impulse in shaper.impulses])
    return time, np.array([impulse.amplitude for impulse in shaper.impulses])


def _boxed(shaper: Shaper, mode: Mode, time_s: FloatArray) -> FloatArray:
    """Return the answer to a step through the box and the filter alone; 0 before it."""
    if shaper.box_s is None:
        return _plain(shaper, mode, time_s)[0]
    difference = _plain(shaper, mode, time_s)[1] - _plain(shaper, mode, time_s - shaper.box_s)[1]
    return difference / shaper.box_s


def _plain(shaper: Shaper, mode: Mode, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the answer to a step through the filter, and its integral, both 0 before it."""
    time = np.maximum(time_s, 0.0)
    if shaper.filter is not None:
        return _filtered(shaper, mode, time)
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    root = math.sqrt(1 - zeta**2)
    pole, weight = w * complex(-zeta, root), complex(1, -zeta / root)
    # 1 - Re(g e^pt) with Re g = 1: as -Re(g (e^pt - 1)) it needs no difference of nearly equal numbers.
    swing: ComplexArray = weight * np.expm1(pole * time)
    return -swing.real, np.asarray(time - (swing / pole).real)


def _filtered(shaper: Shaper, mode: Mode, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the same through the filter: filter and mode as one linear system, and a constant that drives it."""
    if shaper.filter is None:
        raise ValueError("without a filter there is nothing to go through")
    (a, b, c, through), unit = state_space(shaper.filter)
    w, zeta, n = mode.angular_frequency_rad_s / unit, mode.damping_ratio, len(b)
    system = np.zeros((n + 4, n + 4))  # the filter, y, y', ∫ y, u
    system[:n, :n], system[:n, -1] = a, b
    system[n, n + 1] = 1.0
    system[n + 1, :n], system[n + 1, n], system[n + 1, n + 1] = w**2 * c, -(w**2), -2 * zeta * w
    system[n + 1, -1] = w**2 * through
    system[n + 2, n] = 1.0
    forward = expm(system * (time * unit)[:, None, None])
    return np.asarray(forward[:, n, -1]), np.asarray(forward[:, n + 2, -1] / unit)


def _left(shaper: Shaper, mode: Mode) -> float:
    """Return the largest swing of the step response after the shaper, over 1; V itself without damping."""
    return residual_vibration(shaper, mode) / math.sqrt(1 - mode.damping_ratio**2)


def _horizon(shaper: Shaper, mode: Mode, band: float) -> FloatArray:
    """Return times that reach beyond the settling time."""
    end = shaper.duration_s + mode.damped_period_s
    if mode.damping_ratio > 0:
        rate = mode.damping_ratio * mode.angular_frequency_rad_s
        end += max(math.log(max(_left(shaper, mode), 1e-300) / min(band, 0.05)), 0.0) / rate
    count = min(math.ceil(end / mode.damped_period_s * SAMPLES_PER_PERIOD), 400_000)
    even = np.linspace(0.0, end, count + 1)
    # A step bends where an impulse arrives; a crossing between two samples there would be missed.
    arrivals = [impulse.time_s for impulse in shaper.impulses]
    return np.union1d(even, arrivals)


def _first_reach(answer: Callable[[float], float], time: FloatArray, position: FloatArray, level: float) -> float:
    above = np.flatnonzero(position >= level)
    first = int(above[0])
    return float(brentq(lambda t: answer(t) - level, float(time[first - 1]), float(time[first]), xtol=1e-12))
