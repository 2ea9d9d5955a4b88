"""How a payload varies from pick to pick: what a design is for."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tagsway.cli.modes import Target
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, Notice

if TYPE_CHECKING:
    from tagsway.design import FurtherMode, PayloadSpread

ASSUMED_DAMPING = 0.3
"""Of ζ, one standard deviation, where its spread is not stated: an optimum for one damping alone is fragile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadWish:
    """What is known and stated of the spread.

    Parameters
    ----------
    target : Target
        The payload, with the spread of its first mode.
    folder : Path or None
        Of its measurement.
    damping_spread : float or None
        Of ζ: a standard deviation, or half the width.
    further_percent, gains : sequence of float
        Of the further modes: the spread of each, by default the first one's, and its gain, by default as measured.
    length_mm : float or None
        Equivalent length, where it is stated.
    shape : {"normal", "uniform"}
        Of the spread.
    stated : bool
        Whether the frequency's spread is an option of the command, in the measure of its shape; else it is a standard
        deviation.
    """

    target: Target
    folder: Path | None
    damping_spread: float | None
    further_percent: Sequence[float]
    gains: Sequence[float]
    length_mm: float | None
    shape: Literal["normal", "uniform"]
    stated: bool

    def reach(self, std: float) -> float:
        """Return a standard deviation in the measure of the shape: half the width of a uniform spread is √3 of them."""
        return math.sqrt(3) * std if self.shape == "uniform" else std


def read_spread(wish: SpreadWish) -> tuple["PayloadSpread", list[Notice]]:
    """Return the payloads that options and measurements speak of, and what was assumed.

    Raises
    ------
    NotIdentifiableError
        Without a spread: one measurement does not know how the next will differ.
    """
    from tagsway.design import PayloadSpread

    target = wish.target
    if target.spread is None:
        raise NotIdentifiableError(
            f"{target.source} does not tell how the payload varies between repeats, and without that nothing can be "
            "said of 95 % of them: give --frequency-spread PERCENT, or --from measurements.csv of two or more",
            code="single_measurement",
        )
    mode, notices = target.swings[0], list(target.notices)
    damping = _damping_spread(wish, notices)
    length, radius = target.length_m, target.tag_radius_m
    if wish.length_mm is not None:
        length = wish.length_mm / 1e3
    if length is None:
        length = GRAVITY_M_S2 / mode.angular_frequency_rad_s**2
        words = f"a pendulum without a spring is assumed, {1e3 * length:.1f} mm long: state --length if it is stiffer"
        notices.append(Notice(code="length_assumed", message=words))
    percent = target.spread.natural_frequency_std_percent
    percent = percent if wish.stated else wish.reach(percent)
    further, said = _further(wish, percent, length, radius)
    payload = PayloadSpread(
        mode=mode,
        frequency_percent=percent,
        damping_low=max(mode.damping_ratio - damping, 0.0),
        damping_high=min(mode.damping_ratio + damping, 0.95),
        length_m=length,
        tag_radius_m=length if radius is None else radius,
        shape=wish.shape,
        n=target.spread.n if wish.shape == "normal" else None,
        source=target.spread.source,
        further=further,
    )
    return payload, [*notices, *said]


def _damping_spread(wish: SpreadWish, notices: list[Notice]) -> float:
    import numpy as np

    repeats, ratio = wish.target.repeats, wish.target.swings[0].damping_ratio
    if wish.damping_spread is not None:
        if not wish.damping_spread >= 0:
            raise InputError(
                f"--damping-spread is {wish.damping_spread:g}: expected a ratio of 0 or more, such as 0.01"
            )
        return wish.damping_spread
    if repeats is not None and len(repeats.damping_ratio) > 1:
        return wish.reach(float(np.std(repeats.damping_ratio, ddof=1)))
    words = f"the damping's spread is not known: ±{100 * ASSUMED_DAMPING:g} % of it are assumed; state it"
    notices.append(Notice(code="damping_spread_assumed", message=f"{words} with --damping-spread"))
    return ASSUMED_DAMPING * ratio


def _further(
    wish: SpreadWish, percent: float, length_m: float, radius_m: float | None
) -> tuple[tuple["FurtherMode", ...], list[Notice]]:
    from tagsway.design import FurtherMode

    modes = wish.target.swings[1:]
    for name, values in (("--frequency-spread", wish.further_percent), ("--gain", wish.gains)):
        if len(values) not in (0, len(modes)):
            raise InputError(f"{name} is given for {len(values)} further modes, and there are {len(modes)}")
    gains: list[float] = list(wish.gains)
    notices: list[Notice] = []
    if modes and not gains:
        gains, notices = _find_gains(wish, length_m, radius_m)
    percents = list(wish.further_percent) or [percent] * len(modes)
    further = tuple(
        FurtherMode(mode=mode, frequency_percent=own, gain=gain)
        for mode, own, gain in zip(modes, percents, gains, strict=True)
    )
    return further, notices


def _find_gains(wish: SpreadWish, length_m: float, radius_m: float | None) -> tuple[list[float], list[Notice]]:
    if wish.target.result is None or wish.folder is None:
        words = "a further mode is taken to sway like a point on a string (gain 1): state --gain if it is known"
        return [1.0] * len(wish.target.swings[1:]), [Notice(code="further_gain_assumed", message=words)]
    from tagsway.pipeline.further import find_gains

    gains, notices = find_gains(
        wish.target.result, wish.folder, wish.target.swings, length_m=length_m, radius_m=radius_m
    )
    return list(gains), notices
