"""A scene as a video file with its truth beside it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from tagsway.errors import InputError
from tagsway.files import write_text
from tagsway.model import GreyArray, Progress
from tagsway.scene.model import Scene
from tagsway.scene.render import expose_film, plan_film
from tagsway.scene.truth import Truth, describe_film
from tagsway.video.writing import write_video


def render_scene(
    scene: Scene, video_path: Path, *, rng: np.random.Generator | None = None, progress: Progress | None = None
) -> Truth:
    """Render a scene to a video and write its truth to ``STEM.truth.json`` beside it.

    Parameters
    ----------
    scene : Scene
        From `tagsway.scene.read_scene`.
    video_path : Path
        The video; the codec must fit its suffix (.mp4 holds all but "raw").
    rng : Generator, optional
        Of all that is random; by default one begun with the scene's seed.
    progress : callable, optional
        Called after each frame with the number done and the number of all.

    Returns
    -------
    Truth
        What was written beside the video.

    Raises
    ------
    InputError
        Where the video cannot be written. Each file is written whole or not at all.
    """
    video_path = Path(video_path)
    film, video = plan_film(scene, rng=rng), scene.video
    truth = describe_film(film)
    header = video.header_fps_hz or video.fps_hz
    uniform = video.time_jitter_s == 0 and len(film.frame) == film.frame[-1] + 1
    write_video(
        video_path,
        _report(expose_film(film), len(film.frame), progress),
        fps_hz=header,
        time_s=None if uniform else film.time_s * (video.fps_hz / header),
        time_rounding_s=video.time_rounding_s,
        codec=video.codec,
        quality=video.quality,
        full_range=video.full_range,
    )
    _write_truth(truth, truth_path(video_path))
    return truth


def truth_path(video_path: Path) -> Path:
    """Return where the truth of a video lies."""
    return video_path.with_name(video_path.stem + ".truth.json")


def read_truth(path: Path) -> Truth:
    """Read the truth that `render_scene` wrote."""
    try:
        return TypeAdapter(Truth).validate_json(Path(path).read_bytes())
    except (OSError, ValidationError) as error:
        raise InputError(f"{path}: cannot be read as the truth of a scene ({type(error).__name__})") from None


def _report(frames: Iterator[GreyArray], total: int, progress: Progress | None) -> Iterator[GreyArray]:
    for done, image in enumerate(frames, start=1):
        yield image
        if progress is not None:
            progress(done, total)


def _write_truth(truth: Truth, path: Path) -> None:
    try:
        write_text(path, TypeAdapter(Truth).dump_json(truth).decode() + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
