"""From the options of `identify shaper` to a shaper."""

from collections.abc import Sequence
from dataclasses import dataclass

from tagsway.cli.modes import Target
from tagsway.errors import InputError
from tagsway.model import Mode, Shaper

NORMAL_95 = 1.96
"""Standard deviations in which 95 % of the repeats lie."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What a shaper should keep besides its mode.

    Parameters
    ----------
    tolerance : float
        Residual vibration V, between 0 and 1.
    bands : sequence of float
        By how many percent the frequency of each mode may be off; empty where nothing is said.
    move_duration_s : float or None
        Of the move that it is for.
    """

    tolerance: float
    bands: Sequence[float]
    move_duration_s: float | None

    def __post_init__(self) -> None:
        if not 0 < self.tolerance < 1:
            raise InputError(
                f"--tolerance is {self.tolerance:g}: expected a share of the swing between 0 and 1, such as 0.05"
            )
        for band in self.bands:
            if not 0 < band < 100:
                raise InputError(
                    f"--band is {band:g}: expected more than 0 and less than 100 percent, or it contains 0 Hz"
                )
        if self.move_duration_s is not None and not self.move_duration_s > 0:
            raise InputError(
                f"--move-duration is {self.move_duration_s:g}: expected the unshaped move's time in s, > 0"
            )


def design(kind: str, target: Target, wish: Wish) -> Shaper:
    """Return the shaper that `--type` names, for one mode or several."""
    from tagsway.shapers import Band, choose_shaper, design_shaper

    if wish.bands and len(wish.bands) != len(target.modes):
        raise InputError(
            f"--band is given {len(wish.bands)} times for {len(target.modes)} modes: expected one for each"
        )
    if len(target.modes) > 1:
        return _design_for_several(kind, target, wish)
    spread, source = target.spread, target.source
    if kind == "auto":
        if spread is None:
            raise InputError(
                "--type auto needs to know how the frequency varies between repeats: give --frequency-spread PERCENT, "
                "or --from measurements.csv of two or more; one measurement does not tell"
            )
        return choose_shaper(target.mode, spread=spread, tolerance=wish.tolerance, source=source)
    mode = Mode(natural_frequency_hz=target.mode.frequency_hz, damping_ratio=target.mode.damping_ratio)
    band = Band.around(mode, percent=wish.bands[0]) if wish.bands else None
    return design_shaper(
        kind,
        target.mode,
        tolerance=wish.tolerance,
        spread=spread,
        band=band,
        move_duration_s=wish.move_duration_s,
        source=source,
    )


def design_by_hand(text: str, target: Target) -> Shaper:
    """Return the shaper of impulses that somebody wrote down as TIME:AMPLITUDE,TIME:AMPLITUDE …"""
    from tagsway.shapers import given_shaper

    try:
        pairs = [tuple(float(part) for part in pair.split(":")) for pair in text.split(",")]
        times, amplitudes = zip(*((time, amplitude) for time, amplitude in pairs), strict=True)
    except ValueError:
        raise InputError(
            f"--impulses is {text!r}: expected TIME:AMPLITUDE,TIME:AMPLITUDE in s, such as 0:0.5,0.2:0.5"
        ) from None
    return given_shaper(times, amplitudes, modes=target.modes, source=target.source)


def _design_for_several(kind: str, target: Target, wish: Wish) -> Shaper:
    from tagsway.shapers import design_multimode, design_simultaneous

    count = len(target.modes)
    spreads = [target.spread] * count
    if kind == "simultaneous":
        return design_simultaneous(target.modes, spreads=spreads, source=target.source)
    bands = list(wish.bands) or None
    if kind == "auto":
        if bands is None and target.spread is not None:
            bands = [NORMAL_95 * target.spread.natural_frequency_std_percent] * count
        if bands is None:
            raise InputError(
                "--type auto needs to know how the frequencies vary: give --frequency-spread PERCENT, or --band "
                "PERCENT once for each mode"
            )
        kinds = None
    else:
        kinds = kind.split("-")
        kinds = kinds * count if len(kinds) == 1 else kinds
    return design_multimode(
        kinds, target.modes, band_percent=bands, tolerance=wish.tolerance, spreads=spreads, source=target.source
    )
