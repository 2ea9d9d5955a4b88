"""Which payload is meant, and how much it varies: from options, a measurement, or many."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, DesignMode, Mode, Notice, Spread

if TYPE_CHECKING:
    from tagsway.model import Result
    from tagsway.store.measurements import MeasuredModes


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A payload, as the commands that design and simulate read it.

    Parameters
    ----------
    modes : tuple of DesignMode
        What a shaper is designed for, at the operating amplitude: one, or several to be stopped at once.
    spread : Spread or None
        How the first one's frequency varies between repeats; None where nothing tells.
    source : str
        Where it came from.
    swings : tuple of Mode
        Every mode that was seen or stated, of a small swing; the first is the pendulum's.
    length_m, tag_radius_m : float or None
        Of the pendulum, where they were measured and told apart from its spring.
    drag_per_rad : float
        Of the pendulum.
    repeats : MeasuredModes or None
        The measurements of a set.
    result : Result or None
        One measurement.
    notices : tuple of Notice
        What is missing there.
    """

    modes: tuple[DesignMode, ...]
    spread: Spread | None
    source: str
    swings: tuple[Mode, ...]
    length_m: float | None = None
    tag_radius_m: float | None = None
    drag_per_rad: float = 0.0
    repeats: "MeasuredModes | None" = None
    result: "Result | None" = None
    notices: tuple[Notice, ...] = ()

    @property
    def mode(self) -> DesignMode:
        """The only one."""
        if len(self.modes) != 1:
            raise InputError(f"this takes one mode, not {len(self.modes)}: give --frequency and --damping once")
        return self.modes[0]


NO_TARGET = Target(modes=(), spread=None, source="given", swings=())
"""For a shaper by hand, which need not be for any mode."""


def read_target(
    origin: Path | None, frequencies: Sequence[float], dampings: Sequence[float], frequency_spread: float | None
) -> Target:
    """Return the payload that the options of `identify shaper`, `design` and `simulate` speak of.

    Parameters
    ----------
    origin : Path or None
        result.json of one measurement, or measurements.csv of many.
    frequencies, dampings : sequence of float
        Stated instead, in Hz and as ratios; as many of the one as of the other.
    frequency_spread : float or None
        Standard deviation of the frequency in percent; it goes before a measured one.

    Raises
    ------
    InputError
        Where they say nothing, too much, or what cannot be.
    """
    if frequency_spread is not None and not frequency_spread > 0:
        raise InputError(f"--frequency-spread is {frequency_spread:g}: expected a standard deviation in percent, > 0")
    if origin is None:
        target = _stated(frequencies, dampings)
    elif frequencies or dampings:
        raise InputError("--from and --frequency/--damping contradict each other: give one or the other")
    else:
        target = _from_measurements(origin) if origin.suffix.lower() == ".csv" else _from_result(origin)
    if frequency_spread is None:
        return target
    stated = Spread(source="--frequency-spread", natural_frequency_std_percent=frequency_spread, n=None)
    return replace(target, spread=stated)


def _stated(frequencies: Sequence[float], dampings: Sequence[float]) -> Target:
    if not frequencies or len(frequencies) != len(dampings):
        raise InputError(
            "a shaper needs a mode: give --from result.json or measurements.csv, or --frequency HZ and --damping "
            f"RATIO of each mode (there are {len(frequencies)} and {len(dampings)})"
        )
    pairs = list(zip(frequencies, dampings, strict=True))
    modes = tuple(DesignMode(frequency_hz=frequency, damping_ratio=damping) for frequency, damping in pairs)
    return Target(modes=modes, spread=None, source="given", swings=tuple(_small(mode) for mode in modes))


def _from_result(path: Path) -> Target:
    from tagsway.store.documents import read_result

    result = read_result(path)
    modal, shaper, pendulum = result.modal, result.shaper, result.pendulum
    if modal is None or modal.natural_frequency_hz is None or shaper is None:
        raise InputError(f"{path} holds no mode to design for, nor to simulate: its status is {result.status}")
    notices: tuple[Notice, ...] = ()
    if modal.damping_ratio is None:
        words = f"{path.name} does not tell the damping of a small swing: an undamped payload is taken, the worst one"
        notices = (Notice(code="damping_not_determined", message=words),)
    first = _mode(modal.natural_frequency_hz.value, 0.0 if modal.damping_ratio is None else modal.damping_ratio.value)
    length = None
    if pendulum is not None and pendulum.determined and pendulum.length_m is not None:
        # A spring cannot be negative: where the fit's errors make it so, the free pendulum's length is the nearest.
        length = max(pendulum.length_m.value, GRAVITY_M_S2 / first.angular_frequency_rad_s**2)
    drag = None if pendulum is None or length is None else pendulum.quadratic_drag_per_rad
    return Target(
        modes=shaper.modes,
        spread=None if shaper.residual is None else shaper.residual.spread,
        source=shaper.source,
        swings=(first, *(_mode(m.natural_frequency_hz.value, m.damping_ratio.value) for m in modal.modes[1:])),
        length_m=length,
        tag_radius_m=None if pendulum is None or pendulum.tag_radius_m is None else pendulum.tag_radius_m.value,
        drag_per_rad=0.0 if drag is None else max(drag.value, 0.0),
        result=result,
        notices=notices,
    )


def _from_measurements(path: Path) -> Target:
    from tagsway.store.measurements import read_measurements

    repeats = read_measurements(path)
    return Target(
        modes=(repeats.mode,),
        spread=repeats.spread,
        source=f"{repeats.source}: median of {len(repeats.frequency_hz)}",
        swings=(_mode(repeats.natural_frequency_hz, repeats.mode.damping_ratio),),
        repeats=repeats,
    )


def _small(mode: DesignMode) -> Mode:
    return _mode(mode.frequency_hz, mode.damping_ratio)


def _mode(frequency_hz: float, damping_ratio: float) -> Mode:
    """Return a mode; a damping that its own error puts below zero, or near one, is brought back."""
    return Mode(natural_frequency_hz=frequency_hz, damping_ratio=min(max(damping_ratio, 0.0), 0.99))
