"""From impulses, a box and a filter to a shaper that knows what it leaves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tagsway.model import DesignMode, DigitalFilter, Impulse, Mode, Residual, Shaper, Spread
from tagsway.shapers.impulses import Impulses
from tagsway.shapers.prefilters import filter_tail
from tagsway.shapers.residual import insensitivity, residual_percentile, residual_vibration


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """What a shaper consists of; the parts are convolved."""

    impulses: Impulses
    box_s: float | None = None
    filter: DigitalFilter | None = None
    time_scale: float = 1.0


def make_shaper(kind: str, design: Design, modes: Sequence[DesignMode], *, source: str) -> Shaper:
    """Return the shaper, with its filter's tail, not yet judged."""
    pairs = zip(design.impulses.time_s.tolist(), design.impulses.amplitude.tolist(), strict=True)
    return Shaper(
        type=kind,
        modes=tuple(modes),
        impulses=tuple(Impulse(time_s=time, amplitude=amplitude) for time, amplitude in pairs),
        box_s=design.box_s,
        filter=design.filter,
        time_scale=design.time_scale,
        tail_s=0.0 if design.filter is None else filter_tail(design.filter, design.impulses),
        source=source,
    )


def judge_shaper(shaper: Shaper, spreads: Sequence[Spread | None]) -> Shaper:
    """Return the shaper with its residual and its insensitivity filled in, of the worst of its modes.

    Parameters
    ----------
    shaper : Shaper
        With one design mode or more.
    spreads : sequence of (Spread or None)
        Of each mode, between repeats.
    """
    modes = [as_mode(mode) for mode in shaper.modes]
    width = min(insensitivity(shaper, mode=mode) for mode in modes)
    p95, worst = None, None
    for mode, spread in zip(modes, spreads, strict=True):
        if spread is None:
            continue
        value = residual_percentile(shaper, spread.natural_frequency_std_percent, mode=mode)
        if p95 is None or value > p95:
            p95, worst = value, spread
    at_mode = max(residual_vibration(shaper, mode) for mode in modes)
    return replace(
        shaper,
        insensitivity_5_percent=width if math.isfinite(width) else None,
        residual=Residual(at_mode=at_mode, p95=p95, spread=worst),
    )


def as_mode(mode: DesignMode) -> Mode:
    """Return the design mode as the mode that vibrates."""
    return Mode(natural_frequency_hz=mode.frequency_hz, damping_ratio=mode.damping_ratio)
