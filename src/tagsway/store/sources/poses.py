"""DeepLabCut's tables, which movement, SLEAP's converters and others write as well."""

from pathlib import Path

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray, Notice
from tagsway.store.sources.build import TrackSource, make_tag, make_track
from tagsway.store.sources.columns import NOTICES, PRODUCT, TOOL
from tagsway.store.sources.grid import Grid

LEAST_LIKELIHOOD = 0.6
"""Below this a point was not seen: DeepLabCut's own p-cutoff."""


def is_pose_table(grid: Grid) -> bool:
    """Say whether a table has DeepLabCut's header rows: scorer, (individuals,) bodyparts, coords."""
    firsts = [row[0].lower() for row in grid.head if row]
    return "bodyparts" in firsts and "coords" in firsts


def read_poses(grid: Grid, path: Path, *, fps_hz: float | None) -> TrackSource:
    """Return the track of the points that are called TCP and PCP (tool, product), or of the only point.

    Raises
    ------
    InputError
        Without a frame rate, and where it is not clear which point is the product.
    """
    if fps_hz is None:
        raise InputError(f"{path} is DeepLabCut's table of frames and has no times: say --fps, the capture rate")
    frame = grid.values[:, 0]
    index = np.arange(len(frame)) if np.isnan(frame).any() else frame.astype(np.int64)
    return pick_points(
        _points(grid), index, index / fps_hz, path=path, program="DeepLabCut", first_line=grid.first_line
    )


def pick_points(
    points: dict[str, FloatArray],
    frame: IntArray,
    time_s: FloatArray,
    *,
    path: Path,
    program: str,
    first_line: int = 2,
) -> TrackSource:
    """Return the track of the points that are the tool's and the product's.

    Parameters
    ----------
    points : dict of ndarray, shape (n, 2)
        x and z of each in pixels, z upwards; NaN where it was not seen.
    frame : ndarray of int, shape (n,)
    time_s : ndarray, shape (n,)
    path, program, first_line
        Where they come from.

    Raises
    ------
    InputError
        Where it is not clear which point is the product.
    """
    tool = next((name for name in points if TOOL.search(name)), None)
    rest = [name for name in points if name != tool]
    product = next((name for name in rest if PRODUCT.search(name)), rest[0] if len(rest) == 1 else None)
    if product is None:
        raise InputError(
            f"{path}: which point is the product? It has {', '.join(points)}; call it pcp (and the tool tcp), or keep "
            "one point alone"
        )
    tags = {"pcp": make_tag(points[product])} | ({} if tool is None else {"tcp": make_tag(points[tool])})
    track = make_track(frame, time_s, "px", tags, path=path, first_line=first_line)
    lost = int(np.count_nonzero(~np.isfinite(points[product][:, 0])))
    notices = [NOTICES["px"]]
    if lost:
        message = f"{product} was seen with a likelihood below {LEAST_LIKELIHOOD:g}, or not at all, in {lost} frames"
        notices.append(Notice(code="points_not_seen", message=message))
    return TrackSource(track=track, program=program, notices=tuple(notices))


def _points(grid: Grid) -> dict[str, FloatArray]:
    """Return x and z of each point in pixels, z upwards; NaN where it is unlikely."""
    rows = {row[0].lower(): row for row in grid.head if row}
    parts, kinds = rows["bodyparts"], [kind.lower() for kind in rows["coords"]]
    owners = rows.get("individuals", ("",) * len(parts))
    several = len(set(owners[1:])) > 1
    points: dict[str, FloatArray] = {}
    for place, (owner, part, kind) in enumerate(zip(owners, parts, kinds, strict=True)):
        name = f"{owner} {part}" if several else part
        if kind == "x" and place + 1 < len(kinds) and kinds[place + 1] == "y":
            points[name] = grid.values[:, place : place + 2] * [1.0, -1.0]
        elif kind == "likelihood" and name in points:
            points[name][~(grid.values[:, place] >= LEAST_LIKELIHOOD)] = np.nan
    return points
