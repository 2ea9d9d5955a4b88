"""What happened to the grip while it was filmed."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.estimate import FORBID_UNKNOWN, Estimate

EventKind = Literal["peel_off", "grip_slip", "product_lost"]

EVENT_WORDS: dict[str, str] = {
    "peel_off": "the product peeled off",
    "grip_slip": "the grip slipped",
    "product_lost": "the product's tag was lost for good",
}
"""What each kind of event is, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened to the grip.

    Parameters
    ----------
    kind : {"peel_off", "grip_slip", "product_lost"}
        The product left its arc and fell; its distance from the pivot grew while it was held; its tag was not seen any
        more although the record goes on.
    time_s : Estimate
        When: the last instant at which it was held, the middle of the slip, the last sighting.
    horizontal_acceleration_m_s2, held_acceleration_m_s2 : Estimate or None
        |x''| of the product, and √(x''² + (z'' + g)²), what the gripper had to hold: means over the 50 ms before it.
        None where lengths are not known, or too few samples were seen.
    growth_m : Estimate or None
        Of the distance from the pivot, for a slip.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    kind: EventKind
    time_s: Estimate
    horizontal_acceleration_m_s2: Estimate | None = None
    held_acceleration_m_s2: Estimate | None = None
    growth_m: Estimate | None = None

    @property
    def ends_grip(self) -> bool:
        """Whether nothing after it is a sway."""
        return self.kind != "grip_slip"

    @property
    def words(self) -> str:
        """What happened."""
        return EVENT_WORDS[self.kind]
