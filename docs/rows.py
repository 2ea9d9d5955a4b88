"""What one number of a document is compared with."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tagsway.model import DesignMode, Mode, Shaper

LINES = {
    "flex": DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4),
    "stiff": DesignMode(frequency_hz=3.5906, damping_ratio=0.0012),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One number.

    Parameters
    ----------
    key : str
        Where it stands in the reference, parts joined by " / ".
    published : float or str or None
        In the document; None where it prints none.
    recomputed, tolerance : float
        By another implementation, and how far ours may lie from it.
    ours : float
        What tagsway gives.
    """

    key: str
    published: Any
    recomputed: float
    ours: float
    tolerance: float

    @property
    def passed(self) -> bool:
        """Whether ours is the recomputed value."""
        return abs(self.ours - self.recomputed) <= self.tolerance


def compare(key: str, recomputed: float, ours: float, tolerance: float, published: Any = None) -> Row:
    """Return the row of one number."""
    return Row(key=key, published=published, recomputed=recomputed, ours=ours, tolerance=tolerance)


def compare_each(key: str, recomputed: Sequence[float], ours: Sequence[float], tolerance: float) -> Iterator[Row]:
    """Return a row for each of a list of numbers."""
    for i, (other, own) in enumerate(zip(recomputed, ours, strict=True)):
        yield compare(f"{key} / {i}", other, float(own), tolerance)


def compare_listed(key: str, entry: Mapping[str, Any], ours: float) -> Row:
    """Return the row of a number whose published value and tolerance stand beside it."""
    return compare(key, entry["got"], ours, entry["tol"], entry["published"])


def mode_of(frequency_hz: float, damping_ratio: float) -> Mode:
    """Return the mode that vibrates."""
    return Mode(natural_frequency_hz=frequency_hz, damping_ratio=damping_ratio)


def times_of(shaper: Shaper) -> list[float]:
    """Return the times of a shaper's impulses, in s."""
    return [impulse.time_s for impulse in shaper.impulses]
