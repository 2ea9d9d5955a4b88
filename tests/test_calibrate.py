"""A lens from boards that were drawn through a known one."""

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from tagsway.camera import undistort
from tagsway.camera.boards import Board, BoardView
from tagsway.camera.calibration import Calibration, calibrate_lens, measure_coverage
from tagsway.cli.app import run
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Camera, FloatArray, GreyArray
from tagsway.pipeline.calibration import calibrate_camera
from tagsway.store.cameras import read_camera, write_camera
from tagsway.tags.draw import draw_tag

LENS = Camera(width=640, height=480, fx=700, fy=695, cx=325, cy=236, distortion=(-0.15, 0.06, 8e-4, -6e-4, 0.0))
MATRIX = np.array([[LENS.fx, 0, LENS.cx], [0, LENS.fy, LENS.cy], [0, 0, 1]])
CELL_PX = 12
FINE = 2

CHESSBOARD = Board(pattern="chessboard", columns=9, rows=7, square_m=0.03)
CHARUCO = Board(pattern="charuco", columns=8, rows=6, square_m=0.03, marker_m=0.022)
APRILGRID = Board(pattern="aprilgrid", columns=5, rows=4, square_m=0.05, marker_m=0.04)


def draw_board(board: Board) -> tuple[GreyArray, float]:
    """Return artwork with a margin, and its pixels to a metre."""
    if board.pattern == "chessboard":
        cells = np.indices((board.rows, board.columns)).sum(axis=0) % 2
        art = np.kron(cells * 255, np.ones((40, 40))).astype(np.uint8)
        return np.pad(art, 40, constant_values=255), 40 / board.square_m
    if board.pattern == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        drawn = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, dictionary)
        art = drawn.generateImage((board.columns * 60, board.rows * 60), marginSize=0)
        return np.pad(art, 60, constant_values=255), 60 / board.square_m
    assert board.marker_m is not None
    tag_px = 8 * CELL_PX  # black squares of this family are eight cells wide
    pitch = round(tag_px * board.square_m / board.marker_m)
    art = np.full((board.rows * pitch, board.columns * pitch), 255, dtype=np.uint8)
    for number in range(board.columns * board.rows):
        column, row = number % board.columns, board.rows - 1 - number // board.columns
        tag = draw_tag(board.family, number, cell_px=CELL_PX, quiet_cells=0)
        inner = tag[CELL_PX:-CELL_PX, CELL_PX:-CELL_PX] if tag.shape[0] > tag_px else tag
        art[row * pitch : row * pitch + tag_px, column * pitch : column * pitch + tag_px] = inner
    return np.pad(art, pitch // 4, constant_values=255), tag_px / board.marker_m


@cache
def cast_rays() -> FloatArray:
    """Return X/Z, Y/Z of every fine pixel: the Brown-Conrady model of the lens, inverted by iteration."""
    columns, rows = (FINE * size for size in (LENS.width, LENS.height))
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    seen = ((grid + 0.5) / FINE - 0.5 - [LENS.cx, LENS.cy]) / [LENS.fx, LENS.fy]
    k1, k2, p1, p2, _ = LENS.distortion
    ray = seen.copy()
    for _ in range(12):
        x, y = ray.T
        r2 = x**2 + y**2
        bent = np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], axis=1)
        ray = (seen - bent) / (1 + k1 * r2 + k2 * r2**2)[:, None]
    return ray


def film_board(board: Board, poses: list[tuple[FloatArray, FloatArray]]) -> list[GreyArray]:
    """Return images of a board through the lens, each from a turn (Rodrigues) and the place of its middle."""
    art, per_metre = draw_board(board)
    ray = cast_rays()
    images = []
    for turn, place in poses:
        axes = cv2.Rodrigues(turn)[0]
        back = np.linalg.inv(np.column_stack([axes[:, 0], axes[:, 1], place]))
        on_board = np.column_stack([ray, np.ones(len(ray))]) @ back.T
        where = on_board[:, :2] / on_board[:, 2:] * per_metre + (np.array(art.shape[::-1]) - 1) / 2
        shape = (FINE * LENS.height, FINE * LENS.width)
        seen = cv2.remap(
            art, where[:, 0].reshape(shape).astype(np.float32), where[:, 1].reshape(shape).astype(np.float32),
            cv2.INTER_LINEAR, borderValue=200,
        )  # fmt: skip
        images.append(cv2.resize(seen, (LENS.width, LENS.height), interpolation=cv2.INTER_AREA))
    return images


def spread_poses(count: int, rng: np.random.Generator) -> list[tuple[FloatArray, FloatArray]]:
    poses = []
    for number in range(count):
        turn = np.radians([30 * np.cos(2.4 * number), 30 * np.sin(2.4 * number), 10 * rng.normal()])
        place = np.array([*rng.uniform(-1, 1, 2) * [0.07, 0.05], rng.uniform(0.38, 0.48)])
        poses.append((turn, place))
    return poses


def write_images(folder: Path, images: list[GreyArray]) -> list[Path]:
    folder.mkdir(exist_ok=True)
    paths = [folder / f"{number:03d}.png" for number in range(len(images))]
    for path, image in zip(paths, images, strict=True):
        cv2.imwrite(str(path), image)
    return paths


def misses(calibration: Calibration) -> dict[str, float]:
    truth = dict(zip(calibration.parameters, (LENS.fx, LENS.fy, LENS.cx, LENS.cy, *LENS.distortion), strict=True))
    return {name: abs(e.value - truth[name]) / e.std for name, e in calibration.parameters.items()}


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO, APRILGRID], ids=lambda board: board.pattern)
def test_a_known_lens_is_recovered_from_images_of_a_board(board, tmp_path) -> None:
    write_images(tmp_path, film_board(board, spread_poses(12, np.random.default_rng(1))))
    calibration = calibrate_camera([tmp_path / "*.png"], board)
    assert calibration.boards >= 8
    assert calibration.rms_px < 0.3
    assert calibration.parameters["fx"].value == pytest.approx(LENS.fx, rel=0.01)
    missed = misses(calibration)
    assert max(missed[name] for name in ("fx", "fy", "cx", "cy")) < 5  # statistics: five stated errors
    corner_px = np.stack(np.meshgrid(np.linspace(60, 580, 9), np.linspace(50, 430, 7)), axis=-1)
    found, truth = ((undistort(corner_px, lens) - [lens.cx, lens.cy]) / lens.fx for lens in (calibration.camera, LENS))
    assert np.abs(found - truth).max() * LENS.fx < 1.0  # where boards were; k1, k2 and k3 trade with another


def seen_boards(
    poses: list[tuple[FloatArray, FloatArray]], rng: np.random.Generator, noise: float = 0.1
) -> list[BoardView]:
    on_board = np.stack(np.meshgrid(np.arange(8), np.arange(6)), axis=-1).reshape(-1, 2) * 0.03
    middle = np.column_stack([on_board - on_board.mean(axis=0), np.zeros(len(on_board))])
    views = []
    for turn, place in poses:
        corners = cv2.projectPoints(middle, turn, place, MATRIX, np.array(LENS.distortion))[0][:, 0]
        noisy = corners + noise * rng.normal(size=corners.shape)
        views.append(BoardView(on_board_m=on_board, corners_px=noisy, sharpness=1.0))
    return views


def test_stated_errors_are_those_of_the_noise() -> None:
    z = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        calibration = calibrate_lens(seen_boards(spread_poses(12, rng), rng), width=640, height=480)
        assert calibration.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.15)  # statistics; OpenCV's is per corner
        z += list(misses(calibration).values())
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.3  # statistics: 108 normalised errors


def test_too_few_boards_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(NotIdentifiableError, match="4 different sharp views"):
        calibrate_lens(seen_boards(spread_poses(4, rng), rng), width=640, height=480)


def test_boards_that_do_not_move_count_once() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(NotIdentifiableError, match="1 different sharp views"):
        calibrate_lens(seen_boards(spread_poses(1, rng) * 30, rng), width=640, height=480)


def test_parallel_boards_are_refused() -> None:
    rng = np.random.default_rng(0)
    poses = [(np.zeros(3), np.array([x, y, 0.5])) for x in (-0.05, 0.0, 0.05) for y in (-0.03, 0.0, 0.03)]
    with pytest.raises(NotIdentifiableError, match="focal length"):
        calibrate_lens(seen_boards(poses, rng), width=640, height=480)


def test_boards_in_one_part_of_the_image_are_reported() -> None:
    rng = np.random.default_rng(2)
    poses = [(turn, place * [0.1, 0.1, 2.5]) for turn, place in spread_poses(12, rng)]
    views = seen_boards(poses, rng, noise=0.01)
    assert measure_coverage(views, width=640, height=480) < 0.5
    assert [n.code for n in calibrate_lens(views, width=640, height=480).notices] == ["poor_coverage"]


def test_a_camera_written_is_the_camera_read(tmp_path) -> None:
    write_camera(tmp_path / "camera.json", LENS)
    assert read_camera(tmp_path / "camera.json") == LENS


def test_the_command_writes_the_camera_and_says_what_is_next(tmp_path, capsys) -> None:
    write_images(tmp_path / "frames", film_board(CHESSBOARD, spread_poses(10, np.random.default_rng(3))))
    out = tmp_path / "lens" / "camera.json"
    board = ["--columns", "9", "--rows", "7", "--square", "30"]
    assert run(["calibrate", str(tmp_path / "frames" / "*.png"), *board, "--out", str(out)]) == 0
    assert json.loads(out.read_text())["schema"] == "tagsway/camera/1"
    assert read_camera(out).fx == pytest.approx(LENS.fx, rel=0.01)
    shown = capsys.readouterr()
    assert "rms" in shown.out
    assert f"--camera {out}" in shown.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--columns", "2", "--rows", "7", "--square", "30"], "at least 3"),
        (["--columns", "9", "--rows", "7", "--square", "0"], "--square is 0 mm"),
        (["--columns", "9", "--rows", "7", "--square", "nan"], "--square is nan mm"),
        (["--columns", "9", "--rows", "7", "--square", "1e6"], "to 10000 mm"),
        (["--columns", "9", "--rows", "7", "--square", "30", "--pattern", "dots"], "--pattern is 'dots'"),
        (["--columns", "9", "--rows", "7", "--square", "30", "--pattern", "charuco"], "--marker is missing"),
        (["--columns", "9", "--rows", "7", "--square", "30"], "shows no chessboard"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_no_file(arguments, words, tmp_path, capsys) -> None:
    (picture,) = write_images(tmp_path, [np.full((480, 640), 128, dtype=np.uint8)])
    assert run(["calibrate", str(picture), *arguments, "--out", str(tmp_path / "camera.json")]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "camera.json").exists()


def test_images_of_different_sizes_are_refused(tmp_path) -> None:
    write_images(tmp_path, [np.zeros((480, 640), dtype=np.uint8), np.zeros((240, 320), dtype=np.uint8)])
    with pytest.raises(InputError, match="differ in size"):
        calibrate_camera([tmp_path / "*.png"], CHESSBOARD)
