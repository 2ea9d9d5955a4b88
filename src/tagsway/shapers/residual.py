"""What a shaper leaves: residual vibration V, and how much of an error in the frequency it forgives.

Three quantities are called residual vibration in the literature, and have three names here: *residual vibration* V, a
bound from the shaper and the mode alone (`residual_vibration`); the *overshoot ratio*, the overshoot of a shaped move
over that of the unshaped one (`overshoot_ratio`); and the *residual acceleration*, its maximum and RMS after a measured
move (an indicator of the move).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from tagsway.errors import InputError
from tagsway.model import FloatArray, Mode, ResidualCurve, Shaper

TOUCH = 1e-9
"""A hump that is designed to touch the tolerance passes it by rounding; this much is forgiven."""

WIDEST_SPREAD_PERCENT = 30.0
"""Beyond it, a normal distribution's tail holds frequencies that are not positive."""


def residual_vibration(shaper: Shaper, mode: Mode) -> float:
    """Return the swing that a shaped move leaves, as a fraction of the unshaped one.

    Parameters
    ----------
    shaper : Shaper
        Impulses with amplitudes that sum to 1, and perhaps a box and a filter.
    mode : Mode
        The mode that vibrates, not the one the shaper was designed for.

    Returns
    -------
    float
        V: 0 when the impulses cancel exactly, 1 when they change nothing.

    Notes
    -----
    The response to the impulses at the time of the last one, over that to a single impulse at that time [1]_,

        V = e^(-ζω t_n) √(C² + S²),  C = Σ A_i e^(ζω t_i) cos(ω_d t_i),  S likewise with sin.

    A box of length τ that follows them multiplies by |(e^(sτ) - 1)/(sτ)| e^(-ζωτ) with s = ω(ζ + j√(1 - ζ²)), a filter
    by its gain at the mode's pole, |F(-s)|. It bounds the residual of any move; a given move may leave less. It says
    nothing of the swing *during* the move, and nothing of a swing so large that the mode is not linear.

    References
    ----------
    .. [1] N. C. Singer and W. P. Seering, J. Dyn. Sys. Meas. Control 112 (1990) 76-82.
    """
    return float(_residual(shaper, np.array([mode.natural_frequency_hz]), mode.damping_ratio)[0])


def residual_curve(shaper: Shaper, frequency_hz: FloatArray, damping_ratio: FloatArray | float) -> ResidualCurve:
    """Return the residual vibration V over the natural frequency.

    Parameters
    ----------
    shaper : Shaper
        As for `residual_vibration`.
    frequency_hz : ndarray, shape (n,)
        Undamped natural frequencies of the mode that vibrates.
    damping_ratio : ndarray, shape (n,), or float
        Its damping ratio.

    Returns
    -------
    ResidualCurve
        V at each frequency.
    """
    frequency = np.asarray(frequency_hz, dtype=float)
    damping = np.asarray(damping_ratio, dtype=float)
    if not np.all((frequency > 0) & np.isfinite(frequency)):
        raise InputError("a residual curve needs positive frequencies in Hz, some are not")
    if not np.all((damping >= 0) & (damping < 1)):
        raise InputError("a residual curve needs damping ratios in [0, 1), some are not")
    return ResidualCurve(frequency_hz=frequency, residual=_residual(shaper, frequency, damping))


def insensitivity(shaper: Shaper, tolerance: float = 0.05, *, mode: Mode | None = None) -> float:
    """Return how wide the band of frequencies is in which little vibration remains.

    Parameters
    ----------
    shaper : Shaper
        With at least one design mode; the first is the one whose frequency varies, at its damping ratio.
    tolerance : float
        Of V, in (0, 1).
    mode : Mode, optional
        Another of its modes.

    Returns
    -------
    float
        Width of the unbroken band around the design frequency in which V ≤ tolerance, as a fraction of the design
        frequency; 0 where V is larger already at the design frequency, inf where the band has no upper end within
        twenty times the design frequency (strong damping alone then keeps V small).

    Notes
    -----
    The band is walked outwards in steps of a 64th of the period of V, then its ends are solved for.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"a tolerance of the residual vibration must lie between 0 and 1, not {tolerance:g}")
    mode = design_mode(shaper) if mode is None else mode

    def excess(ratio: FloatArray) -> FloatArray:
        return _residual(shaper, ratio * mode.natural_frequency_hz, mode.damping_ratio) - tolerance - TOUCH

    if excess(np.ones(1))[0] > 0:
        return 0.0
    step = 1 / (64 * max(shaper.duration_s * mode.natural_frequency_hz, 1.0))
    below = _first_crossing(excess, -step, 0.0)
    above = _first_crossing(excess, step, 20.0)
    return math.inf if above is None else above - (below or 0.0)


def residual_percentile(
    shaper: Shaper, natural_frequency_std_percent: float, *, percent: float = 95.0, mode: Mode | None = None
) -> float:
    """Return a percentile of V over repeats whose natural frequency varies.

    Parameters
    ----------
    shaper : Shaper
        With at least one design mode; the first is the mean of the distribution, its damping ratio is kept.
    natural_frequency_std_percent : float
        Standard deviation of the natural frequency between repeats, in percent; 0 to 30.
    percent : float
        Which percentile.
    mode : Mode, optional
        Another of its modes.

    Returns
    -------
    float
        V that this share of the repeats does not exceed.

    Notes
    -----
    The frequencies are 4001 quantiles of a normal distribution, evenly spaced in probability: no random numbers.
    One fit's own standard error is no such spread: repeats differ a hundred times as much.
    """
    if not 0 <= natural_frequency_std_percent <= WIDEST_SPREAD_PERCENT:
        raise InputError(
            f"a frequency spread of {natural_frequency_std_percent:g} % cannot be used: "
            f"expected a standard deviation from 0 to {WIDEST_SPREAD_PERCENT:g} %"
        )
    mode = design_mode(shaper) if mode is None else mode
    probability = (np.arange(4001) + 0.5) / 4001
    frequency = mode.natural_frequency_hz * (1 + natural_frequency_std_percent / 100 * norm.ppf(probability))
    # The last of 4001 quantiles lies at 3.7 standard deviations: below zero from 27 % on.
    residual = _residual(shaper, np.maximum(frequency, 1e-3 * mode.natural_frequency_hz), mode.damping_ratio)
    return float(np.percentile(residual, percent))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleResidual:
    """V over a measured sample of modes.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        V of each repeat.
    percent : tuple of float
        Which percentiles.
    percentile : tuple of float
        V that these shares of the repeats do not exceed.
    """

    residual: FloatArray
    percent: tuple[float, ...]
    percentile: tuple[float, ...]


def residual_of_sample(
    shaper: Shaper,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray | float,
    *,
    percent: Sequence[float] = (50.0, 95.0, 100.0),
) -> SampleResidual:
    """Return V of each repeat of a measurement, and percentiles.

    Parameters
    ----------
    shaper : Shaper
        To be judged.
    frequency_hz : ndarray, shape (n,)
        Measured natural frequency of each repeat; NaN where it was not determined, which is left out.
    damping_ratio : ndarray, shape (n,), or float
        Its measured damping ratio; NaN likewise.
    percent : sequence of float
        In [0, 100].

    Notes
    -----
    Nothing is assumed about the distribution. Of n repeats the 95th percentile is known well from about 60 on; below
    20 it is little else than the worst one.
    """
    if not all(0 <= p <= 100 for p in percent):
        raise InputError(f"percentiles must lie between 0 and 100, not {list(percent)}")
    frequency, damping = np.broadcast_arrays(
        np.atleast_1d(np.asarray(frequency_hz, dtype=float)), np.asarray(damping_ratio, dtype=float)
    )
    known = ~(np.isnan(frequency) | np.isnan(damping))
    if not np.any(known):
        raise InputError("a sample of modes needs at least one with a frequency and a damping ratio, it has none")
    residual = residual_curve(shaper, frequency[known], damping[known]).residual
    return SampleResidual(
        residual=residual, percent=tuple(percent), percentile=tuple(np.percentile(residual, percent).tolist())
    )


def overshoot_ratio(shaped_percent: float, unshaped_percent: float) -> float:
    """Return the overshoot of a shaped move over that of the same move unshaped.

    Parameters
    ----------
    shaped_percent, unshaped_percent : float
        Overshoot of the payload, of the same reference.

    Returns
    -------
    float
        What the thesis calls residual vibration. It depends on the move, and says little where the unshaped move
        happens to end near rest.
    """
    if not (unshaped_percent > 0 and shaped_percent >= 0):
        raise InputError(
            f"an overshoot ratio needs an unshaped overshoot above 0, not {shaped_percent:g} over {unshaped_percent:g}"
        )
    return shaped_percent / unshaped_percent


def _residual(shaper: Shaper, frequency_hz: FloatArray, damping_ratio: FloatArray | float) -> FloatArray:
    """Return V at each of the frequencies, shape (n,)."""
    zeta = np.broadcast_to(np.asarray(damping_ratio, dtype=float), frequency_hz.shape)
    pole = 2 * np.pi * frequency_hz * (zeta + 1j * np.sqrt(1 - zeta**2))
    time = np.array([impulse.time_s for impulse in shaper.impulses])
    amplitude = np.array([impulse.amplitude for impulse in shaper.impulses])
    # Counted back from the last impulse, no exponential can overflow; a common phase does not change a modulus.
    response = np.exp(np.multiply.outer(pole, time - time[-1])) @ amplitude
    if shaper.box_s is not None:
        response = response * -np.expm1(-pole * shaper.box_s) / (pole * shaper.box_s)
    if shaper.filter is not None:
        response = response * np.polyval(shaper.filter.numerator, -pole) / np.polyval(shaper.filter.denominator, -pole)
    residual: FloatArray = np.abs(response)
    return residual


def design_mode(shaper: Shaper) -> Mode:
    """Return the mode that the shaper was designed for, the first of several."""
    if not shaper.modes:
        raise InputError("a shaper without a design mode has no frequency that could vary around it")
    design = shaper.modes[0]
    return Mode(natural_frequency_hz=design.frequency_hz, damping_ratio=design.damping_ratio)


def _first_crossing(excess: Callable[[FloatArray], FloatArray], step: float, end: float) -> float | None:
    """Return where `excess` first becomes positive on the way from 1 to the end, None where it never does."""
    inside, count = 1.0, 256
    while (end - inside) / step > 0:
        ratios: FloatArray = inside + step * np.arange(1.0, count + 1)
        ratios = ratios[(end - ratios) / step > 0]
        outside = np.flatnonzero(excess(ratios) > 0)
        if len(outside):
            first = int(outside[0])
            nearer = float(ratios[first - 1]) if first else inside
            return float(brentq(lambda r: float(excess(np.array([r]))[0]), nearer, float(ratios[first]), xtol=1e-12))
        if len(ratios) < count:
            return None
        inside, count = float(ratios[-1]), min(2 * count, 65536)
    return None
