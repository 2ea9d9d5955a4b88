"""The lens from boards: OpenCV's calibration, with its errors, and what speaks against it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from tagsway.camera.boards import BoardView
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Camera, Estimate, FloatArray, Notice

LEAST_BOARDS = 5
MOST_BOARDS = 40
"""More take long and tell little."""

LEAST_TILT = 0.12
"""Sine of the angle between boards: boards that are all parallel do not tell the focal length from the distance."""

GRID = 5
LEAST_COVERAGE = 0.6
"""Share of a 5 × 5 grid over the image that must hold a corner."""

WORST_FOCAL = 0.02
"""Standard error of the focal length, as a share, above which nothing was calibrated."""

WORST_RMS_PX = 1.0
"""Corners are found to a tenth of a pixel."""

SAME_VIEW = 0.02
"""Of the image's width that some corner of the board's outline must have moved by."""

BLURRED = 0.5
"""Of the median sharpness, below which a board is left out."""

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibrated lens.

    Parameters
    ----------
    camera : Camera
        The lens.
    parameters : dict of str to Estimate
        fx, fy, cx, cy, k1, k2, p1, p2, k3 with their standard errors.
    rms_px : float
        Of the corners' distance from where the model has them.
    boards : int
        How many were used.
    coverage : float
        Share of a 5 × 5 grid over the image that holds a corner.
    notices : tuple of Notice
        What speaks against it.
    """

    camera: Camera
    parameters: dict[str, Estimate]
    rms_px: float
    boards: int
    coverage: float
    notices: tuple[Notice, ...]


def calibrate_lens(views: Sequence[BoardView], *, width: int, height: int) -> Calibration:
    """Calibrate a lens from images of one board.

    Parameters
    ----------
    views : sequence of BoardView
        At least 5, of boards that stand at different angles; of more than 40, a spread is used.
    width, height : int
        Of the images, in pixels.

    Returns
    -------
    Calibration
        Square pixels are not assumed. The error of a parameter is OpenCV's, from the residuals.

    Raises
    ------
    NotIdentifiableError
        Where the boards are too few, too much alike, or leave the focal length open.

    References
    ----------
    .. [1] Z. Zhang, IEEE Trans. Pattern Anal. Mach. Intell. 22 (2000) 1330-1334.
    """
    chosen = choose_boards(views, width=width, height=height)
    if len(chosen) < LEAST_BOARDS:
        raise NotIdentifiableError(
            f"{len(chosen)} different sharp views of the board: expected at least {LEAST_BOARDS}; film it slowly, at "
            "different angles and in all parts of the image"
        )
    points = [np.column_stack([v.on_board_m, np.zeros(len(v.on_board_m))]).astype(np.float32) for v in chosen]
    corners = [view.corners_px.astype(np.float32)[:, None] for view in chosen]
    try:
        rms, matrix, lens, turns, _, stds, *_ = cv2.calibrateCameraExtended(
            points, corners, (width, height), np.eye(3), np.zeros(5)
        )
    except cv2.error as error:
        raise NotIdentifiableError(f"the boards do not determine a camera ({error.err}); film more of them") from None
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *np.ravel(lens)[:5]]
    errors = np.ravel(stds)[: len(values)]
    if not np.isfinite([*values, *errors]).all():
        raise NotIdentifiableError("the boards do not determine a camera; film more of them, at different angles")
    parameters = {name: Estimate.normal(v, s) for name, v, s in zip(PARAMETERS, values, errors, strict=True)}
    _refuse_parallel(turns, parameters["fx"])
    fx, fy, cx, cy, *distortion = (float(value) for value in values)
    try:
        camera = Camera(
            width=width,
            height=height,
            fx=fx,
            fy=fy,
            cx=cx,
            cy=cy,
            distortion=(*distortion,),  # type: ignore[arg-type]
        )
    except InputError as error:
        raise NotIdentifiableError(f"the boards do not determine a camera: {error}; film more of them") from None
    coverage = measure_coverage(chosen, width=width, height=height)
    return Calibration(
        camera=camera,
        parameters=parameters,
        rms_px=float(rms),
        boards=len(chosen),
        coverage=coverage,
        notices=_judge(float(rms), coverage),
    )


def choose_boards(views: Sequence[BoardView], *, width: int, height: int) -> list[BoardView]:
    """Return at most 40 sharp views that differ: those farthest from the ones already chosen.

    Views closer than 2 % of the image's width to another, in every part of the board, count as the same.
    """
    if not views:
        return []
    sharp = np.array([view.sharpness for view in views])
    kept = [view for view, value in zip(views, sharp, strict=True) if value >= BLURRED * np.median(sharp)]
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    ends = np.max([view.on_board_m.max(axis=0) for view in kept], axis=0)
    starts = np.min([view.on_board_m.min(axis=0) for view in kept], axis=0)
    outline = starts + box * (ends - starts)
    where = np.array([_show_outline(view, outline) for view in kept]) / width
    nearest, chosen = np.full(len(kept), np.inf), [int(np.argmax([v.sharpness for v in kept]))]
    while len(chosen) < min(MOST_BOARDS, len(kept)):
        nearest = np.minimum(nearest, np.abs(where - where[chosen[-1]]).max(axis=(1, 2)))
        if not nearest.max() > SAME_VIEW:
            break
        chosen.append(int(np.argmax(nearest)))
    return [kept[index] for index in sorted(chosen)]


def measure_coverage(views: Sequence[BoardView], *, width: int, height: int) -> float:
    """Return the share of a 5 × 5 grid over the image that holds a corner of some board."""
    corners = np.concatenate([view.corners_px for view in views])
    cells = np.clip((corners / np.array([width, height]) * GRID).astype(int), 0, GRID - 1)
    return len(np.unique(cells, axis=0)) / GRID**2


def _show_outline(view: BoardView, outline_m: FloatArray) -> FloatArray:
    """Return where the whole board's outline is in the image, shape (4, 2), also where only a part was seen."""
    matrix, _ = cv2.findHomography(view.on_board_m, view.corners_px)
    if np.size(matrix) != 9:  # corners in a line
        return np.tile(view.corners_px.mean(axis=0), (4, 1))
    return np.asarray(cv2.perspectiveTransform(outline_m[:, None], matrix)[:, 0])


def _refuse_parallel(turns: Sequence[Any], focal: Estimate) -> None:
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    spread = float(np.sqrt(np.mean(np.sum((normals - normals.mean(axis=0)) ** 2, axis=1))))
    if not (spread >= LEAST_TILT and focal.std <= WORST_FOCAL * focal.value):
        share = 100 * focal.std / focal.value
        raise NotIdentifiableError(
            f"the boards stand at angles that differ by {np.degrees(spread):.0f} degrees (rms), which leaves the focal "
            f"length open to ±{share:.1f} %: tilt the board by 20 to 40 degrees to all sides"
        )


def _judge(rms_px: float, coverage: float) -> tuple[Notice, ...]:
    notices = []
    if coverage < LEAST_COVERAGE:
        message = f"boards cover {100 * coverage:.0f} % of the image: the lens is guessed elsewhere; film its edges too"
        notices.append(Notice(code="poor_coverage", message=message))
    if rms_px > WORST_RMS_PX:
        message = (
            f"corners miss the model by {rms_px:.2f} px rms: a bent board, blurred images, or another kind of lens"
        )
        notices.append(Notice(code="poor_fit", message=message))
    return tuple(notices)
