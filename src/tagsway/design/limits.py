"""What a designed move must keep, and what became of it."""

import math
from dataclasses import dataclass

from tagsway.errors import InputError
from tagsway.model import Move

DEFAULT_WINDOW_SHARE = 0.02
"""Of the way: the band that counts as settled, where no placement window is stated."""

LIMIT_NAMES = (
    "planning",
    "acceleration_m_s2",
    "velocity_m_s",
    "jerk_m_s3",
    "box_m",
    "vertical_mm",
    "joints",
    "pcp_acceleration_m_s2",
    "box_error_mm",
    "placement_window_mm",
)
"""In the order in which they are looked at: what the robot cannot do first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignLimits:
    """The limits of a design; None where nothing is asked.

    Parameters
    ----------
    placement_window_m : float
        The product stays within it of the place point, along the way, from the end of the tool's motion on.
    pcp_acceleration_m_s2 : float or None
        Largest |x''| of the product, during and after the move: more peels it off.
    box_error_m : float or None
        The product's distance from the place point, along the way, below the rim of a box 50 mm above it, from the
        descent on.
    acceleration_m_s2, velocity_m_s, jerk_m_s3 : float or None
        Of the tool's vector.
    box_m : tuple or None
        Lower and upper corner of the workspace.
    vertical_m : float
        Height that stays strictly vertical at both ends.
    share : float
        Of the payloads of the spread that must keep them all.
    """

    placement_window_m: float
    pcp_acceleration_m_s2: float | None = None
    box_error_m: float | None = None
    acceleration_m_s2: float | None = None
    velocity_m_s: float | None = None
    jerk_m_s3: float | None = None
    box_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    vertical_m: float = 0.0
    share: float = 0.95

    def __post_init__(self) -> None:
        positive = {
            "placement window": self.placement_window_m,
            "PCP acceleration": self.pcp_acceleration_m_s2,
            "error in the box": self.box_error_m,
            "acceleration": self.acceleration_m_s2,
            "velocity": self.velocity_m_s,
            "jerk": self.jerk_m_s3,
        }
        for name, value in positive.items():
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise InputError(f"the limit on the {name} is {value:g}: expected a positive number")
        if not self.vertical_m >= 0:
            raise InputError(f"the vertical height is {self.vertical_m:g} m: expected 0 or more")
        if not 0.5 <= self.share < 1:
            raise InputError(f"the share that must keep the limits is {self.share:g}: expected 0.5 or more, below 1")


def read_limits(
    move: Move,
    *,
    pcp_acceleration_m_s2: float | None = None,
    placement_window_m: float | None = None,
    box_error_m: float | None = None,
) -> DesignLimits:
    """Return the limits of a move file, with what options say beside it.

    Where `[limits]` says nothing of velocity or jerk, the move's own maxima count; its `max_acceleration_m_s2` is what
    the design varies and limits nothing.

    Raises
    ------
    InputError
        Where an option and the file state the same limit differently.
    """
    limits = move.limits
    stated = _one("max-pcp-acceleration", pcp_acceleration_m_s2, limits.pcp_acceleration_m_s2)
    window = _one(
        "placement-window",
        None if placement_window_m is None else 1e3 * placement_window_m,
        limits.placement_window_mm,
    )
    way = math.dist(move.from_m[:2], move.to_m[:2])
    vertical = min(move.pick_height_m, move.place_height_m)
    return DesignLimits(
        placement_window_m=DEFAULT_WINDOW_SHARE * way if window is None else window / 1e3,
        pcp_acceleration_m_s2=stated,
        box_error_m=box_error_m,
        acceleration_m_s2=limits.acceleration_m_s2,
        velocity_m_s=limits.velocity_m_s or move.max_velocity_m_s,
        jerk_m_s3=limits.jerk_m_s3 or move.max_jerk_m_s3,
        box_m=limits.box_m,
        vertical_m=vertical if limits.vertical_mm is None else limits.vertical_mm / 1e3,
    )


def _one(name: str, option: float | None, in_file: float | None) -> float | None:
    if option is not None and in_file is not None and not math.isclose(option, in_file):
        raise InputError(
            f"--{name} is {option:g}, but the move's [limits] say {in_file:g}: they contradict each other, give one"
        )
    return in_file if option is None else option
