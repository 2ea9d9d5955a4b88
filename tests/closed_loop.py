"""Film, identify, design, film the designed move, identify again: what was promised, and what a second video saw."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenes import unmodelled_scene
from tagsway.cli.app import run
from tagsway.model import Settings
from tagsway.pipeline import identify, write_measurement
from tagsway.scene import Scene, render_scene, simulate_scene
from tagsway.scene.model import Payload, Waypoints
from tagsway.scene.optics import SceneCamera

SETTINGS = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)
WINDOW_MM = 5.0
SPREAD_PERCENT = 3.0
DECAY_S = 1.0

MOVE = f"""schema = "tagsway/move/1"
from_m = [-0.14, 0.0, 0.0]
to_m = [0.14, 0.0, 0.0]
max_acceleration_m_s2 = 5.0
pick_height_m = 0.02
place_height_m = 0.02
shaped_axes = ["x"]
sample_time_ms = 2.0
[limits]
acceleration_m_s2 = 12.0
placement_window_mm = {WINDOW_MM}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """One turn: what was designed, residuals in mm, and where its files lie."""

    promised_mm: float
    chosen: dict[str, Any]
    seen_mm: float
    true_mm: float
    noise_mm: float
    folder: Path


def loop_scene(index: int) -> Scene:
    """A payload with drag, a second body and a sway out of the plane, none of which a design knows."""
    rng = np.random.default_rng(100 + index)
    payload = Payload(
        length_m=float(rng.uniform(0.045, 0.055)),
        natural_frequency_hz=float(rng.uniform(2.4, 3.0)),
        damping_ratio=float(rng.uniform(0.02, 0.05)),
        quadratic_drag_per_rad=0.05,
        sideways_angle_rad=0.03,
    )
    camera = SceneCamera(width=512, height=224, distance_m=1.5, focal_px=1750.0)
    return unmodelled_scene(payload=payload, camera=camera, seed=index + 1)


def close_loop(scene: Scene, folder: Path, *, kinds: tuple[str, ...] = ("zv", "zvd", "ei")) -> Loop:
    """Run the loop once, by the commands that a user gives."""
    first, second = folder / "first", folder / "second"
    film(scene, first)
    (folder / "move.toml").write_text(MOVE, encoding="utf-8")
    types = [word for kind in kinds for word in ("--type", kind)]
    options = ["--frequency-spread", str(SPREAD_PERCENT), "--no-optimise", "--out", str(folder / "design"), *types]
    code = run(["design", "--from", str(first / "result.json"), "--move", str(folder / "move.toml"), *options])
    assert code == 0
    chosen = json.loads((folder / "design" / "design.json").read_text(encoding="utf-8"))["chosen"]
    shaped, end = with_trajectory(scene, folder / "design")
    film(shaped, second)
    true = simulate_scene(shaped, np.arange(end, shaped.duration_s, 2e-3))
    sway = from_rest(1e3 * (true.pcp_m[:, 0] - true.tcp_m[:, 0]))
    seen, noise = residual_mm(second / "track.csv", end)
    return Loop(
        promised_mm=WINDOW_MM,
        chosen=chosen,
        seen_mm=seen,
        true_mm=float(np.abs(sway).max()),
        noise_mm=noise,
        folder=folder,
    )


def film(scene: Scene, folder: Path) -> None:
    """Render a scene and identify it."""
    folder.mkdir(parents=True)
    render_scene(scene, folder / "scene.mp4")
    write_measurement(identify(folder / "scene.mp4", SETTINGS), folder)


def with_trajectory(scene: Scene, design: Path) -> tuple[Scene, float]:
    """Return the scene under the controller's file, and when its tool stands."""
    rows = np.loadtxt(design / "trajectory.csv", delimiter=";")
    step = json.loads((design / "trajectory.json").read_text(encoding="utf-8"))["sample_time_s"]
    time = np.arange(len(rows)) * step
    path = Waypoints(time_s=tuple(time.tolist()), x_m=tuple(rows[:, 1].tolist()), z_m=tuple(rows[:, 3].tolist()))
    end = scene.tool.start_s + float(time[-1])
    return replace(scene, move=None, trajectory=path, duration_s=end + DECAY_S), end


def residual_mm(track: Path, end_s: float) -> tuple[float, float]:
    """Return the largest sway after the end, from its mean over whole swings, and the noise of a sample."""
    table = np.genfromtxt(track, delimiter=",", names=True)
    after = table["time_s"] >= end_s
    sway = (table["pcp_x_mm"] - table["tcp_x_mm"])[after]
    sway = sway[np.isfinite(sway)]
    noise = float(np.median(np.abs(np.diff(sway, 2))) / 0.6745 / np.sqrt(6))
    return float(np.abs(from_rest(sway)).max()), noise


def from_rest(sway: np.ndarray) -> np.ndarray:
    """Return a sway from its mean under a bell-shaped weight, which broken swings do not move."""
    weight = np.sin(np.pi * np.linspace(0, 1, len(sway))) ** 2
    return sway - weight @ sway / weight.sum()
