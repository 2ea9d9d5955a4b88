"""`identify render SCENE.toml`: a video with known truth."""

from pathlib import Path
from typing import Annotated

import typer

from tagsway.cli.progress import progress_bar


def render(
    scene: Annotated[Path, typer.Argument(help="The scene, as TOML.", metavar="SCENE.toml")],
    out: Annotated[Path | None, typer.Option(help="The video.", show_default="SCENE.mp4 beside the scene")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Render a simulated scene to a video, with its truth in a JSON beside it."""
    from tagsway.scene import read_scene, render_scene

    video = out if out is not None else scene.with_suffix(".mp4")
    with progress_bar(video.name, shown=not quiet) as progress:
        render_scene(read_scene(scene), video, progress=progress)
    if not quiet:
        typer.echo(f"written to {video}, truth in {video.with_suffix('.truth.json')}")
