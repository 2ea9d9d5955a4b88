"""Which mode a shaper is for, and how much it varies: from options, a measurement, or many."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tagsway.errors import InputError
from tagsway.model import DesignMode, Spread


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What a shaper is designed for.

    Parameters
    ----------
    modes : tuple of DesignMode
        One, or several to be stopped at once.
    spread : Spread or None
        How its frequency varies between repeats; None where nothing tells.
    source : str
        Where it came from.
    """

    modes: tuple[DesignMode, ...]
    spread: Spread | None
    source: str

    @property
    def mode(self) -> DesignMode:
        """The only one."""
        if len(self.modes) != 1:
            raise InputError(f"this takes one mode, not {len(self.modes)}: give --frequency and --damping once")
        return self.modes[0]


NO_TARGET = Target(modes=(), spread=None, source="given")
"""For a shaper by hand, which need not be for any mode."""


def read_target(
    origin: Path | None, frequencies: Sequence[float], dampings: Sequence[float], frequency_spread: float | None
) -> Target:
    """Return what the options of `identify shaper` ask a shaper for.

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
    return Target(modes=target.modes, spread=stated, source=target.source)


def _stated(frequencies: Sequence[float], dampings: Sequence[float]) -> Target:
    if not frequencies or len(frequencies) != len(dampings):
        raise InputError(
            "a shaper needs a mode: give --from result.json or measurements.csv, or --frequency HZ and --damping "
            f"RATIO of each mode (there are {len(frequencies)} and {len(dampings)})"
        )
    pairs = zip(frequencies, dampings, strict=True)
    modes = tuple(DesignMode(frequency_hz=frequency, damping_ratio=damping) for frequency, damping in pairs)
    return Target(modes=modes, spread=None, source="given")


def _from_result(path: Path) -> Target:
    from tagsway.store.documents import read_result

    measured = read_result(path).shaper
    if measured is None:
        raise InputError(f"{path} holds no mode to design for: its status is not_determined")
    spread = None if measured.residual is None else measured.residual.spread
    return Target(modes=measured.modes, spread=spread, source=measured.source)


def _from_measurements(path: Path) -> Target:
    from tagsway.store.measurements import read_measurements

    measured = read_measurements(path)
    n = len(measured.frequency_hz)
    return Target(modes=(measured.mode,), spread=measured.spread, source=f"{measured.source}: median of {n}")
