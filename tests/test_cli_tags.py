"""`identify tags`: what a video shows, and sheets that the detector reads with a ruler that is right."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from scenes import small_scene
from tagsway.cli.app import run
from tagsway.report.sheet import DPI, write_tag_sheet
from tagsway.scene import render_scene
from tagsway.tags.families import tag_family
from tagsway.tags.find import find_tags
from tagsway.video.writing import write_video

PX_PER_MM = DPI / 25.4


@pytest.fixture(autouse=True)
def inside(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def complaint(capsys) -> str:
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("error: ")
    return line


def test_the_tags_of_a_video_are_listed_with_the_options_to_use_next(capsys) -> None:
    render_scene(small_scene(duration_s=0.6), Path("film.mp4"))
    assert run(["tags", "film.mp4"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"tag36h11 +0 +100 %", out)
    assert re.search(r"tag36h11 +1 +100 %", out)
    assert "identify film.mp4 --family tag36h11 --tcp-id 0 --pcp-id 1" in out


def test_a_video_without_tags_and_a_table_are_one_line(capsys) -> None:
    write_video(Path("film.mp4"), [np.full((240, 320), 200, dtype=np.uint8)] * 5, fps_hz=30.0)
    assert run(["tags", "film.mp4"]) == 2
    assert "no tag" in complaint(capsys)
    Path("track.csv").write_text("a,b\n1,2\n")
    assert run(["tags", "track.csv"]) == 2
    assert "table" in complaint(capsys)


@pytest.mark.parametrize("family", ["tag36h11", "tag16h5", "tagCircle21h7", "tagStandard41h12"])
def test_a_printed_sheet_is_found_with_the_right_ids_at_the_right_size(family) -> None:
    ids = [0, tag_family(family).tag_count - 1]
    write_tag_sheet(Path("tags.png"), family=family, tag_ids=ids, size_m=0.03)
    sheet = cv2.imread("tags.png", cv2.IMREAD_GRAYSCALE)
    assert sheet.shape == (3507, 2480)  # A4 at 300 dots an inch
    found = {tag.tag_id: tag for tag in find_tags(cv2.resize(sheet, None, fx=0.5, fy=0.5), family=family)}
    assert set(found) == set(ids)
    for tag in found.values():
        sides = np.linalg.norm(tag.corners_px - np.roll(tag.corners_px, 1, axis=0), axis=1) / (PX_PER_MM / 2)
        assert sides.mean() == pytest.approx(30, abs=0.1)  # discretisation: half a dot, and the detector's own


def test_the_ruler_is_100_mm_long() -> None:
    write_tag_sheet(Path("tags.png"), family="tag36h11", tag_ids=[0], size_m=0.03)
    sheet = cv2.imread("tags.png", cv2.IMREAD_GRAYSCALE)
    foot = sheet[round((297 - 35) * PX_PER_MM) :]
    line = foot[np.argmax((foot < 128).sum(axis=1))]
    dark = np.flatnonzero(line < 128)
    assert np.ptp(dark) + 1 == pytest.approx(100 * PX_PER_MM, abs=3)  # discretisation: the width of its end marks


def test_a_sheet_of_many_tags_has_pages_and_the_same_bytes_again(capsys) -> None:
    assert run(["tags", "--print", "--ids", "0-50", "--out", "a.pdf"]) == 0
    assert "5 pages" in capsys.readouterr().out
    assert run(["tags", "--print", "--ids", "0-50", "--out", "b.pdf"]) == 0
    assert Path("a.pdf").read_bytes() == Path("b.pdf").read_bytes()
    assert len(re.findall(rb"/Type /Page\b", Path("a.pdf").read_bytes())) == 5


def test_a_drawing_has_its_true_size_in_it() -> None:
    assert run(["tags", "--print", "--out", "tags.svg"]) == 0
    text = Path("tags.svg").read_text()
    assert 'width="595.275591pt"' in text  # 210 mm
    assert "tag36h11  id 1  30 mm" in text


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ([], "VIDEO"),
        (["film.mp4", "--print"], "either"),
        (["none.mp4"], "no such file"),
        (["--print", "--family", "tag99"], "tag36h11"),
        (["--print", "--ids", "587"], "0 to 586"),
        (["--print", "--ids", "a"], "--ids"),
        (["--print", "--ids", "3-1"], "--ids"),
        (["--print", "--ids", "0-99999999"], "--ids"),
        (["--print", "--size", "0"], "0 mm"),
        (["--print", "--size", "nan"], "nan"),
        (["--print", "--size", "500"], "500 mm"),
        (["--print", "--size", "1e-6"], "from 1 to"),
        (["--print", "--ids", "0-99", "--out", "tags.png"], ".pdf"),
        (["--print", "--out", "tags.doc"], ".svg"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_is_one_line_and_leaves_no_file(inside, capsys, options, word) -> None:
    assert run(["tags", *options]) == 2
    assert word in complaint(capsys)
    assert not list(inside.iterdir())
