"""What a scene file says: SI units, radians unless a name says otherwise, keys as the fields are named."""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, Move, Pendulum
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.tags.families import tag_family, tag_pattern

Pair = tuple[float, float]
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
class SceneCamera:
    """A pinhole camera that looks at a point of the plane in which the payload swings.

    Parameters
    ----------
    width, height : int
        Of the image in px, both even.
    distance_m : float
        From the camera to the point it looks at.
    focal_px : float
        Focal length.
    target_m : tuple of float, optional
        That point (x, z); by default the middle of what moves.
    yaw_deg, pitch_deg : float
        The camera walks around the target to the left (and so looks to the right), and down (looks up).
    roll_deg : float
        The camera turned clockwise about its axis, as seen from behind it: the picture turns the other way.
    radial_k1 : float
        Radial distortion, ``x_d = x (1 + k1 ρ²)`` with ρ in units of the focal length.
    shake_px, shake_hz : float
        RMS of the picture's shift per axis, and about which frequency.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    width: int = 1280
    height: int = 720
    distance_m: float = 2.0
    focal_px: float = 3000.0
    target_m: Pair | None = None
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    radial_k1: float = 0.0
    shake_px: float = 0.0
    shake_hz: float = 8.0

    def __post_init__(self) -> None:
        check(self, positive=("distance_m", "focal_px", "shake_hz"), not_negative=("shake_px",))
        check(self, finite=("target_m", "roll_deg", "radial_k1"))
        for name in ("width", "height"):
            size = getattr(self, name)
            if not (16 <= size <= 8192 and size % 2 == 0):
                raise InputError(f"the camera's {name} must be an even number from 16 to 8192, not {size}")
        for name in ("yaw_deg", "pitch_deg"):
            if not abs(getattr(self, name)) <= 60:
                raise InputError(f"the camera's {name} must lie within ±60, not {getattr(self, name):g}")
        corner = math.hypot(self.width, self.height) / 2 / self.focal_px
        if not 1 + 3 * self.radial_k1 * (1.5 * corner) ** 2 > 0.1:
            raise InputError(
                f"radial_k1 = {self.radial_k1:g} folds the picture over at its corners: nearer to 0, please"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """What the sensor makes of the light, and what else is to be seen.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the lens' blur; at least 0.3, which the sampling needs.
    exposure_s : float
        How long each image gathers light.
    noise_grey : float
        Standard deviation of a pixel's noise, in grey levels.
    black_grey, white_grey : float
        Grey levels of the tags' ink and paper.
    texture_grey : float
        Standard deviation of the background's texture.
    decoys : int
        How many squares that are no tags stand in the background.
    supersampling : int
        Samples a pixel and axis.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    blur_px: float = 0.6
    exposure_s: float = 0.001
    noise_grey: float = 1.0
    black_grey: float = 35.0
    white_grey: float = 215.0
    texture_grey: float = 0.0
    decoys: int = 0
    supersampling: int = 3

    def __post_init__(self) -> None:
        check(self, not_negative=("exposure_s", "noise_grey", "texture_grey"))
        if not 0.3 <= self.blur_px <= 20:
            raise InputError(f"blur_px must lie between 0.3 and 20, not {self.blur_px:g}")
        if not 0 <= self.black_grey < self.white_grey <= 255:
            raise InputError("black_grey must lie below white_grey, both in 0..255")
        if not (1 <= self.supersampling <= 16 and 0 <= self.decoys <= 1000):
            raise InputError("supersampling must lie in 1..16 and decoys in 0..1000")


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFormat:
    """How the frames are taken and stored.

    Parameters
    ----------
    fps_hz : float
        Capture rate.
    header_fps_hz : float, optional
        Rate that the file claims, as high-speed cameras do; by default the capture rate.
    time_jitter_s : float
        Standard deviation of the frames' true times about the uniform ones; the file has the true ones.
    time_rounding_s : float, optional
        The container rounds its times to this, as phones' do.
    codec : {"h264", "hevc", "mjpeg", "ffv1", "raw"}
        The last two lose nothing.
    quality : float
        Of h264 and hevc the crf (18 is fine, 28 poor), of mjpeg the quantiser (2 is fine, 31 poor).
    full_range : bool
        Luma in 0..255 rather than 16..235.
    lost : tuple of (first, last)
        Frames, by number, that never reached the file.
    lost_share : float
        Share of the others that were lost at random.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    fps_hz: float = 200.0
    header_fps_hz: float | None = None
    time_jitter_s: float = 0.0
    time_rounding_s: float | None = None
    codec: Literal["h264", "hevc", "mjpeg", "ffv1", "raw"] = "h264"
    quality: float = 18.0
    full_range: bool = True
    lost: tuple[tuple[int, int], ...] = ()
    lost_share: float = 0.0

    def __post_init__(self) -> None:
        check(self, positive=("fps_hz", "header_fps_hz", "time_rounding_s"), not_negative=("time_jitter_s", "quality"))
        if not 0 <= self.lost_share < 1:
            raise InputError(f"lost_share must lie in [0, 1), not {self.lost_share:g}")


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


def check(
    part: object,
    *,
    positive: tuple[str, ...] = (),
    not_negative: tuple[str, ...] = (),
    finite: tuple[str, ...] = (),
) -> None:
    """Raise InputError where one of these fields is not what it must be; None passes."""
    for names, low, words in (
        (positive, lambda v: v > 0, "a positive number"),
        (not_negative, lambda v: v >= 0, "0 or more"),
        (finite, lambda v: True, "finite"),
    ):
        for name in names:
            given = getattr(part, name)
            values = given if isinstance(given, tuple) else () if given is None else (given,)
            for value in values:
                if not (math.isfinite(value) and low(value)):
                    raise InputError(f"{name} must be {words}, not {value:g}")
