"""How much of a move falls on the payload's own frequency."""

from dataclasses import dataclass
from typing import ClassVar

from tagsway.model.estimate import FORBID_UNKNOWN, Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """What a move of the tool excites, as its spectrum says: A(f) = ∫ X'' exp(-2πi f t) dt, in m/s.

    Parameters
    ----------
    frequency_hz : float
        At which it is read: the payload's, at its operating amplitude.
    share_of_peak : Estimate
        |A| there over its largest value at any frequency: 0 where the move does not touch the mode, 1 where it
        excites nothing more than the mode.
    share_of_push : Estimate
        |A| there over ∫ |X''| dt: 1 where every push of the move falls in step with the sway, the worst that pushes of
        this size can do.
    sway_m : Estimate or None
        |A| / (2π f): the sway that a level move leaves to an undamped point mass as long as it is small; None without
        lengths.
    strongest_hz : float
        Where |A| is largest.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    frequency_hz: float
    share_of_peak: Estimate
    share_of_push: Estimate
    sway_m: Estimate | None
    strongest_hz: float
