"""The command: exit codes, one line for each error, nothing half-written."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tagsway.cli.app import run
from tagsway.video.writing import write_video

SAMPLES = Path(__file__).parents[1] / "sample_data"


@pytest.fixture
def inside(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def bag(inside) -> Path:
    return Path(shutil.copy(SAMPLES / "bag.mp4", inside / "bag.mp4"))


def blank_video(path: Path, *, frames: int = 30) -> Path:
    grey = np.full((240, 320), 200, dtype=np.uint8)
    write_video(path, [grey] * frames, fps_hz=60.0)
    return path


def complaint(capsys) -> str:
    """Return the one line of an error, after checking that it is one."""
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("error: ")
    assert "Traceback" not in lines[0]
    return lines[0]


def nothing_written(folder: Path) -> bool:
    return not list(folder.glob("*-identify"))


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda p: None, "no such file"),
        (lambda p: p.mkdir(), "folder|directory"),
        (lambda p: p.touch(), "empty"),
        (lambda p: p.write_text("this is not a video\n" * 100), "not a video|no video|cannot be read"),
        (lambda p: blank_video(p, frames=1), "one frame|1 frame"),
    ],
    ids=["missing", "folder", "empty", "text", "one-frame"],
)
def test_a_file_that_is_no_video_is_refused(inside, capsys, make, word) -> None:
    path = inside / "film.mp4"
    make(path)
    assert run([str(path)]) == 2
    line = complaint(capsys)
    assert any(part in line.lower() for part in word.split("|")), line
    assert "film.mp4" in line
    assert nothing_written(inside)


def test_a_video_without_tags_is_refused(inside, capsys) -> None:
    path = blank_video(inside / "film.mp4")
    assert run([str(path)]) == 2
    assert "no tag" in complaint(capsys)
    assert nothing_written(inside)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--tag-size", "0"], ["size", "0", "positive"]),
        (["--tag-size", "-3"], ["size", "-3", "positive"]),
        (["--tag-size", "nan"], ["size", "nan", "positive"]),
        (["--mass", "-225"], ["--mass", "-225", "positive"]),
        (["--fps", "0"], ["--fps", "0"]),
        (["--window", "3"], ["--window", "START:END"]),
        (["--window", "4:3"], ["window", "4:3"]),
        (["--window", "100:200"], ["window", "100", "200"]),
        (["--pcp-id", "0"], ["ids", "different"]),
        (["--up", "down"], ["--up", "down"]),
        (["--sway-axis", "w"], ["--sway-axis", "w"]),
        (["--frequency-spread", "-1"], ["--frequency-spread", "-1"]),
        (["--shaper", "zzz"], ["zzz", "zvd"]),
        (["--family", "tag99"], ["tag99", "tag36h11"]),
        (["--camera", "none.json"], ["none.json"]),
        (["--move", "none.toml"], ["none.toml"]),
        (["--colour"], ["--colour"]),
        (["--tag-size", "big"], ["--tag-size", "big"]),
    ],
    ids=lambda value: " ".join(value) if value and str(value[0]).startswith("--") else "",
)
def test_an_option_that_cannot_be_used_is_named(bag, capsys, options, words) -> None:
    assert run([str(bag), *options]) == 2
    line = complaint(capsys)
    assert all(word in line for word in words), line
    assert nothing_written(bag.parent)


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(bag, capsys) -> None:
    (bag.parent / "file").write_text("")
    assert run([str(bag), "--out", str(bag.parent / "file" / "out")]) == 2
    assert "--out" in complaint(capsys)


def test_wrong_ids_are_told_which_tags_were_seen(bag, capsys) -> None:
    assert run([str(bag), "--tcp-id", "7", "--pcp-id", "8"]) == 2
    line = complaint(capsys)
    assert "0" in line
    assert "1" in line
    assert "tag36h11" in line


def test_a_wrong_family_is_told_which_tags_were_seen(bag, capsys) -> None:
    assert run([str(bag), "--family", "tag25h9"]) == 2
    assert "tag36h11" in complaint(capsys)


def test_the_product_s_tag_never_seen_is_not_determined(bag, capsys) -> None:
    assert run([str(bag), "--pcp-id", "9", "--tag-size", "40"]) == 3
    assert "product's tag was never seen" in complaint(capsys)
    folder = bag.parent / "bag-identify"
    assert json.loads((folder / "result.json").read_text())["status"] == "not_determined"
    assert (folder / "track.csv").exists()


def test_the_tool_s_tag_never_seen_still_gives_the_frequency(bag, capsys) -> None:
    assert run([str(bag), "--tcp-id", "9", "--quiet"]) == 0
    result = json.loads((bag.parent / "bag-identify" / "result.json").read_text())
    truth = json.loads((SAMPLES / "bag.truth.json").read_text())
    frequency = result["modal"]["natural_frequency_hz"]
    assert frequency["value"] == pytest.approx(truth["natural_frequency_hz"], rel=0.01)
    assert result["pendulum"]["determined"] is False
    assert "tcp_not_seen" in {warning["code"] for warning in result["warnings"]}


def test_a_video_cut_in_the_middle_is_used_as_far_as_it_goes(inside, capsys) -> None:
    # Matroska keeps no index at its end: what was written can be read.
    whole = inside / "whole.mkv"
    subprocess.run([sys.executable, "-c", REMUX, str(SAMPLES / "bag.mp4"), str(whole)], check=True)
    content = whole.read_bytes()
    (inside / "cut.mkv").write_bytes(content[: int(len(content) * 0.8)])
    assert run(["cut.mkv", "--tag-size", "40", "--quiet"]) == 0
    result = json.loads((inside / "cut-identify" / "result.json").read_text())
    assert "truncated" in {warning["code"] for warning in result["warnings"]}
    assert result["status"] == "degraded"


REMUX = """
import sys, av
source, target = av.open(sys.argv[1]), av.open(sys.argv[2], "w")
stream = source.streams.video[0]
copy = target.add_stream_from_template(stream)
for packet in source.demux(stream):
    if packet.dts is not None:
        packet.stream = copy
        target.mux(packet)
target.close()
"""


def test_an_mp4_cut_in_the_middle_is_refused_with_a_reason(inside, capsys) -> None:
    content = (SAMPLES / "bag.mp4").read_bytes()
    (inside / "cut.mp4").write_bytes(content[: len(content) // 2])
    code = run(["cut.mp4", "--tag-size", "40", "--quiet"])
    if code == 2:  # the index of an mp4 may lie at its end, and is lost with it
        assert "cut.mp4" in complaint(capsys)
    else:
        result = json.loads((inside / "cut-identify" / "result.json").read_text())
        assert "truncated" in {warning["code"] for warning in result["warnings"]}


def test_a_real_video_in_which_nothing_swings_is_not_determined(inside, shared, capsys) -> None:
    video = shared / "data" / "real" / "pushing_straight.mp4"
    assert run([str(video), "--pcp-id", "0", "--tcp-id", "1", "--tag-size", "80", "--quiet"]) == 3
    complaint(capsys)
    result = json.loads((inside / "pushing_straight-identify" / "result.json").read_text())
    assert result["status"] == "not_determined"
    assert result["modal"] is None or result["modal"]["natural_frequency_hz"] is None
    assert result["tags"]["pcp"]["detected"] == 1.0


def test_the_first_word_may_be_the_file_or_run(inside, capsys) -> None:
    assert run(["none.mp4"]) == run(["run", "none.mp4"]) == 2


def test_help_loads_neither_opencv_nor_scipy_nor_matplotlib() -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "tagsway.cli", "--help"], capture_output=True, text=True, check=True
    )
    loaded = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in done.stderr.splitlines()}
    assert "typer" in loaded
    assert not loaded & {"cv2", "scipy", "matplotlib", "pandas", "av", "jinja2"}
    assert "VIDEO_OR_TRACK" in done.stdout or "run" in done.stdout


def test_json_on_standard_output_is_the_result_and_nothing_else(bag, capsys) -> None:
    assert run([str(bag), "--tag-size", "40", "--json"]) == 0
    printed = capsys.readouterr().out
    assert json.loads(printed) == json.loads((bag.parent / "bag-identify" / "result.json").read_text())
