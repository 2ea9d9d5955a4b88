"""An input shaper: what a command is convolved with so that a mode stays at rest."""

import itertools
import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class Impulse:
    """One impulse of a shaper."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    time_s: float
    amplitude: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DigitalFilter:
    """A linear filter in continuous time, coefficients of falling powers of s; a constant passes it unchanged."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self) -> None:
        above, below = self.numerator, self.denominator
        if not (above and below and all(math.isfinite(c) for c in (*above, *below))):
            raise InputError(f"a filter needs finite coefficients, not {list(above)} over {list(below)}")
        if len(above) > len(below) or below[0] == 0 or below[-1] == 0:
            raise InputError(f"a filter needs a numerator of no higher power than its denominator {list(below)}")
        if not abs(above[-1] / below[-1] - 1) <= 1e-9:
            raise InputError(f"a filter must pass a constant unchanged: its gain there is {above[-1] / below[-1]:.12g}")
        if len(below) > 1 and not np.all(np.roots(below).real < 0):
            raise InputError(f"a filter must be stable: not every root of {list(below)} has a negative real part")


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignMode:
    """What a shaper was designed for: undamped frequency and damping, at the operating amplitude."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    frequency_hz: float
    damping_ratio: float
    amplitude_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How the natural frequency varies between repeats, and where that is known from."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    source: str
    natural_frequency_std_percent: float
    n: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Residual:
    """Residual vibration V: at the design mode, and the 95th percentile over the spread between repeats."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    at_mode: float
    p95: float | None = None
    spread: Spread | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaper:
    """Impulses, and what may be convolved with them.

    Parameters
    ----------
    type : str
        Its name: "zv", "zvd" …
    modes : tuple of DesignMode
        What it was designed for.
    impulses : tuple of Impulse
        Times from 0 upwards, amplitudes that sum to 1.
    box_s : float or None
        Length of a box (moving average) that is convolved with the impulses.
    filter : DigitalFilter or None
        A filter in series.
    time_scale : float
        By which the move itself is stretched before it is shaped; 1 leaves it, less hastens it.
    tail_s : float
        How long after the last impulse and the box the filter rings on, until its response to a step stays within
        1e-6 of its end; 0 where the impulses stop it.
    insensitivity_5_percent : float or None
        Width, as a fraction of the design frequency, of the band in which V ≤ 5 %.
    residual : Residual or None
        Residual vibration V.
    source : str
        Where the mode came from.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    type: str
    modes: tuple[DesignMode, ...]
    impulses: tuple[Impulse, ...]
    box_s: float | None = None
    filter: DigitalFilter | None = None
    time_scale: float = 1.0
    tail_s: float = 0.0
    insensitivity_5_percent: float | None = None
    residual: Residual | None = None
    source: str = field(default="given")

    def __post_init__(self) -> None:
        times = [impulse.time_s for impulse in self.impulses]
        total = math.fsum(impulse.amplitude for impulse in self.impulses)
        if not times or times[0] != 0 or any(not b > a for a, b in itertools.pairwise(times)):
            raise InputError(f"a shaper's impulses must start at 0 s and follow one another, not {times}")
        if not abs(total - 1) <= 1e-9:
            raise InputError(f"a shaper's amplitudes must sum to 1, not {total:.12g}")
        if not all(math.isfinite(time) for time in times):
            raise InputError(f"a shaper's impulses must come at finite times, not {times}")
        for name, value in {"box_s": self.box_s, "time_scale": self.time_scale}.items():
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise InputError(f"a shaper's {name} must be positive, not {value:g}")
        if not (self.tail_s >= 0 and math.isfinite(self.tail_s)):
            raise InputError(f"a shaper's tail_s must not be negative, not {self.tail_s:g}")

    @property
    def duration_s(self) -> float:
        """What the shaper adds to a move (after its time scale): the last impulse's time, the box, the tail."""
        return self.impulses[-1].time_s + (self.box_s or 0.0) + self.tail_s
