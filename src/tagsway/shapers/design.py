"""From a name and a mode to a shaper."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from tagsway.errors import InputError
from tagsway.model import DesignMode, Impulse, Mode, Residual, Shaper, Spread
from tagsway.shapers.humps import hump_shaper
from tagsway.shapers.impulses import Impulses, modified_zero_vibration, zero_vibration
from tagsway.shapers.residual import insensitivity, residual_percentile, residual_vibration

DEFAULT_TOLERANCE = 0.05

_DESIGNS: Mapping[str, Callable[[Mode, float], Impulses]] = MappingProxyType(
    {
        "zv": lambda mode, _: zero_vibration(mode),
        "zvd": lambda mode, _: zero_vibration(mode, derivatives=1),
        "zvdd": lambda mode, _: zero_vibration(mode, derivatives=2),
        "zvddd": lambda mode, _: zero_vibration(mode, derivatives=3),
        "mzv": lambda mode, _: modified_zero_vibration(mode),
        "ei": partial(hump_shaper, 1),
        "2hump_ei": partial(hump_shaper, 2),
        "3hump_ei": partial(hump_shaper, 3),
    }
)

SHAPER_TYPES: tuple[str, ...] = tuple(_DESIGNS)
"""The names that `design_shaper` knows."""


def design_shaper(
    kind: str,
    mode: DesignMode,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    spread: Spread | None = None,
    source: str = "given",
) -> Shaper:
    """Design an impulse shaper for one mode.

    Parameters
    ----------
    kind : str
        One of `SHAPER_TYPES`. ZV is the shortest and forgives least; each derivative (ZVD, ZVDD, ZVDDD) adds half a
        damped period and widens the band. EI is as long as ZVD and wider, but leaves `tolerance` at the mode itself;
        its humps widen the band further.
    mode : DesignMode
        Undamped natural frequency and damping ratio at the amplitude of the move.
    tolerance : float
        Residual vibration that the EI family allows, in (0, 1); the others do not use it.
    spread : Spread, optional
        How the natural frequency varies between repeats; without it `residual.p95` is None, since one measurement
        knows its own error only.
    source : str
        Where the mode came from.

    Returns
    -------
    Shaper
        With its residual at the mode, over the spread, and its insensitivity.

    Raises
    ------
    InputError
        For a name that is not known, or a mode, tolerance or spread that cannot be.

    Notes
    -----
    Not for a mode whose damping is strong (ζ above about 0.3): it stops by itself sooner than the shaper ends.
    """
    if kind not in _DESIGNS:
        raise InputError(f"shaper type {kind!r} is not known: expected one of {', '.join(SHAPER_TYPES)}")
    if not 0 < tolerance < 1:
        raise InputError(f"a shaper's tolerance must lie between 0 and 1, not {tolerance:g}")
    target = Mode(natural_frequency_hz=mode.frequency_hz, damping_ratio=mode.damping_ratio)
    impulses = _DESIGNS[kind](target, tolerance)
    pairs = zip(impulses.time_s.tolist(), impulses.amplitude.tolist(), strict=True)
    shaper = Shaper(
        type=kind,
        modes=(mode,),
        impulses=tuple(Impulse(time_s=time, amplitude=amplitude) for time, amplitude in pairs),
        source=source,
    )
    return _judge(shaper, target, spread)


def _judge(shaper: Shaper, mode: Mode, spread: Spread | None) -> Shaper:
    """Return the shaper with its residual and its insensitivity filled in."""
    width = insensitivity(shaper)
    p95 = None if spread is None else residual_percentile(shaper, spread.natural_frequency_std_percent)
    return replace(
        shaper,
        insensitivity_5_percent=width if math.isfinite(width) else None,
        residual=Residual(at_mode=residual_vibration(shaper, mode), p95=p95, spread=spread),
    )
