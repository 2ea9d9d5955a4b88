"""Small simulated scenes for the tests of other rooms: quick to render, with known truth."""

from dataclasses import replace
from typing import Any

from tagsway.model import Move
from tagsway.scene.model import Payload, Scene, SecondBody, Tag, Tags, Tool
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat


def small_scene(**changes: Any) -> Scene:
    """A flexible payload after a short move: 640 x 360, 2.6 s at 200 fps, a decay of 10 mm for 1.5 s.

    `changes` replace whole fields of the scene, as ``small_scene(duration_s=1.0, picture=Picture(noise_grey=3.0))``.
    """
    scene = Scene(
        duration_s=2.6,
        seed=1,
        payload=Payload(length_m=0.04585, stiffness_n_m_per_rad=0.0129717645, damping_ratio=0.02),
        tool=Tool(start_s=0.1),
        move=Move(
            from_m=(-0.14, 0.0, 0.0),
            to_m=(0.14, 0.0, 0.0),
            pick_height_m=0.02,
            place_height_m=0.02,
            max_acceleration_m_s2=2.75,
        ),
        tags=Tags(tcp=Tag(id=0, size_m=0.03), pcp=Tag(id=1, size_m=0.03)),
        camera=SceneCamera(width=640, height=360, distance_m=1.5, focal_px=2200.0),
        picture=Picture(exposure_s=0.001, noise_grey=1.0, supersampling=2),
        video=VideoFormat(fps_hz=200.0, quality=14.0),
    )
    return replace(scene, **changes)


def released_scene(**changes: Any) -> Scene:
    """The same payload, let go by hand at 0.5 rad from a tool at rest."""
    payload = replace(small_scene().payload, release_angle_rad=0.5)
    camera = SceneCamera(width=320, height=320, distance_m=1.5, focal_px=2200.0)
    return small_scene(**{"payload": payload, "move": None, "camera": camera} | changes)


def unmodelled_scene(**changes: Any) -> Scene:
    """The small scene with what a fit does not know: a second body, drag, and a sway out of the plane."""
    payload = replace(small_scene().payload, quadratic_drag_per_rad=0.05, sideways_angle_rad=0.06)
    second = SecondBody(hinge_m=0.06, length_m=0.02, mass_kg=0.004, damping_n_m_s_per_rad=5e-6)
    return small_scene(**{"payload": payload, "second_body": second} | changes)
