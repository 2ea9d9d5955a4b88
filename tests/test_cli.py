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
        (["--fps", "1e-300"], ["--fps", "1e-300"]),
        (["--mass", "1e300"], ["--mass", "1e+300"]),
        (["--tag-size", "1e300"], ["size", "1e+300"]),
        (["--tag-size", "1e6"], ["size", "1e+06", "10000"]),
        (["--pcp-tag-size", "1e-6"], ["PCP", "size", "1e-06", "0.01"]),
        (["--window", "3"], ["--window", "START:END"]),
        (["--window", "4:3"], ["window", "4:3"]),
        (["--window", "100:200"], ["window", "100", "200"]),
        (["--pcp-id", "0"], ["ids", "different"]),
        (["--tcp-id", "587"], ["tag36h11", "587", "586"]),
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
    assert run([str(bag), "--pcp-id", "9", "--tag-size", "30"]) == 3
    line = complaint(capsys)
    assert "product's tag was never seen" in line
    assert "tag36h11 0" in line
    assert "tag36h11 1" in line
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
    assert result["tags"]["tcp"] == {"id": 9, "detected": 0.0, "mm_per_px": None}


def test_a_video_cut_in_the_middle_is_used_as_far_as_it_goes(inside, capsys) -> None:
    # Matroska keeps no index at its end: what was written can be read.
    whole = inside / "whole.mkv"
    subprocess.run([sys.executable, "-c", REMUX, str(SAMPLES / "bag.mp4"), str(whole)], check=True)
    content = whole.read_bytes()
    (inside / "cut.mkv").write_bytes(content[: int(len(content) * 0.8)])
    assert run(["cut.mkv", "--tag-size", "30", "--quiet"]) == 0
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


def test_an_mp4_that_lost_the_index_at_its_end_is_refused_with_a_reason(inside, capsys) -> None:
    content = (SAMPLES / "bag.mp4").read_bytes()
    assert content.index(b"moov") > len(content) // 2, "the sample's index lies at its end"
    (inside / "cut.mp4").write_bytes(content[: len(content) // 2])
    assert run(["cut.mp4", "--tag-size", "30", "--quiet"]) == 2
    assert "cut.mp4" in complaint(capsys)
    assert nothing_written(inside)


def test_a_lens_that_changes_is_not_answered_from_kept_steps(inside, capsys) -> None:
    shutil.copy(SAMPLES / "released.mp4", inside / "film.mp4")
    radii = []
    for focal in (3000.0, 2500.0):
        camera = {"width": 640, "height": 480, "fx": 3000.0, "fy": focal, "cx": 319.5, "cy": 239.5}
        camera |= {"schema": "tagsway/camera/1", "distortion": [0, 0, 0, 0, 0], "readout_s": 0}
        (inside / "camera.json").write_text(json.dumps(camera))
        assert run(["film.mp4", "--tag-size", "30", "--camera", "camera.json", "--quiet"]) == 0
        result = json.loads((inside / "film-identify" / "result.json").read_text())
        radii.append(result["pendulum"]["tag_radius_mm"]["value"])
    assert abs(radii[1] / radii[0] - 1) > 0.02


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


def test_json_on_standard_output_is_the_result_and_says_why_anything_in_it_is_null(bag, capsys) -> None:
    assert run([str(bag), "--tag-size", "30", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((bag.parent / "bag-identify" / "result.json").read_text())
    assert result["pendulum"]["determined"] is True
    assert result["pendulum"]["stiffness_n_m_per_rad"] is None
    assert "no_mass" in {warning["code"] for warning in result["warnings"]}
    assert result["status"] == "ok"


def a_track(folder: Path, name: str = "swing.csv") -> Path:
    rng, time = np.random.default_rng(0), np.arange(600) / 200
    x = 20 * np.exp(-0.3 * time) * np.cos(2 * np.pi * 2.4 * time) + 0.05 * rng.normal(size=600)
    rows = [f"{t:.4f},{value:.4f}" for t, value in zip(time, x, strict=True)]
    path = folder / name
    path.write_text("\n".join(["t,x", *rows]) + "\n")
    return path


def test_a_folder_of_somebody_s_own_files_keeps_them(inside, capsys) -> None:
    a_track(inside)
    (inside / "out" / "figures").mkdir(parents=True)
    (inside / "out" / "figures" / "paper.png").write_text("mine")
    (inside / "out" / "trajectory.csv").write_text("mine")
    assert run(["swing.csv", "--out", "out", "--quiet"]) == 0
    assert (inside / "out" / "figures" / "paper.png").read_text() == "mine"
    assert (inside / "out" / "trajectory.csv").read_text() == "mine"


def test_what_an_earlier_measurement_left_is_taken_away(bag, capsys) -> None:
    move = str(SAMPLES / "move.toml")
    assert run([str(bag), "--tag-size", "30", "--move", move, "--out", "out"]) == 0
    rows = len((bag.parent / "out" / "trajectory.csv").read_text().splitlines())
    assert f"trajectory.csv: {rows} samples of 1 ms" in capsys.readouterr().out
    assert run([str(bag), "--out", "out"]) == 0
    assert not (bag.parent / "out" / "trajectory.csv").exists()
    said = capsys.readouterr().out
    assert "without --tag-size nothing is known in mm" in said
    assert "did not move" not in said
    assert not list((bag.parent / "out").glob(".*-*"))


@pytest.mark.parametrize("out", [".", ""])
def test_the_input_is_never_written_over(inside, capsys, out) -> None:
    path = a_track(inside, "track.csv")
    before = path.read_bytes()
    assert run(["track.csv", "--out", out]) == 2
    assert "--out" in complaint(capsys)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("max_acceleration_m_s2 = 4.0", 'max_acceleration_m_s2 = "4.0"', "max_acceleration_m_s2"),
        ("max_acceleration_m_s2 = 4.0", "max_acceleration_m_s2 = true", "max_acceleration_m_s2"),
        ("velocity_m_s = 3.0", "velocity_m_s = inf", "velocity_m_s"),
        ("to_m = [0.35, 0.0, -0.767]", "to_m = [700.0, 0.0, -0.767]", "mm"),
        ("to_m = [0.35, 0.0, -0.767]", "to_m = [nan, 0.0, -0.767]", "finite"),
        ("sample_time_ms = 1.0", "sample_time_ms = 1e-6", "sample"),
        ("shaped_axes", "colour = 1\nshaped_axes", "colour"),
    ],
)
def test_a_move_that_cannot_be_is_named_and_nothing_is_written(inside, capsys, old, new, word) -> None:
    text = (SAMPLES / "move.toml").read_text()
    assert old in text
    (inside / "move.toml").write_text(text.replace(old, new))
    assert run(["trajectory", "--move", "move.toml", "--shaper", "none", "--out", "t.csv"]) == 2
    assert word in complaint(capsys)
    assert sorted(path.name for path in inside.iterdir()) == ["move.toml"]


def test_a_trajectory_is_not_written_over_its_move(inside, capsys) -> None:
    shutil.copy(SAMPLES / "move.toml", inside / "mine.json")
    assert run(["trajectory", "--move", "mine.json", "--shaper", "none", "--out", "mine.csv"]) == 2
    assert "mine.json" in complaint(capsys)


def test_an_interrupted_run_says_so_and_leaves_nothing(inside, capsys, monkeypatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    a_track(inside)
    monkeypatch.setattr("tagsway.report.figures.write_figures", interrupt)
    assert run(["swing.csv", "--quiet"]) == 1
    assert complaint(capsys) == "error: interrupted"
    assert nothing_written(inside)


def test_an_interruption_while_the_command_loads_says_so_too() -> None:
    program = (
        "import signal, sys\n"
        "from tagsway.cli import main\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'tagsway.cli.app':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr.splitlines()) == (1, ["error: interrupted"])


def test_a_table_in_other_units_is_suspected(inside, capsys) -> None:
    path = a_track(inside)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join([",".join(rows[0]), *(f"{1000 * float(t):.1f},{x}" for t, x in rows[1:])]))
    assert run(["swing.csv", "--quiet"]) == 0
    result = json.loads((inside / "swing-identify" / "result.json").read_text())
    assert "units_suspect" in {warning["code"] for warning in result["warnings"]}
