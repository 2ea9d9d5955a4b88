"""Calibration boards: where their corners are on them, and in an image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import Detection, FloatArray, GreyArray, IntArray

Pattern = Literal["chessboard", "charuco", "aprilgrid"]

CHARUCO_DICTIONARIES = {
    "tag16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "tag25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "tag36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "aruco4x4": cv2.aruco.DICT_4X4_250,
    "aruco5x5": cv2.aruco.DICT_5X5_250,
    "aruco6x6": cv2.aruco.DICT_6X6_250,
}

SQUARE_M = (1e-5, 10.0)
"""From the smallest square to the largest: what lies beyond is another unit."""

LEAST_CORNERS = 8
"""Of a board that may be partly hidden: four give a homography, eight one that is checked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A printed board.

    Parameters
    ----------
    pattern : {"chessboard", "charuco", "aprilgrid"}
        What is on it.
    columns, rows : int
        Squares of a chessboard or ChArUco board, tags of an AprilGrid.
    square_m : float
        Side of a square; of an AprilGrid from a tag to the next, its gap included.
    marker_m : float or None
        Side of a marker's or tag's black square; a chessboard has none.
    family : str
        Of the markers: see `CHARUCO_DICTIONARIES`; an AprilGrid takes any family that `tagsway.tags` finds.
    """

    pattern: Pattern
    columns: int
    rows: int
    square_m: float
    marker_m: float | None = None
    family: str = "tag36h11"

    def __post_init__(self) -> None:
        if self.pattern not in get_args(Pattern):
            raise InputError(f"--pattern is {self.pattern!r}: expected one of {', '.join(get_args(Pattern))}")
        least = 1 if self.pattern == "aprilgrid" else 3
        if not (self.columns >= least and self.rows >= least):
            raise InputError(f"a {self.pattern} of {self.columns} × {self.rows}: expected at least {least} of each")
        low, high = SQUARE_M
        if not low <= self.square_m <= high:
            extent = f"from {1000 * low:g} to {1000 * high:g} mm"
            raise InputError(f"--square is {1000 * self.square_m:g} mm: expected a length {extent}")
        if self.pattern == "chessboard":
            return
        if self.marker_m is None or not 0 < self.marker_m < self.square_m:
            given = "missing" if self.marker_m is None else f"{1000 * self.marker_m:g} mm"
            raise InputError(f"--marker is {given}: expected a length below --square, {1000 * self.square_m:g} mm")
        if self.pattern == "charuco" and self.family not in CHARUCO_DICTIONARIES:
            raise InputError(f"--family is {self.family!r}: expected one of {', '.join(CHARUCO_DICTIONARIES)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardView:
    """A board in one image.

    Parameters
    ----------
    on_board_m : ndarray, shape (n, 2)
        Its corners that were found, on the board.
    corners_px : ndarray, shape (n, 2)
        The same in the image; (0, 0) is the centre of the first pixel.
    sharpness : float
        How steep the corners' surroundings are; only to be compared within a video.
    """

    on_board_m: FloatArray
    corners_px: FloatArray
    sharpness: float


def find_board(grey: GreyArray, board: Board) -> BoardView | None:
    """Return the chessboard or the ChArUco board in an image, None where it is not found.

    For an AprilGrid find the tags and use `place_tags`.
    """
    if board.pattern == "chessboard":
        size = (board.columns - 1, board.rows - 1)
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        numbers = np.arange(size[0] * size[1])
        return _view(grey, board, numbers, corners) if found else None
    corners, numbers = _charuco_detector(board).detectBoard(grey)[:2]
    return None if numbers is None else _view(grey, board, np.ravel(numbers).astype(np.int64), corners)


def place_tags(grey: GreyArray, detections: Sequence[Detection], board: Board) -> BoardView | None:
    """Return an AprilGrid from the tags that were found, None where they are too few.

    Ids count from 0 at the lower left, to the right, then upwards, as Kalibr lays them out; but the tags are the
    family's own, not those with a border of two cells.
    """
    own = [tag for tag in detections if tag.tag_id < board.columns * board.rows]
    once = [tag for tag in own if sum(other.tag_id == tag.tag_id for other in own) == 1]
    if 4 * len(once) < LEAST_CORNERS or board.marker_m is None:
        return None
    square = board.marker_m * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = [square + board.square_m * np.array([t.tag_id % board.columns, t.tag_id // board.columns]) for t in once]
    corners = np.concatenate([tag.corners_px for tag in once])
    # y down, as the other boards: a board is then seen from its front.
    on_board = np.concatenate(places) * np.array([1.0, -1.0])
    return BoardView(on_board_m=on_board, corners_px=corners, sharpness=_sharpness(grey, corners))


def _charuco_detector(board: Board) -> Any:
    dictionary = cv2.aruco.getPredefinedDictionary(CHARUCO_DICTIONARIES[board.family])
    size = (board.columns, board.rows)
    return cv2.aruco.CharucoDetector(
        cv2.aruco.CharucoBoard(size, board.square_m, float(board.marker_m or 0), dictionary)
    )


def _view(grey: GreyArray, board: Board, numbers: IntArray, corners: Any) -> BoardView | None:
    if len(numbers) < LEAST_CORNERS:
        return None
    inner = board.columns - 1
    on_board = board.square_m * np.column_stack([numbers % inner, numbers // inner]).astype(float)
    corners_px = np.reshape(corners, (-1, 2)).astype(float)
    return BoardView(on_board_m=on_board, corners_px=corners_px, sharpness=_sharpness(grey, corners_px))


def _sharpness(grey: GreyArray, corners_px: FloatArray) -> float:
    (left, top), (right, bottom) = corners_px.min(axis=0).astype(int), corners_px.max(axis=0).astype(int) + 1
    part = grey[max(top, 0) : bottom, max(left, 0) : right]
    contrast = float(part.std()) if part.size else 0.0
    return float(cv2.Laplacian(part, cv2.CV_64F).std()) / contrast if contrast > 0 else 0.0
