"""What a shaper leaves: residual vibration V, and how much of an error in the frequency it forgives."""

import math
from collections.abc import Callable

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


def insensitivity(shaper: Shaper, tolerance: float = 0.05) -> float:
    """Return how wide the band of frequencies is in which little vibration remains.

    Parameters
    ----------
    shaper : Shaper
        With at least one design mode; the first is the one whose frequency varies, at its damping ratio.
    tolerance : float
        Of V, in (0, 1).

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
    mode = _design_mode(shaper)

    def excess(ratio: float) -> float:
        residual = _residual(shaper, np.array([ratio * mode.natural_frequency_hz]), mode.damping_ratio)
        return float(residual[0]) - tolerance - TOUCH

    if excess(1.0) > 0:
        return 0.0
    step = 1 / (64 * max(shaper.duration_s * mode.natural_frequency_hz, 1.0))
    below = _first_crossing(excess, np.arange(1.0, 0.0, -step))
    above = _first_crossing(excess, np.arange(1.0, 20.0, step))
    return math.inf if above is None else above - (below or 0.0)


def residual_percentile(shaper: Shaper, natural_frequency_std_percent: float, *, percent: float = 95.0) -> float:
    """Return a percentile of V over repeats whose natural frequency varies.

    Parameters
    ----------
    shaper : Shaper
        With at least one design mode; the first is the mean of the distribution, its damping ratio is kept.
    natural_frequency_std_percent : float
        Standard deviation of the natural frequency between repeats, in percent; 0 to 30.
    percent : float
        Which percentile.

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
    mode = _design_mode(shaper)
    probability = (np.arange(4001) + 0.5) / 4001
    frequency = mode.natural_frequency_hz * (1 + natural_frequency_std_percent / 100 * norm.ppf(probability))
    # The last of 4001 quantiles lies at 3.7 standard deviations: below zero from 27 % on.
    residual = _residual(shaper, np.maximum(frequency, 1e-3 * mode.natural_frequency_hz), mode.damping_ratio)
    return float(np.percentile(residual, percent))


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


def _design_mode(shaper: Shaper) -> Mode:
    if not shaper.modes:
        raise InputError("a shaper without a design mode has no frequency that could vary around it")
    design = shaper.modes[0]
    return Mode(natural_frequency_hz=design.frequency_hz, damping_ratio=design.damping_ratio)


def _first_crossing(excess: Callable[[float], float], ratios: FloatArray) -> float | None:
    """Return where `excess` first becomes positive along the ratios, None where it never does."""
    inside = float(ratios[0])
    for outside in ratios[1:]:
        if excess(float(outside)) > 0:
            return float(brentq(excess, inside, float(outside), xtol=1e-12))
        inside = float(outside)
    return None
