"""What a scene file says: SI units, radians unless a name says otherwise, keys as the fields are named."""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, Move, Pendulum
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.scene.checks import Pair, check
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat
from tagsway.tags.families import tag_family, tag_pattern

TagName = Literal["tcp", "pcp", "reference"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The body that swings, and how it begins.

    Parameters
    ----------
    length_m : float
        Equivalent length l = J / (m l_c).
    tag_radius_m : float, optional
        r, from the pivot to the PCP tag; by default l.
    centre_of_mass_m : float, optional
        l_c, from the pivot to the centre of mass; by default l, as for a point mass.
    mass_kg : float
        m.
    stiffness_n_m_per_rad, natural_frequency_hz : float, optional
        The torsion spring k, or the undamped small-swing frequency that it makes; by default no spring.
    damping_n_m_s_per_rad, damping_ratio : float, optional
        The damper b, or the small-swing ratio that it makes; by default none.
    quadratic_drag_per_rad, coulomb_friction_rad_s2 : float
        d in the drag d q' |q'|; the angular acceleration of dry friction.
    release_angle_rad : float
        q until the start, held by hand.
    sideways_angle_rad : float
        The same out of the plane, away from the camera.
    sideways_stiffness_n_m_per_rad : float, optional
        Spring of the sway out of the plane; by default k.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    length_m: float
    tag_radius_m: float | None = None
    centre_of_mass_m: float | None = None
    mass_kg: float = 0.225
    stiffness_n_m_per_rad: float | None = None
    natural_frequency_hz: float | None = None
    damping_n_m_s_per_rad: float | None = None
    damping_ratio: float | None = None
    quadratic_drag_per_rad: float = 0.0
    coulomb_friction_rad_s2: float = 0.0
    release_angle_rad: float = 0.0
    sideways_angle_rad: float = 0.0
    sideways_stiffness_n_m_per_rad: float | None = None

    def __post_init__(self) -> None:
        check(self, positive=("length_m", "tag_radius_m", "centre_of_mass_m", "mass_kg", "natural_frequency_hz"))
        check(self, not_negative=("damping_n_m_s_per_rad", "quadratic_drag_per_rad", "coulomb_friction_rad_s2"))
        check(self, finite=("stiffness_n_m_per_rad", "sideways_stiffness_n_m_per_rad"))
        if self.stiffness_n_m_per_rad is not None and self.natural_frequency_hz is not None:
            raise InputError("give stiffness_n_m_per_rad or natural_frequency_hz, not both")
        if self.damping_n_m_s_per_rad is not None and self.damping_ratio is not None:
            raise InputError("give damping_n_m_s_per_rad or damping_ratio, not both")
        if self.damping_ratio is not None and not 0 <= self.damping_ratio < 1:
            raise InputError(f"damping_ratio must lie in [0, 1), not {self.damping_ratio:g}")
        for name in ("release_angle_rad", "sideways_angle_rad"):
            if not abs(getattr(self, name)) < math.pi / 2:
                raise InputError(f"{name} must lie within ±π/2, not {getattr(self, name):g} (radians)")
        self.pendulum()

    @property
    def inertia_kg_m2(self) -> float:
        """J = m l l_c, about the pivot."""
        return self.mass_kg * self.length_m * (self.centre_of_mass_m or self.length_m)

    def pendulum(self) -> Pendulum:
        """Return the same body as the rest of the house writes it."""
        spring = (self.stiffness_n_m_per_rad or 0.0) / self.inertia_kg_m2
        if self.natural_frequency_hz is not None:
            spring = (2 * math.pi * self.natural_frequency_hz) ** 2 - GRAVITY_M_S2 / self.length_m
        damping = (self.damping_n_m_s_per_rad or 0.0) / self.inertia_kg_m2
        if self.damping_ratio is not None:
            damping = 2 * self.damping_ratio * math.sqrt(max(GRAVITY_M_S2 / self.length_m + spring, 0.0))
        return Pendulum(
            length_m=self.length_m,
            tag_radius_m=self.tag_radius_m or self.length_m,
            stiffness_over_inertia_rad2_s2=spring,
            damping_over_inertia_rad_s=damping,
            quadratic_drag_per_rad=self.quadratic_drag_per_rad,
            coulomb_friction_rad_s2=self.coulomb_friction_rad_s2,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondBody:
    """A body hung from the first, as the goods in a bag; the PCP tag stays on the first.

    Parameters
    ----------
    hinge_m : float
        From the pivot down the first body to the hinge.
    length_m, centre_of_mass_m, mass_kg : float
        As in `Payload`, about the hinge.
    stiffness_n_m_per_rad, damping_n_m_s_per_rad : float
        Of the hinge.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    hinge_m: float
    length_m: float
    mass_kg: float
    centre_of_mass_m: float | None = None
    stiffness_n_m_per_rad: float = 0.0
    damping_n_m_s_per_rad: float = 0.0

    def __post_init__(self) -> None:
        check(self, positive=("hinge_m", "length_m", "mass_kg", "centre_of_mass_m"))
        check(self, not_negative=("stiffness_n_m_per_rad", "damping_n_m_s_per_rad"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tool:
    """Where the tool is, and where the payload hangs from it; coordinates are x right, z up.

    Parameters
    ----------
    position_m : tuple of float
        The TCP tag's centre, where there is neither a move nor a trajectory.
    pivot_offset_m : tuple of float
        From the TCP tag's centre to the pivot.
    start_s : float
        When the move begins, or the hand lets go.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    position_m: Pair = (0.0, 0.0)
    pivot_offset_m: Pair = (0.0, -0.04)
    start_s: float = 0.2

    def __post_init__(self) -> None:
        check(self, not_negative=("start_s",), finite=("position_m", "pivot_offset_m"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoints:
    """A tool's path as a table, at rest before its first and after its last row; a cubic spline lies between.

    Parameters
    ----------
    time_s, x_m, z_m : tuple of float
        Rising times from the start on, and the position of the TCP tag's centre.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    time_s: tuple[float, ...]
    x_m: tuple[float, ...]
    z_m: tuple[float, ...]

    def __post_init__(self) -> None:
        check(self, finite=("time_s", "x_m", "z_m"))
        if not len(self.time_s) == len(self.x_m) == len(self.z_m) >= 2:
            raise InputError("a trajectory needs two rows or more, each with time_s, x_m and z_m")
        if not all(b > a for a, b in zip(self.time_s, self.time_s[1:], strict=False)):
            raise InputError("a trajectory's times must rise from row to row")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """One tag: its number, the side of its square, and how much farther from the camera than the pivot it lies."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    id: int
    size_m: float = 0.03
    depth_m: float = 0.0

    def __post_init__(self) -> None:
        check(self, positive=("size_m",), finite=("depth_m",))


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedTag(Tag):
    """The tag on the machine's frame, with its place (x, z)."""

    position_m: Pair


@dataclass(frozen=True, slots=True, kw_only=True)
class Tags:
    """The tags of the scene; `reference` is fixed to the machine."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    family: str = "tag36h11"
    tcp: Tag | None = field(default_factory=lambda: Tag(id=0))
    pcp: Tag | None = field(default_factory=lambda: Tag(id=1))
    reference: FixedTag | None = None

    def __post_init__(self) -> None:
        tag_family(self.family)
        named = [tag.id for tag in (self.tcp, self.pcp, self.reference) if tag is not None]
        for tag_id in named:
            tag_pattern(self.family, tag_id)
        if len(set(named)) != len(named):
            raise InputError(f"tag ids are {named}: every tag needs an id of its own")


@dataclass(frozen=True, slots=True, kw_only=True)
class Occlusion:
    """Something grey in front of a tag for a while; it covers this share of the tag's width, from the left."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    tag: TagName
    start_s: float
    end_s: float
    share: float = 1.0

    def __post_init__(self) -> None:
        if not (self.end_s > self.start_s and 0 < self.share <= 1):
            raise InputError("an occlusion must end after it starts and cover a share in (0, 1]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A payload, a tool that moves it, and a camera that films both; see the parts for their fields.

    Parameters
    ----------
    duration_s : float
        Length of the film.
    move, trajectory : Move or Waypoints, optional
        How the TCP tag's centre moves; with neither it rests.
    seed : int
        Of all that is random.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    schema: Literal["tagsway/scene/1"] = "tagsway/scene/1"
    duration_s: float
    seed: int = 0
    payload: Payload
    second_body: SecondBody | None = None
    tool: Tool = field(default_factory=Tool)
    move: Move | None = None
    trajectory: Waypoints | None = None
    tags: Tags = field(default_factory=Tags)
    camera: SceneCamera = field(default_factory=SceneCamera)
    picture: Picture = field(default_factory=Picture)
    video: VideoFormat = field(default_factory=VideoFormat)
    occlusions: tuple[Occlusion, ...] = ()

    def __post_init__(self) -> None:
        check(self, positive=("duration_s",))
        if self.move is not None and self.trajectory is not None:
            raise InputError("give a move or a trajectory, not both")
        if not self.seed >= 0:
            raise InputError(f"seed must be 0 or more, not {self.seed}")
        frames = self.duration_s * self.video.fps_hz
        if not 1 <= frames <= 1e6:
            raise InputError(f"duration_s times fps_hz makes {frames:g} frames: expected 1 to a million")
        for tag in (self.tags.tcp, self.tags.pcp, self.tags.reference):
            if tag is not None and not tag.depth_m > -0.9 * self.camera.distance_m:
                raise InputError(f"depth_m = {tag.depth_m:g} puts tag {tag.id} behind the camera, or too near to it")
        if not self.picture.exposure_s <= 1 / self.video.fps_hz:
            raise InputError(
                f"exposure_s = {self.picture.exposure_s:g} is longer than a frame at {self.video.fps_hz:g} Hz"
            )
