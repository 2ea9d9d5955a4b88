"""Every candidate with its price, and the shortest that keeps a tolerance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import DesignMode, FloatArray, Notice, Shaper, Spread
from tagsway.shapers.design import DEFAULT_TOLERANCE, SHAPER_TYPES, UNITY_TYPES, design_shaper
from tagsway.shapers.judging import as_mode
from tagsway.shapers.residual import TOUCH, residual_curve, residual_of_sample
from tagsway.shapers.response import centroid_delay

OFF_PERCENT = 15.0
"""The variation at which the thesis' Table 3.1 compares strategies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaperPrice:
    """What one candidate costs and what it buys.

    Parameters
    ----------
    shaper : Shaper
        The candidate.
    duration_s, duration_periods : float
        What it adds to a move (the tail of a filter counts), in s and in damped periods of the mode.
    centroid_delay_s : float
        By how much a slow command is late.
    residual_at_mode : float
        V where the mode is as designed.
    residual_off : float
        The larger V of the two natural frequencies 15 % away.
    residual_p95 : float or None
        V that 95 % of the repeats do not exceed; None without a spread.
    insensitivity : float or None
        I(5 %): width of the band with V ≤ 5 %, over the design frequency; None where it has no end.
    negative : bool
        Whether it pulls back: negative impulses excite faster modes.
    """

    shaper: Shaper
    duration_s: float
    duration_periods: float
    centroid_delay_s: float
    residual_at_mode: float
    residual_off: float
    residual_p95: float | None
    insensitivity: float | None
    negative: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The candidates from the shortest to the longest, and a notice for each that does not exist for this mode."""

    prices: tuple[ShaperPrice, ...]
    missing: tuple[Notice, ...]


def compare_shapers(
    mode: DesignMode,
    *,
    kinds: Sequence[str] = SHAPER_TYPES,
    tolerance: float = DEFAULT_TOLERANCE,
    spread: Spread | None = None,
    move_duration_s: float | None = None,
    source: str = "given",
) -> Comparison:
    """Return every candidate for one mode with its price.

    Parameters
    ----------
    mode : DesignMode
        To design for.
    kinds : sequence of str
        As for `design_shaper`.
    tolerance, spread, move_duration_s, source
        As for `design_shaper`.

    Returns
    -------
    Comparison
        Sorted by duration.

    Raises
    ------
    InputError
        Where not one candidate exists.
    """
    prices, missing = [], []
    as_mode(mode)
    for kind in kinds:
        try:
            shaper = design_shaper(
                kind, mode, tolerance=tolerance, spread=spread, move_duration_s=move_duration_s, source=source
            )
        except InputError as error:
            missing.append((kind, error))
        else:
            prices.append(price_shaper(shaper))
    if not prices:
        raise InputError(str(missing[0][1]) if missing else "a comparison needs at least one shaper type, it has none")
    return Comparison(
        prices=tuple(sorted(prices, key=_rank)),
        missing=tuple(Notice(code="no_such_shaper", message=f"{kind}: {error}") for kind, error in missing),
    )


def price_shaper(shaper: Shaper) -> ShaperPrice:
    """Return a shaper's price and its robustness on its first design mode."""
    if not shaper.modes or shaper.residual is None:
        raise InputError(f"a shaper {shaper.type!r} without a design mode has no price: design it for one")
    mode = as_mode(shaper.modes[0])
    sides = mode.natural_frequency_hz * np.array([1 - OFF_PERCENT / 100, 1 + OFF_PERCENT / 100])
    return ShaperPrice(
        shaper=shaper,
        duration_s=shaper.duration_s,
        duration_periods=shaper.duration_s / mode.damped_period_s,
        centroid_delay_s=centroid_delay(shaper),
        residual_at_mode=shaper.residual.at_mode,
        residual_off=float(np.max(residual_curve(shaper, sides, mode.damping_ratio).residual)),
        residual_p95=shaper.residual.p95,
        insensitivity=shaper.insensitivity_5_percent,
        negative=any(impulse.amplitude < 0 for impulse in shaper.impulses),
    )


def choose_shaper(
    mode: DesignMode,
    *,
    spread: Spread | None = None,
    sample: tuple[FloatArray, FloatArray] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    kinds: Sequence[str] | None = None,
    source: str = "given",
) -> Shaper:
    """Return the shortest shaper whose V stays under a tolerance in 95 % of the repeats.

    Parameters
    ----------
    mode : DesignMode
        To design for.
    spread : Spread, optional
        How the natural frequency varies between repeats, as a normal distribution.
    sample : tuple of two ndarrays, shape (n,), optional
        Instead: measured natural frequencies in Hz and damping ratios of repeats, as they are.
    tolerance : float
        Of V, in (0, 1).
    kinds : sequence of str, optional
        The candidates; by default all that do not pull back (negative impulses excite faster modes unasked).
    source : str
        Where the mode came from.

    Returns
    -------
    Shaper
        Of two equally long ones, that which leaves less.

    Raises
    ------
    InputError
        Without a spread or a sample, since one measurement does not know how the next will differ; and where no
        candidate keeps the tolerance, naming the best one.
    """
    if spread is None and sample is None:
        raise InputError(
            "choosing a shaper needs the spread of the frequency between repeats, and there is none: "
            "measure several times, or state it"
        )
    if not 0 < tolerance < 1:
        raise InputError(f"a shaper's tolerance must lie between 0 and 1, not {tolerance:g}")
    if spread is None and sample is not None:
        spread = _spread_of(*sample)
    candidates = [kind for kind in SHAPER_TYPES if kind not in UNITY_TYPES] if kinds is None else kinds
    found = compare_shapers(mode, kinds=candidates, tolerance=tolerance, spread=spread, source=source)
    left = [_left(price, sample) for price in found.prices]
    for price, residual in zip(found.prices, left, strict=True):
        if residual <= tolerance + TOUCH:
            return price.shaper
    best = int(np.argmin(left))
    raise InputError(
        f"no shaper keeps the residual vibration under {100 * tolerance:g} % in 95 % of the repeats: the best, "
        f"{found.prices[best].shaper.type}, leaves {100 * left[best]:.2g} %; raise the tolerance or lower the spread"
    )


def _left(price: ShaperPrice, sample: tuple[FloatArray, FloatArray] | None) -> float:
    if sample is not None:
        return residual_of_sample(price.shaper, *sample, percent=(95.0,)).percentile[0]
    return np.inf if price.residual_p95 is None else price.residual_p95


def _spread_of(frequency_hz: FloatArray, damping_ratio: FloatArray) -> Spread:
    """Return the normal spread that stands in for a sample where one is asked for."""
    frequency = np.asarray(frequency_hz, dtype=float)
    known = frequency[~(np.isnan(frequency) | np.isnan(np.asarray(damping_ratio, dtype=float)))]
    if len(known) < 2:
        raise InputError(f"a sample of {len(known)} measured modes has no spread: expected two or more")
    percent = 100 * float(np.std(known, ddof=1) / np.mean(known))
    return Spread(source="sample", natural_frequency_std_percent=percent, n=len(known))


def _rank(price: ShaperPrice) -> tuple[float, float]:
    # Rounded, so that equally long ones are told apart by what they leave.
    residual = price.residual_off if price.residual_p95 is None else price.residual_p95
    return round(price.duration_periods, 6), residual
