"""Sets of small rendered videos with known truth: grippers, directions, a factor, outliers and broken files."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagsway.model import GRAVITY_M_S2
from tagsway.scene import Scene, render_scene, truth_path
from tagsway.scene.model import Payload, Tag, Tags, Tool
from tagsway.scene.optics import Picture, SceneCamera, VideoFormat

SETS = {"set1": "varied", "set2": "held"}
WIDER = 1.5
"""How much wider the spread of the first set is than that of the second: the pick position's part of the variance is
1 - 1 / 1.5²."""

SHIFT = 0.02
"""Of f_n, relatively, by a vacuum of 650 mbar instead of 550: a third of the repeats have it."""


@dataclass(frozen=True)
class Subset:
    """A gripper and an axis of motion: median f_n, damping, and how much f_n spreads between repeats."""

    name: str
    gripper: str
    direction: str
    frequency_hz: float
    damping_ratio: float
    spread: float


SUBSETS = (
    Subset("flexible-x", "flexible", "x", 2.47, 0.020, 0.020),
    Subset("flexible-z", "flexible", "z", 2.60, 0.020, 0.020),
    Subset("medium-x", "medium", "x", 3.10, 0.015, 0.012),
    Subset("medium-z", "medium", "z", 3.23, 0.015, 0.012),
    Subset("stiff-x", "stiff", "x", 3.90, 0.010, 0.006),
    Subset("stiff-z", "stiff", "z", 4.03, 0.010, 0.006),
)
OUTLIERS = {"set1/medium-x/r03.mp4": 1.25, "set1/stiff-z/r02.mp4": 0.85, "set2/flexible-x/r04.mp4": 1.3}
"""Factor on f_n."""

BROKEN_FILES = {
    "set1/flexible-x/r01.mp4": "empty",
    "set1/stiff-x/r00.mp4": "noise",
    "set2/flexible-z/r02.mp4": "cut",
    "set2/medium-z/r01.mp4": "no tag",
    "set2/stiff-z/r00.mp4": "text",
}
"""What is wrong with each."""


@dataclass(frozen=True)
class Film:
    """One video of the set, and what was rendered into it."""

    name: str
    set: str
    subset: Subset
    vacuum_mbar: int
    frequency_hz: float
    damping_ratio: float
    fault: str
    seed: int


def plan_films(
    repeats: int,
    *,
    subsets: Sequence[Subset] = SUBSETS,
    broken: Mapping[str, str] = BROKEN_FILES,
    outliers: Mapping[str, float] = OUTLIERS,
) -> list[Film]:
    """Return the set's films with their truth, drawn once and for all."""
    rng, films = np.random.default_rng(7), []
    for whole in SETS:
        wide = WIDER if SETS[whole] == "varied" else 1.0
        for subset in subsets:
            for number in range(repeats):
                name = f"{whole}/{subset.name}/r{number:02d}.mp4"
                vacuum = 650 if number % 3 == 0 else 550
                relative = 1 + wide * subset.spread * float(np.clip(rng.normal(), -2, 2))
                relative *= outliers.get(name, 1.0) * (1 + SHIFT if vacuum == 650 else 1.0)
                damping = subset.damping_ratio * float(np.exp(0.1 * np.clip(rng.normal(), -2, 2)))
                frequency, fault = subset.frequency_hz * relative, broken.get(name, "")
                films.append(Film(name, whole, subset, vacuum, frequency, damping, fault, len(films)))
    return films


def render_film(task: tuple[Film, Path]) -> None:
    """Render a film of 1.6 s: a payload pulled aside by hand and let go, 100 frames per second, 192 × 224 pixels."""
    film, root = task
    path, kind = root / film.name, film.fault
    path.parent.mkdir(parents=True, exist_ok=True)
    length = 0.9 * GRAVITY_M_S2 / (2 * np.pi * film.subset.frequency_hz) ** 2
    tags = Tags(tcp=Tag(id=0, size_m=0.03), pcp=Tag(id=1, size_m=0.03))
    if kind == "no tag":
        tags = Tags(tcp=Tag(id=0, size_m=0.03), pcp=None)
    scene = Scene(
        duration_s=1.6,
        seed=film.seed,
        payload=Payload(
            length_m=length,
            tag_radius_m=0.05,
            natural_frequency_hz=film.frequency_hz,
            damping_ratio=film.damping_ratio,
            release_angle_rad=0.25,
        ),
        tool=Tool(start_s=0.1),
        tags=tags,
        camera=SceneCamera(width=192, height=224, distance_m=1.5, focal_px=1600.0),
        picture=Picture(exposure_s=0.001, noise_grey=1.0, supersampling=2),
        video=VideoFormat(fps_hz=100.0, quality=12.0),
    )
    render_scene(scene, path)
    truth_path(path).unlink()
    whole = path.read_bytes()
    if kind == "empty":
        path.write_bytes(b"")
    elif kind == "noise":
        path.write_bytes(np.random.default_rng(film.seed).bytes(len(whole)))
    elif kind == "cut":
        path.write_bytes(whole[: len(whole) // 3])
    elif kind == "text":
        path.write_text("this is no video\n")


def write_manifest(root: Path, films: Sequence[Film]) -> None:
    """Say of each film what was varied."""
    lines = ["file,subset,set,gripper,direction,pick_position,vacuum_mbar,tag_size"]
    for film in films:
        factors = (film.set, film.subset.gripper, film.subset.direction, SETS[film.set], str(film.vacuum_mbar))
        lines.append(",".join((film.name, film.subset.name, *factors, "30")))
    (root / "set.csv").write_text("\n".join(lines) + "\n")


def render_set(root: Path, films: Sequence[Film]) -> None:
    """Render the films of a set, with a process a core, and write its manifest."""
    with ProcessPoolExecutor() as pool:
        list(pool.map(render_film, [(film, root) for film in films]))
    write_manifest(root, films)
