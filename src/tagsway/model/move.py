"""What the robot is asked to do: a move, its limits, and the robot."""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN

Axis = Literal["x", "y", "z"]
Profile = Literal["pick-and-place", "bang-bang", "trapezoid", "s-curve", "quintic", "b-spline", "path"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a shaped move must keep; None where nothing is asked.

    Parameters
    ----------
    velocity_m_s, acceleration_m_s2, jerk_m_s3 : float or None
        Most of each, of the vector.
    box_m : tuple of tuple of float or None
        Lower and upper corner of the workspace.
    path_deviation_mm : float or None
        Most that the shaped path may lie off the unshaped one.
    vertical_mm : float or None
        Height that must stay strictly vertical at both ends.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    velocity_m_s: float | None = None
    acceleration_m_s2: float | None = None
    jerk_m_s3: float | None = None
    box_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    path_deviation_mm: float | None = None
    vertical_mm: float | None = None

    def __post_init__(self) -> None:
        for name in ("velocity_m_s", "acceleration_m_s2", "jerk_m_s3", "path_deviation_mm", "vertical_mm"):
            value = getattr(self, name)
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise InputError(f"the limit {name} must be positive, not {value:g}; leave it out for none")
        if self.box_m is not None and not all(low <= high for low, high in zip(*self.box_m, strict=True)):
            corners = [list(corner) for corner in self.box_m]
            raise InputError(f"the limit box_m needs a lower and an upper corner, not {corners}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """The robot's kind and its lengths in metres, by name."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    kind: Literal["cartesian", "delta", "scara"] = "cartesian"
    lengths_m: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A rest-to-rest move of the tool, as a move.toml states it; the names and units are those of the file."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    from_m: tuple[float, float, float]
    to_m: tuple[float, float, float]
    max_acceleration_m_s2: float
    profile: Profile = "pick-and-place"
    pick_height_m: float = 0.0
    place_height_m: float = 0.0
    max_velocity_m_s: float | None = None
    max_jerk_m_s3: float | None = None
    shaped_axes: tuple[Literal["x", "z", "path"], ...] = ("x",)
    sample_time_ms: float = 1.0
    run_time_s: float | None = None
    limits: Limits = field(default_factory=Limits)
    robot: Robot = field(default_factory=Robot)

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) for value in (*self.from_m, *self.to_m)):
            raise InputError(f"from_m {list(self.from_m)} and to_m {list(self.to_m)} must be finite numbers")
        distance = math.dist(self.from_m, self.to_m)
        if not distance > 0:
            raise InputError(f"a move must lead somewhere: from_m and to_m are both {list(self.from_m)}")
        if not distance <= 20:
            raise InputError(f"a move of {distance:g} m is too long for a robot: from_m and to_m are in metres, not mm")
        positive = {
            "max_acceleration_m_s2": self.max_acceleration_m_s2,
            "max_velocity_m_s": self.max_velocity_m_s,
            "max_jerk_m_s3": self.max_jerk_m_s3,
            "sample_time_ms": self.sample_time_ms,
            "run_time_s": self.run_time_s,
        }
        for name, value in positive.items():
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise InputError(f"{name} must be positive, not {value:g}")
        for name in ("pick_height_m", "place_height_m"):
            value = getattr(self, name)
            if not 0 <= value <= 5:
                raise InputError(f"{name} must lie between 0 and 5 m, not {value:g}")
        if len(set(self.shaped_axes)) != len(self.shaped_axes):
            raise InputError(f"shaped_axes names an axis twice: {list(self.shaped_axes)}")
