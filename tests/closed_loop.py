"""Film, identify, design, film the designed move, identify again: what was promised, and what a second video saw."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenes import unmodelled_scene
from tagsway.cli.app import run
from tagsway.model import Settings
from tagsway.pipeline import identify
from tagsway.scene import Scene, render_scene
from tagsway.scene.model import Payload, Waypoints
from tagsway.scene.optics import SceneCamera, VideoFormat
from tagsway.scene.truth import Truth
from tagsway.store.documents import write_result
from tagsway.store.tracks import write_track

SETTINGS = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)
WINDOW_MM = 5.0
SPREAD_PERCENT = 3.0
HEADING = f"{'design':<14}{'time s':>7}{'share':>8}{'seen mm':>16}{'filmed':>8}{'true':>7}{'seen/window':>13}"
DECAY_S = 1.5

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
    """One turn: what was designed, and how far the product is off its place after the move, in mm.

    Parameters
    ----------
    chosen : dict
        From design.json: what was promised, and for which share of the payloads.
    seen_mm : float
        What `identify` says of the second film.
    stated_mm : float
        Standard error of the product's place there, as track.csv states it.
    filmed_mm : float
        What any camera without depth must say: the true images of the tag's centre, at its scale.
    true_mm : float
        What the product did.
    aside_mm : float
        By how much, at most, its sway towards the camera moves it aside in the pictures.
    """

    chosen: dict[str, Any]
    seen_mm: float
    stated_mm: float
    filmed_mm: float
    true_mm: float
    aside_mm: float

    @property
    def words(self) -> str:
        """All of it in one row under `HEADING`."""
        chosen = self.chosen
        name = f"{chosen['name']} {','.join(chosen['shaped_axes'])}"
        return (
            f"{name:<14}{chosen['motion_time_s']:>7.3f}{100 * chosen['share_kept']:>6.1f} %"
            f"{self.seen_mm:>8.3f} ± {self.stated_mm:.3f}{self.filmed_mm:>8.3f}{self.true_mm:>7.3f}"
            f"{self.seen_mm / WINDOW_MM:>13.2f}"
        )


def loop_scene(index: int) -> Scene:
    """A payload with drag, a second body and a sway out of the plane, none of which a design knows.

    Its tags are 20 px wide, its film 120 frames a second: a cheap camera.
    """
    rng = np.random.default_rng(100 + index)
    payload = Payload(
        length_m=float(rng.uniform(0.045, 0.055)),
        natural_frequency_hz=float(rng.uniform(2.4, 3.0)),
        damping_ratio=float(rng.uniform(0.02, 0.05)),
        quadratic_drag_per_rad=0.05,
        sideways_angle_rad=0.03,
    )
    camera = SceneCamera(width=320, height=144, distance_m=1.5, focal_px=1000.0)
    video = VideoFormat(fps_hz=120.0, quality=14.0)
    return unmodelled_scene(payload=payload, camera=camera, video=video, seed=index + 1)


def close_loop(scene: Scene, folder: Path, *, kinds: tuple[str, ...] = ("zv", "zvd", "ei")) -> Loop:
    """Film a move, identify, design by the command that a user gives, film what it wrote, and identify again."""
    film(scene, folder / "first")
    design_for(["--from", str(folder / "first" / "result.json")], folder, kinds=kinds)
    return film_design(scene, folder)


def design_for(payload: list[str], folder: Path, *, kinds: tuple[str, ...]) -> None:
    """Run `identify design` for a payload, as its options tell it, into the folder's own `design`."""
    (folder / "move.toml").write_text(MOVE, encoding="utf-8")
    move = ["--move", str(folder / "move.toml"), "--frequency-spread", str(SPREAD_PERCENT)]
    types = [word for kind in kinds for word in ("--type", kind)]
    quick = ["--no-optimise", "--no-figure"]
    assert run(["design", *payload, *move, *types, *quick, "--out", str(folder / "design")]) == 0


def film_design(scene: Scene, folder: Path) -> Loop:
    """Film the trajectory that a design wrote, identify it, and hold it against what was promised."""
    chosen = json.loads((folder / "design" / "design.json").read_text(encoding="utf-8"))["chosen"]
    second = folder / "second"
    truth = film(with_trajectory(scene, folder / "design")[0], second)
    result = json.loads((second / "result.json").read_text(encoding="utf-8"))
    track = np.genfromtxt(second / "track.csv", delimiter=",", names=True)
    filmed_mm, true_mm, aside_mm = place_errors_mm(truth, scene.camera)
    return Loop(
        chosen=chosen,
        seen_mm=result["indicators"]["place_error_mm"],
        stated_mm=float(np.nanmedian(track["pcp_x_std_mm"][track["time_s"] >= truth.move_s[1]])),
        filmed_mm=filmed_mm,
        true_mm=true_mm,
        aside_mm=aside_mm,
    )


def film(scene: Scene, folder: Path) -> Truth:
    """Render a scene and identify it; without pictures and page, which nothing here reads."""
    folder.mkdir(parents=True)
    truth = render_scene(scene, folder / "scene.mp4")
    measurement = identify(folder / "scene.mp4", SETTINGS)
    write_track(folder / "track.csv", measurement.track, measurement.clean)
    write_result(folder / "result.json", measurement.result)
    return truth


def with_trajectory(scene: Scene, design: Path) -> tuple[Scene, float]:
    """Return the scene under the controller's file, and when its tool stands."""
    rows = np.loadtxt(design / "trajectory.csv", delimiter=";")
    step = json.loads((design / "trajectory.json").read_text(encoding="utf-8"))["sample_time_s"]
    time = np.arange(len(rows)) * step
    path = Waypoints(time_s=tuple(time.tolist()), x_m=tuple(rows[:, 1].tolist()), z_m=tuple(rows[:, 3].tolist()))
    end = scene.tool.start_s + float(time[-1])
    return replace(scene, move=None, trajectory=path, duration_s=end + DECAY_S), end


def place_errors_mm(truth: Truth, camera: SceneCamera) -> tuple[float, float, float]:
    """Return how far the product is off its place once the tool stands, in the pictures and in truth, and `aside_mm`.

    The tool's tag hangs right above that place, and in the plane whose scale is known. A product that is nearer to the
    camera by y is seen farther from the picture's middle than it is, by y over the distance.
    """
    after = np.array(truth.time_s) >= truth.move_s[1]
    tool, product = (np.array(truth.tags[name].centre_px)[after, 0] for name in ("tcp", "pcp"))
    scale = truth.tags["tcp"].mm_per_px
    filmed = scale * np.abs(product - tool)
    true = 1e3 * np.abs(np.array(truth.pcp_m)[after, 0] - np.array(truth.tcp_m)[after, 0])
    nearer = truth.tag_radius_m * np.abs(np.array(truth.sideways_rad)[after]) / camera.distance_m
    aside = scale * np.abs(product - (camera.width - 1) / 2) * nearer
    return float(filmed.max()), float(true.max()), float(aside.max())


def from_rest(sway: np.ndarray) -> np.ndarray:
    """Return a sway from its mean under a bell-shaped weight, which broken swings do not move."""
    weight = np.sin(np.pi * np.linspace(0, 1, len(sway))) ** 2
    return sway - weight @ sway / weight.sum()
