"""Film a payload that carries two AprilTags, get a motion that leaves it at rest.

The way through, as functions on plain values; each step can be taken alone:

    measurement = tagsway.identify(Path("video.mp4"), tagsway.Settings(tcp_tag_size_m=0.04, pcp_tag_size_m=0.04))
    measurement.result.modal                                natural frequency and damping ratio, with their errors
    measurement.result.pendulum                             l, r, k, b, and what the video does not tell
    shaper = tagsway.design_shaper("zvd", mode)             impulses that leave the mode at rest
    tagsway.residual_vibration(shaper, another_mode)        and what they leave on another
    trajectory = tagsway.plan_move(tagsway.read_move(Path("move.toml")))
    tagsway.apply_shaper(trajectory, shaper, ("x",))        a trajectory is called: trajectory(time_s, order)
    tagsway.write_measurement(measurement, Path("out"))     JSON, CSV, figures and a page

and, to try all this without a robot, `tagsway.render_scene(tagsway.read_scene(...), ...)`. The types stand in
`tagsway.model`. Nothing heavy is imported before it is used.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "DesignMode": "model",
    "Mode": "model",
    "Settings": "model",
    "apply_shaper": "trajectories",
    "choose_shaper": "shapers",
    "clean_track": "filters",
    "compare_shapers": "shapers",
    "design_move": "design",
    "design_shaper": "shapers",
    "find_joints": "robots",
    "find_window": "modal",
    "fit_pendulum": "pendulum",
    "fit_random_effects": "repeats",
    "identify": "pipeline",
    "identify_modes": "modal",
    "plan_joints": "robots",
    "plan_move": "trajectories",
    "read_move": "store.moves",
    "read_result": "store.documents",
    "read_scene": "scene",
    "read_shaper": "store.documents",
    "read_track": "store.tracks",
    "render_scene": "scene",
    "residual_vibration": "shapers",
    "retune_shaper": "design",
    "sample_trajectory": "trajectories",
    "simulate_moves": "simulation",
    "simulate_sway": "dynamics",
    "study_limits": "studies",
    "summarise_repeats": "repeats",
    "vary_modes": "simulation",
    "write_measurement": "pipeline",
    "write_shaper": "store.documents",
}
"""Where each public name lives."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"tagsway.{_HOME[name]}"), name)
    raise AttributeError(f"module 'tagsway' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__", "model"]
