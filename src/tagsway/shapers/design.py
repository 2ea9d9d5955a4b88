"""From a name and a mode to a shaper."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from tagsway.errors import InputError
from tagsway.model import DesignMode, Mode, Shaper, Spread
from tagsway.shapers.humps import hump_shaper
from tagsway.shapers.impulses import Impulses, given_impulses, modified_zero_vibration, zero_vibration
from tagsway.shapers.insensitive import Band, specified_insensitivity
from tagsway.shapers.judging import Design, as_mode, judge_shaper, make_shaper
from tagsway.shapers.prefilters import low_pass_filter, notch_filter
from tagsway.shapers.unity import unity_magnitude
from tagsway.shapers.zero_delay import hasten

DEFAULT_TOLERANCE = 0.05

DEFAULT_BAND_PERCENT = 20.0
"""Of SI where neither a band nor a spread is known: as wide as an EI of 5 %."""

SPREAD_FACTOR = 1.96
"""Standard deviations in which 95 % of the repeats lie."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wish:
    """What a design may depend on besides the mode."""

    tolerance: float
    band: Band


_IMPULSES: Mapping[str, Callable[[Mode, _Wish], Impulses]] = MappingProxyType(
    {
        "zv": lambda mode, _: zero_vibration(mode),
        "zvd": lambda mode, _: zero_vibration(mode, derivatives=1),
        "zvdd": lambda mode, _: zero_vibration(mode, derivatives=2),
        "zvddd": lambda mode, _: zero_vibration(mode, derivatives=3),
        "mzv": lambda mode, _: modified_zero_vibration(mode),
        "ei": lambda mode, wish: hump_shaper(1, mode, wish.tolerance),
        "2hump_ei": lambda mode, wish: hump_shaper(2, mode, wish.tolerance),
        "3hump_ei": lambda mode, wish: hump_shaper(3, mode, wish.tolerance),
        "si": lambda _, wish: specified_insensitivity(wish.band, wish.tolerance),
        "umzv": lambda mode, _: unity_magnitude(mode),
        "umzvd": lambda mode, _: unity_magnitude(mode, derivatives=1),
        "umei": lambda mode, wish: unity_magnitude(mode, tolerance=wish.tolerance),
    }
)

IMPULSE_TYPES: tuple[str, ...] = tuple(_IMPULSES)
"""Those that consist of impulses alone: they can be convolved for several modes, and be made a FIR hybrid."""

UNITY_TYPES = ("umzv", "umzvd", "umei")
"""Those with negative impulses."""


def _single() -> Impulses:
    return Impulses(time_s=np.zeros(1), amplitude=np.ones(1))


def _hybrid(kind: str, mode: Mode, wish: _Wish) -> Design:
    return Design(impulses=_IMPULSES[kind](mode, wish), box_s=mode.damped_period_s)


_DESIGNS: Mapping[str, Callable[[Mode, _Wish], Design]] = MappingProxyType(
    {
        **{
            kind: lambda mode, wish, make=make: Design(impulses=make(mode, wish))  # type: ignore[misc]
            for kind, make in _IMPULSES.items()
        },
        "fir": lambda mode, _: Design(impulses=_single(), box_s=mode.damped_period_s),
        "fir-zv": partial(_hybrid, "zv"),
        "fir-zvd": partial(_hybrid, "zvd"),
        "jerk": lambda mode, _: Design(impulses=_single(), box_s=1 / mode.natural_frequency_hz),
        "notch": lambda mode, _: Design(impulses=_single(), filter=notch_filter(mode)),
        "lowpass": lambda mode, wish: Design(
            impulses=_single(), filter=low_pass_filter(mode, tolerance=wish.tolerance)
        ),
    }
)

SHAPER_TYPES: tuple[str, ...] = tuple(_DESIGNS)
"""The names that need a mode alone; `design_shaper` also knows fir-KIND, ztd-KIND and mztd-KIND of impulse types."""


def design_shaper(
    kind: str,
    mode: DesignMode,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    spread: Spread | None = None,
    band: Band | None = None,
    move_duration_s: float | None = None,
    source: str = "given",
) -> Shaper:
    """Design a shaper for one mode.

    Parameters
    ----------
    kind : str
        One of `SHAPER_TYPES`. ZV is the shortest and forgives least; each derivative (ZVD, ZVDD, ZVDDD) adds half a
        damped period and widens the band. EI is as long as ZVD and wider, but leaves `tolerance` at the mode itself;
        its humps widen the band further. SI is as short as its band allows. The unity-magnitude ones (UM-ZV …) are
        shorter and pull back. FIR is a box of one damped period, FIR-KIND its convolution with impulses, "jerk" the box
        of one undamped period that a jerk-limited profile amounts to; "notch" and "lowpass" are filters that ring on.
        "ztd-KIND" and "mztd-KIND" (plain: of a ZVD) make the move with its shaper as long as the move alone.
    mode : DesignMode
        Undamped natural frequency and damping ratio at the amplitude of the move.
    tolerance : float
        Residual vibration that the EI family, SI and the low-pass allow, in (0, 1); the others do not use it.
    spread : Spread, optional
        How the natural frequency varies between repeats; without it `residual.p95` is None, since one measurement
        knows its own error only.
    band : Band, optional
        Of SI; by default ±1.96 standard deviations of the spread, without one ±20 %.
    move_duration_s : float, optional
        Of the move that will be shaped, needed by the zero-delay ones only, and by no other move.
    source : str
        Where the mode came from.

    Returns
    -------
    Shaper
        With its residual at the mode, over the spread, and its insensitivity.

    Raises
    ------
    InputError
        For a name that is not known, or a mode, tolerance, spread or move that cannot be.

    Notes
    -----
    Not for a mode whose damping is strong (ζ above about 0.3): it stops by itself sooner than the shaper ends.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"a shaper's tolerance must lie between 0 and 1, not {tolerance:g}")
    target = as_mode(mode)
    wish = _Wish(tolerance=tolerance, band=_band(target, spread, band))
    design = _design(kind, target, wish, move_duration_s)
    return judge_shaper(make_shaper(kind, design, (mode,), source=source), (spread,))


def given_shaper(
    time_s: Sequence[float], amplitude: Sequence[float], *, modes: Sequence[DesignMode] = (), source: str = "given"
) -> Shaper:
    """Return a shaper whose impulses somebody wrote down.

    Parameters
    ----------
    time_s : sequence of float
        Rising from 0, in s.
    amplitude : sequence of float
        In any unit; they are scaled to a sum of 1.
    modes : sequence of DesignMode
        Against which it is judged; without any its residual is not known.
    source : str
        Where it came from.
    """
    shaper = make_shaper("given", Design(impulses=given_impulses(time_s, amplitude)), modes, source=source)
    return judge_shaper(shaper, [None] * len(modes)) if modes else shaper


def design_impulses(kind: str, mode: Mode, *, tolerance: float, band: Band | None = None) -> Impulses:
    """Return the impulses alone of one of `IMPULSE_TYPES`, for what is built of them."""
    if kind not in _IMPULSES:
        raise InputError(f"shaper type {kind!r} has no impulses alone: expected one of {', '.join(IMPULSE_TYPES)}")
    return _IMPULSES[kind](mode, _Wish(tolerance=tolerance, band=_band(mode, None, band)))


def _design(kind: str, mode: Mode, wish: _Wish, move_duration_s: float | None) -> Design:
    if kind in _DESIGNS:
        return _DESIGNS[kind](mode, wish)
    family, _, base = kind.partition("-")
    if family == "fir" and base in _IMPULSES:
        return _hybrid(base, mode, wish)
    if family in ("ztd", "mztd") and (base in _IMPULSES or kind == family):
        if move_duration_s is None:
            raise InputError(f"shaper type {kind!r} needs the duration of the move that it will shape, in s")
        impulses = _IMPULSES[base or "zvd"](mode, wish)
        return hasten(impulses, mode, move_duration_s, modified=family == "mztd")
    raise InputError(f"shaper type {kind!r} is not known: expected one of {', '.join(SHAPER_TYPES)}")


def _band(mode: Mode, spread: Spread | None, band: Band | None) -> Band:
    if band is not None:
        return band
    percent = DEFAULT_BAND_PERCENT if spread is None else SPREAD_FACTOR * spread.natural_frequency_std_percent
    # A spread that cannot be is refused, in its own words, where the shaper is judged.
    return Band.around(mode, percent=percent if 0 <= percent < 100 else DEFAULT_BAND_PERCENT)
