"""What the robot is asked to do: a move, its limits, and the robot."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import ClassVar, Literal

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN

Axis = Literal["x", "y", "z"]
Profile = Literal["pick-and-place", "bang-bang", "trapezoid", "s-curve", "quintic", "b-spline", "path"]

SHORTEST_WAY_M = 1e-9
"""Two points that lie closer are one."""


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
    pcp_acceleration_m_s2 : float or None
        Most |x''| of the product, for a design: more peels it off the gripper.
    placement_window_mm : float or None
        How far the product may be from the place point once the tool stands, for a design.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    velocity_m_s: float | None = None
    acceleration_m_s2: float | None = None
    jerk_m_s3: float | None = None
    box_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    path_deviation_mm: float | None = None
    vertical_mm: float | None = None
    pcp_acceleration_m_s2: float | None = None
    placement_window_mm: float | None = None

    def __post_init__(self) -> None:
        for name in (item.name for item in fields(self) if item.name != "box_m"):
            value = getattr(self, name)
            if value is not None and not (value > 0 and math.isfinite(value)):
                raise InputError(f"the limit {name} must be positive, not {value:g}; leave it out for none")
        if self.box_m is not None and not all(low <= high for low, high in zip(*self.box_m, strict=True)):
            corners = [list(corner) for corner in self.box_m]
            raise InputError(f"the limit box_m needs a lower and an upper corner, not {corners}")


ROBOT_LENGTHS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"cartesian": (), "delta": ("base", "platform", "upper", "lower"), "scara": ("inner", "outer")}
)
"""The lengths that each kind of robot has."""

LONGEST_ARM_M = 20.0
"""No arm is longer; a length of 348 is one in mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """The robot's kind, its lengths and its limits; what is needed to turn points into joint angles.

    Parameters
    ----------
    kind : {"cartesian", "delta", "scara"}
        A cartesian robot's joints are its axes.
    lengths_m : dict
        All of a kind, or none where no joints are asked for. Delta: "base" and "platform", from the centre to the
        arms' hinges, and the arms "upper" and "lower". SCARA: the arms "inner" and "outer".
    leg_azimuth_deg : float
        Of a delta's leg 1, from the x axis towards y; the others follow 120° apart in the same sense.
    joint_limits_deg : tuple of tuple of float
        Lowest and highest angle: one pair for all rotary joints, or one for each; empty for no limits.
    elbow : {"right", "left"}
        Of a SCARA, seen from above along the way from its base to the tool; on the right the second angle is positive.
    joint_names : tuple of str
        As the robot's own description calls them; empty for names by number.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    kind: Literal["cartesian", "delta", "scara"] = "cartesian"
    lengths_m: dict[str, float] = field(default_factory=dict)
    leg_azimuth_deg: float = -90.0
    joint_limits_deg: tuple[tuple[float, float], ...] = ()
    elbow: Literal["right", "left"] = "right"
    joint_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = ROBOT_LENGTHS[self.kind]
        if self.lengths_m and set(self.lengths_m) != set(names):
            wanted = f"all of {', '.join(names)}" if names else "none"
            raise InputError(f"a {self.kind} robot's lengths_m are {wanted}, not {', '.join(self.lengths_m)}")
        for name, length in self.lengths_m.items():
            if not 0 < length <= LONGEST_ARM_M:
                raise InputError(
                    f"the robot's length {name} is {length:g} m: expected more than 0 and at most {LONGEST_ARM_M:g}; "
                    "lengths_m are in metres, not mm"
                )
        if not math.isfinite(self.leg_azimuth_deg):
            raise InputError(f"leg_azimuth_deg must be an angle in degrees, not {self.leg_azimuth_deg:g}")
        rotary = {"cartesian": 0, "delta": 3, "scara": 2}[self.kind]
        if self.joint_limits_deg and len(self.joint_limits_deg) not in ({1, rotary} if rotary else {0}):
            raise InputError(
                f"joint_limits_deg holds {len(self.joint_limits_deg)} pairs: expected one pair for all of a "
                f"{self.kind} robot's {rotary} rotary joints, or one for each"
            )
        for low, high in self.joint_limits_deg:
            if not low < high:
                raise InputError(
                    f"joint_limits_deg must be pairs of a lower and a higher angle, not [{low:g}, {high:g}]"
                )
        if self.joint_names and len(set(self.joint_names)) != 3:
            raise InputError(f"joint_names must be three different names, not {list(self.joint_names)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ArcThrough:
    """One segment of a path that is a circular arc.

    Parameters
    ----------
    segment : int
        Which one: 0 leads from `from_m` to the first waypoint.
    through_m : tuple of float
        A point on the arc between its two ends.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    segment: int
    through_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A rest-to-rest move of the tool, as a move.toml states it; the names and units are those of the file.

    Parameters
    ----------
    waypoints_m : tuple of tuple of float
        Between the two ends, for the profiles "path" (its corners) and "b-spline" (which passes through them).
    arcs : tuple of ArcThrough
        The segments of a path that are no straight lines.
    feed_rate_m_s : float or None
        Speed along a path; None takes `max_velocity_m_s`.
    corner_error_mm : float
        How far the tool may pass from a path's corner; 0 stops there.
    along_path : {"feed-rate", "quintic"}
        A constant feed rate with ramps and corners, or one quintic over a path without corners.
    """

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
    waypoints_m: tuple[tuple[float, float, float], ...] = ()
    arcs: tuple[ArcThrough, ...] = ()
    feed_rate_m_s: float | None = None
    corner_error_mm: float = 0.0
    along_path: Literal["feed-rate", "quintic"] = "feed-rate"
    limits: Limits = field(default_factory=Limits)
    robot: Robot = field(default_factory=Robot)

    def __post_init__(self) -> None:
        self._check_points()
        self._check_path()
        positive = {
            "max_acceleration_m_s2": self.max_acceleration_m_s2,
            "max_velocity_m_s": self.max_velocity_m_s,
            "max_jerk_m_s3": self.max_jerk_m_s3,
            "sample_time_ms": self.sample_time_ms,
            "run_time_s": self.run_time_s,
            "feed_rate_m_s": self.feed_rate_m_s,
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

    def _check_points(self) -> None:
        points = (self.from_m, *self.waypoints_m, self.to_m)
        through = [arc.through_m for arc in self.arcs]
        if not all(math.isfinite(value) for point in (*points, *through) for value in point):
            raise InputError(f"a move's points must be finite, not {[list(point) for point in (*points, *through)]}")
        if not self.waypoints_m and math.dist(self.from_m, self.to_m) < SHORTEST_WAY_M:
            raise InputError(f"a move must lead somewhere: from_m and to_m are both {list(self.from_m)}")
        for start, end in itertools.pairwise(points):
            if not math.dist(start, end) >= SHORTEST_WAY_M:
                raise InputError(f"two points that follow each other are both {list(end)}: leave one out")
        distance = math.fsum(itertools.starmap(math.dist, itertools.pairwise(points)))
        if not distance <= 20:
            raise InputError(f"a move of {distance:g} m is too long for a robot: from_m and to_m are in metres, not mm")

    def _check_path(self) -> None:
        if self.waypoints_m and self.profile not in ("path", "b-spline"):
            raise InputError(f"waypoints_m belong to the profiles path and b-spline, not to {self.profile}")
        path_only = {"arcs": self.arcs, "feed_rate_m_s": self.feed_rate_m_s, "corner_error_mm": self.corner_error_mm}
        for name, value in path_only.items():
            if value and self.profile != "path":
                raise InputError(f"{name} belongs to the profile path, not to {self.profile}")
        if not 0 <= self.corner_error_mm <= 100:
            raise InputError(f"corner_error_mm must lie between 0 and 100 mm, not {self.corner_error_mm:g}")
        named = [arc.segment for arc in self.arcs]
        if len(set(named)) != len(named) or not all(0 <= segment <= len(self.waypoints_m) for segment in named):
            raise InputError(f"arcs name the segments {named}: expected each once, from 0 to {len(self.waypoints_m)}")
