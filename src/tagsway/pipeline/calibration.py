"""From a video or images of a board to a calibrated lens."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2

from tagsway.camera.boards import Board, BoardView, find_board, place_tags
from tagsway.camera.calibration import Calibration, calibrate_lens
from tagsway.errors import InputError
from tagsway.model import GreyArray, Progress
from tagsway.tags.find import find_tags
from tagsway.video.reading import read_clock, read_frames

MOST_LOOKS = 150
"""Frames of a video that are searched for the board, evenly over it."""

IMAGES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm"})


def calibrate_camera(files: Sequence[Path], board: Board, *, progress: Progress | None = None) -> Calibration:
    """Calibrate the lens from a video of a board that is moved before it, or from images.

    Parameters
    ----------
    files : sequence of Path
        One video, or images (a name may hold `*`).
    board : Board
        What they show.
    progress : callable, optional
        Called with (frames done, frames in all).

    Raises
    ------
    InputError
        Where a file cannot be read, images differ in size, or none shows the board.
    NotIdentifiableError
        Where the views of the board do not determine the lens.
    """
    paths = _list_images(files)
    pictures, total = _open(paths)
    views: list[BoardView] = []
    sizes: set[tuple[int, int]] = set()
    for done, grey in enumerate(pictures, start=1):
        sizes.add((grey.shape[1], grey.shape[0]))
        if len(sizes) > 1:
            raise InputError(f"the images differ in size ({sorted(sizes)}): expected those of one camera")
        view = _look(grey, board)
        if view is not None:
            views.append(view)
        if progress is not None:
            progress(done, total)
    if not views:
        what = f"a {board.pattern} of {board.columns} × {board.rows}"
        raise InputError(f"{paths[0]} shows no {what[2:]} in {total} images; check --pattern, --columns, --rows")
    ((width, height),) = sizes
    return calibrate_lens(views, width=width, height=height)


def _list_images(files: Sequence[Path]) -> list[Path]:
    found: list[Path] = []
    for file in files:
        globbed = sorted(file.parent.glob(file.name)) if "*" in file.name and not file.exists() else [file]
        if not globbed:
            raise InputError(f"{file}: no file has such a name; give a video, or images")
        found += globbed
    if not found:
        raise InputError("no file was given: expected a video, or images, of the board")
    return found


def _open(paths: Sequence[Path]) -> tuple[Iterable[GreyArray], int]:
    if all(path.suffix.lower() in IMAGES and path.is_file() for path in paths):
        return (_read_image(path) for path in paths), len(paths)
    if len(paths) > 1:
        raise InputError(f"{paths[0]} and {len(paths) - 1} more: expected one video, or images alone")
    clock = read_clock(paths[0])
    count = len(clock.stamps)
    step = max(1, -(-count // MOST_LOOKS))
    return _read_video(paths[0], step), -(-count // step)


def _read_video(path: Path, step: int) -> Iterable[GreyArray]:
    with read_frames(path, read_clock(path)) as frames:
        for place, frame in enumerate(frames):
            if place % step == 0:
                yield frame.grey


def _read_image(path: Path) -> GreyArray:
    grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise InputError(f"{path} cannot be read: expected an image")
    return grey  # type: ignore[return-value]


def _look(grey: GreyArray, board: Board) -> BoardView | None:
    if board.pattern == "aprilgrid":
        return place_tags(grey, find_tags(grey, family=board.family), board)
    return find_board(grey, board)
