"""A simulated scene: a pendulum under a move, seen by a camera, as a video with known truth."""

from tagsway.scene.model import Scene
from tagsway.scene.motion import Motion, simulate_scene
from tagsway.scene.read import read_scene
from tagsway.scene.render import render_frames
from tagsway.scene.truth import Truth
from tagsway.scene.write import read_truth, render_scene, truth_path

__all__ = [
    "Motion",
    "Scene",
    "Truth",
    "read_scene",
    "read_truth",
    "render_frames",
    "render_scene",
    "simulate_scene",
    "truth_path",
]
