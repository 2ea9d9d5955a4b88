"""Shapers for several modes: one for each, convolved; or one for all at once, which is shorter."""

from collections.abc import Sequence

import numpy as np

from tagsway.errors import InputError
from tagsway.model import DesignMode, Mode, Shaper, Spread
from tagsway.shapers.design import DEFAULT_TOLERANCE, design_impulses
from tagsway.shapers.impulses import Impulses, convolve_impulses
from tagsway.shapers.insensitive import Band, simultaneous_zero_vibration
from tagsway.shapers.judging import Design, as_mode, judge_shaper, make_shaper
from tagsway.shapers.residual import TOUCH, residual_curve

WIDENING = ("zv", "zvd", "ei", "2hump_ei", "3hump_ei")
"""From the shortest and narrowest to the longest and widest."""

BAND_POINTS = 401


def design_multimode(
    kinds: Sequence[str] | None,
    modes: Sequence[DesignMode],
    *,
    band_percent: Sequence[float] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    spreads: Sequence[Spread | None] | None = None,
    source: str = "given",
) -> Shaper:
    """Return the convolution of one shaper for each mode.

    Parameters
    ----------
    kinds : sequence of str, or None
        One of `IMPULSE_TYPES` for each mode; None lets each mode's band choose (`kind_for_band`): a narrow one takes a
        ZV, a wide one a ZVD or EI [1]_.
    modes : sequence of DesignMode
        One or more.
    band_percent : sequence of float, optional
        For each mode, by how much its frequency may be off on either side; needed where `kinds` is None, and the band
        of an SI.
    tolerance : float
        Of V, in (0, 1), as for `design_shaper`.
    spreads : sequence of (Spread or None), optional
        Of each mode between repeats.
    source : str
        Where the modes came from.

    Returns
    -------
    Shaper
        Its type joins the kinds with "-"; its impulses are their product, its duration their sum, its V on any mode
        the product of theirs. Residual and insensitivity are those of the worst mode.

    Raises
    ------
    InputError
        Where kinds, bands or spreads are not as many as the modes.

    References
    ----------
    .. [1] Rule 5.4 of the dual-mode paper: the shaper of each mode follows the width of its own band.
    """
    if not modes:
        raise InputError("a shaper for several modes needs at least one mode, it has none")
    for name, values in {"kinds": kinds, "bands": band_percent, "spreads": spreads}.items():
        if values is not None and len(values) != len(modes):
            raise InputError(f"{len(modes)} modes need as many {name}, not {len(values)}")
    targets = [as_mode(mode) for mode in modes]
    if kinds is None:
        if band_percent is None:
            raise InputError("without kinds each mode needs its band: by how many percent its frequency may be off")
        kinds = [
            kind_for_band(target, percent, tolerance=tolerance)
            for target, percent in zip(targets, band_percent, strict=True)
        ]
    bands = [None] * len(modes) if band_percent is None else list(band_percent)
    parts = [
        design_impulses(kind, target, tolerance=tolerance, band=_band(target, percent))
        for kind, target, percent in zip(kinds, targets, bands, strict=True)
    ]
    return _judged("-".join(kinds), convolve_impulses(*parts), modes, spreads, source)


def design_simultaneous(
    modes: Sequence[DesignMode], *, spreads: Sequence[Spread | None] | None = None, source: str = "given"
) -> Shaper:
    """Return the shortest shaper of positive impulses that leaves nothing on any of these modes.

    Parameters
    ----------
    modes : sequence of DesignMode
        Two or more; with one it is a ZV.
    spreads, source : as for `design_multimode`

    Returns
    -------
    Shaper
        Of type "simultaneous"; never longer than ``design_multimode(["zv", …], modes)``, with 2 m + 1 impulses at most.

    Notes
    -----
    It is a ZV for each of the modes at once, and forgives as little; a mode between them gets nothing.
    """
    if not modes:
        raise InputError("a shaper for several modes needs at least one mode, it has none")
    impulses = simultaneous_zero_vibration([as_mode(mode) for mode in modes])
    return _judged("simultaneous", impulses, modes, spreads, source)


def kind_for_band(mode: Mode, band_percent: float, *, tolerance: float = DEFAULT_TOLERANCE) -> str:
    """Return the shortest of ZV, ZVD, EI and its humps that keeps V ≤ tolerance over a band of ± so many percent.

    Notes
    -----
    ZVD and EI are equally long: ZVD is taken where it suffices, as it leaves nothing at the mode itself.
    """
    band = Band.around(mode, percent=band_percent)
    frequency = np.linspace(band.lowest_hz, band.highest_hz, BAND_POINTS)
    design = DesignMode(frequency_hz=mode.natural_frequency_hz, damping_ratio=mode.damping_ratio)
    for kind in WIDENING:
        try:
            impulses = design_impulses(kind, mode, tolerance=tolerance)
        except InputError:
            continue
        shaper = make_shaper(kind, Design(impulses=impulses), (design,), source="band")
        if np.max(residual_curve(shaper, frequency, mode.damping_ratio).residual) <= tolerance + TOUCH:
            return kind
    raise InputError(
        f"no shaper from {WIDENING[0]} to {WIDENING[-1]} keeps a residual vibration of {100 * tolerance:g} % over "
        f"±{band_percent:g} %: narrow the band, or raise the tolerance"
    )


def _band(mode: Mode, percent: float | None) -> Band | None:
    return None if percent is None else Band.around(mode, percent=percent)


def _judged(
    kind: str,
    impulses: Impulses,
    modes: Sequence[DesignMode],
    spreads: Sequence[Spread | None] | None,
    source: str,
) -> Shaper:
    shaper = make_shaper(kind, Design(impulses=impulses), modes, source=source)
    return judge_shaper(shaper, [None] * len(modes) if spreads is None else spreads)
