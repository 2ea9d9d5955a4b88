"""What is true of a simulated video, to hold a measurement against."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from tagsway.model import FloatArray, Mode
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.scene.model import Tag, TagName
from tagsway.scene.motion import find_modes
from tagsway.scene.render import Film, carriers, pose_of

Pairs = list[tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueTag:
    """One tag: its measures, and the image of its centre in every frame, hidden or not.

    Parameters
    ----------
    id : int
        Its number.
    size_mm : float
        Side of its square.
    mm_per_px : float
        Scale at its place in the middle of the film; across the picture it varies with the camera's tilt.
    centre_px : list of (x, y)
        Image of its centre, with the lens' distortion and the shake; (0, 0) is the centre of the first pixel.
    hidden : list of int
        Rows in which something covers some of it.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    id: int
    size_mm: float
    mm_per_px: float
    centre_px: Pairs
    hidden: list[int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """All that a measurement of the video should find; metres and radians unless a name says otherwise.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : float
        Undamped, small-swing, of the mode in which the tagged body sways; with a second body not those of the
        pendulum alone, which are in `implied_…`.
    modes : list of Mode
        All modes in the plane, that one first.
    length_m, tag_radius_m, pivot_offset_m : float or (x, z)
        l, r, and the way from the TCP tag to the pivot.
    move_s : tuple of float
        When the tool begins to move, and when it rests again; equal without a move.
    free_amplitude_m : float
        Largest |r sin q| from then on.
    peak_angle_rad : float
        Largest |q| of all.
    frame : list of int
        Numbers of the captured frames in the file; what is missing was lost.
    time_s : list of float
        The middle of each one's exposure, before the file rounds it and whatever rate its header claims.
    tcp_m, pcp_m : list of (x, z)
        Centres of the two tags.
    angle_rad, sideways_rad : list of float
        q, and the sway out of the plane.
    tags : dict
        By "tcp", "pcp", "reference".
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    schema: Literal["tagsway/truth/1"] = "tagsway/truth/1"
    natural_frequency_hz: float
    damping_ratio: float
    implied_natural_frequency_hz: float
    implied_damping_ratio: float
    modes: list[Mode]
    length_m: float
    tag_radius_m: float
    centre_of_mass_m: float
    mass_kg: float
    inertia_kg_m2: float
    stiffness_n_m_per_rad: float
    damping_n_m_s_per_rad: float
    stiffness_over_inertia_rad2_s2: float
    damping_over_inertia_rad_s: float
    quadratic_drag_per_rad: float
    coulomb_friction_rad_s2: float
    pivot_offset_m: tuple[float, float]
    family: str
    fps_hz: float
    header_fps_hz: float
    move_s: tuple[float, float]
    free_amplitude_m: float
    peak_angle_rad: float
    frame: list[int]
    time_s: list[float]
    tcp_m: Pairs
    pcp_m: Pairs
    angle_rad: list[float]
    sideways_rad: list[float]
    tags: dict[TagName, TrueTag]


def describe_film(film: Film) -> Truth:
    """Return what is true of a film; nothing is drawn."""
    scene, payload = film.scene, film.scene.payload
    pendulum, modes = payload.pendulum(), find_modes(scene)
    middle = slice(1, None, 3)
    angle = film.poses.angle_rad[middle]
    free = film.time_s >= film.poses.move_s[1]
    sway = pendulum.tag_radius_m * np.abs(np.sin(angle))
    return Truth(
        natural_frequency_hz=modes[0].natural_frequency_hz,
        damping_ratio=modes[0].damping_ratio,
        implied_natural_frequency_hz=pendulum.natural_frequency_hz,
        implied_damping_ratio=pendulum.damping_ratio,
        modes=list(modes),
        length_m=pendulum.length_m,
        tag_radius_m=pendulum.tag_radius_m,
        centre_of_mass_m=payload.centre_of_mass_m or payload.length_m,
        mass_kg=payload.mass_kg,
        inertia_kg_m2=payload.inertia_kg_m2,
        stiffness_n_m_per_rad=pendulum.stiffness_over_inertia_rad2_s2 * payload.inertia_kg_m2,
        damping_n_m_s_per_rad=pendulum.damping_over_inertia_rad_s * payload.inertia_kg_m2,
        stiffness_over_inertia_rad2_s2=pendulum.stiffness_over_inertia_rad2_s2,
        damping_over_inertia_rad_s=pendulum.damping_over_inertia_rad_s,
        quadratic_drag_per_rad=pendulum.quadratic_drag_per_rad,
        coulomb_friction_rad_s2=pendulum.coulomb_friction_rad_s2,
        pivot_offset_m=scene.tool.pivot_offset_m,
        family=scene.tags.family,
        fps_hz=scene.video.fps_hz,
        header_fps_hz=scene.video.header_fps_hz or scene.video.fps_hz,
        move_s=film.poses.move_s,
        free_amplitude_m=float(np.max(sway[free], initial=0.0)),
        peak_angle_rad=float(np.max(np.abs(angle))),
        frame=film.frame.tolist(),
        time_s=film.time_s.tolist(),
        tcp_m=_pairs(film.poses.tcp_m[middle][:, [0, 2]]),
        pcp_m=_pairs(film.poses.pcp_m[middle][:, [0, 2]]),
        angle_rad=angle.tolist(),
        sideways_rad=film.poses.sideways_rad[middle].tolist(),
        tags={name: _true_tag(film, name, tag) for name, tag in carriers(scene)},
    )


def _true_tag(film: Film, name: TagName, tag: Tag) -> TrueTag:
    centres = np.array([pose_of(film, name, tag, i, 0.0).centre for i in range(len(film.time_s))])
    covers = [o for o in film.scene.occlusions if o.tag == name]
    return TrueTag(
        id=tag.id,
        size_mm=1e3 * tag.size_m,
        mm_per_px=1e3 * film.view.scale_m_per_px(centres[len(centres) // 2]),
        centre_px=_pairs(film.view.project(centres) + film.shake_px),
        hidden=[i for i, time in enumerate(film.time_s) if any(o.start_s <= time < o.end_s for o in covers)],
    )


def _pairs(points: FloatArray) -> Pairs:
    return [(float(x), float(y)) for x, y in points]
