"""Files: what is written is what is read, whole or not at all, in the units that others rely on."""

import json
import math
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import example_result
from tagsway.errors import InputError
from tagsway.files import check_writable, staging_folder, whole_file
from tagsway.model import (
    Curves,
    DesignMode,
    Estimate,
    Impulse,
    PendulumEstimate,
    Residual,
    Settings,
    Shaper,
    TagTrack,
    Track,
    TrackCurve,
)
from tagsway.model.curves import AmplitudeCurve, BackboneCurve
from tagsway.store.documents import (
    from_document,
    read_result,
    read_shaper,
    to_document,
    write_result,
    write_shaper,
)
from tagsway.store.packing import read_curves, write_curves
from tagsway.store.steps import StepStore
from tagsway.store.tracks import quantise, read_track, track_csv, write_track


def a_tag(n: int, *, rng: np.random.Generator) -> TagTrack:
    position = rng.normal(size=(n, 2)) * 0.3
    position[3] = np.nan
    return TagTrack(
        position=position,
        position_std=np.full((n, 2), 1.234567e-5),
        angle_rad=rng.normal(size=n),
        angle_std_rad=np.full(n, 1e-3),
    )


def a_track(*, unit: str = "m", n: int = 20) -> Track:
    rng = np.random.default_rng(1)
    return Track(
        frame=np.arange(n) * 2,
        time_s=np.cumsum(rng.uniform(0.004, 0.006, n)),
        length_unit=unit,  # type: ignore[arg-type]
        pcp=a_tag(n, rng=rng),
        tcp=a_tag(n, rng=rng),
    )


ZV = Shaper(
    type="zv",
    modes=(DesignMode(frequency_hz=2.5, damping_ratio=0.01, amplitude_m=0.012),),
    impulses=(Impulse(time_s=0.0, amplitude=0.5), Impulse(time_s=0.2, amplitude=0.5)),
    residual=Residual(at_mode=0.0),
    source="flexible.mp4",
)


def test_lengths_become_millimetres_in_a_document() -> None:
    document = to_document(Settings(tcp_tag_size_m=0.04, mass_kg=0.225))
    assert document["tcp_tag_size_mm"] == 40.0  # identity: the shortest decimal comes back
    assert document["mass_g"] == 225.0
    assert "tcp_tag_size_m" not in document


def test_an_estimate_is_converted_whole() -> None:
    length = Estimate(value=0.04585, std=1e-4, ci95=(0.0456, 0.0461))
    document = to_document(replace(PendulumEstimate.unknown("-"), length_m=length))
    assert document["length_mm"] == {"value": 45.85, "std": 0.1, "ci95": [45.6, 46.1]}


def test_a_shaper_survives_its_file(tmp_path) -> None:
    write_shaper(tmp_path / "shaper.json", ZV)
    assert read_shaper(tmp_path / "shaper.json") == ZV
    document = json.loads((tmp_path / "shaper.json").read_text())
    assert document["schema"] == "tagsway/shaper/1"
    assert document["duration_s"] == 0.2
    assert document["modes"][0]["amplitude_mm"] == 12.0


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"colour": "red"}, "colour"),
        ({"impulses": [{"time_s": 0, "amplitude": 0.4}]}, "sum to 1"),
        ({"schema": "tagsway/shaper/9"}, "tagsway/shaper/9"),
        ({"type": None}, "type"),
    ],
)
def test_a_wrong_document_is_refused_in_one_line(tmp_path, change, word) -> None:
    path = tmp_path / "shaper.json"
    write_shaper(path, ZV)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=word) as caught:
        read_shaper(path)
    assert "\n" not in str(caught.value)
    assert "shaper.json" in str(caught.value)


def test_settings_survive_a_document() -> None:
    settings = Settings(fps_hz=200.0, tcp_tag_size_m=0.04, mass_kg=0.225, columns=("t", "x"))
    assert from_document(Settings, json.loads(json.dumps(to_document(settings))), origin="x") == settings


@pytest.mark.parametrize("unit", ["m", "px"])
def test_a_track_from_its_file_is_the_same_to_the_last_bit(tmp_path, unit) -> None:
    track = quantise(a_track(unit=unit))
    (tmp_path / "track.csv").write_text(track_csv(track, None))
    again = read_track(tmp_path / "track.csv")
    assert again.length_unit == unit
    np.testing.assert_array_equal(again.time_s, track.time_s)
    np.testing.assert_array_equal(again.frame, track.frame)
    for name in ("tcp", "pcp"):
        for field in ("position", "position_std", "angle_rad", "angle_std_rad"):
            np.testing.assert_array_equal(getattr(getattr(again, name), field), getattr(getattr(track, name), field))


def test_a_track_is_written_in_pieces_as_it_is_in_one(tmp_path, monkeypatch) -> None:
    track = quantise(a_track())
    whole = track_csv(track, None)
    monkeypatch.setattr("tagsway.store.tracks.CSV_ROWS", 3)
    write_track(tmp_path / "track.csv", track, None)
    assert (tmp_path / "track.csv").read_bytes() == whole.encode()
    assert whole.count("\n") == len(track.time_s) + 1


def test_what_was_not_seen_is_empty_in_the_file() -> None:
    lines = track_csv(quantise(a_track()), None).splitlines()
    assert lines[4].split(",")[2:4] == ["", ""]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("a,b\n1,2\n3,4\n", "--columns"),
        ("t,x\n0,1\n0,2\n", "rise"),
        ("t,x\n0,1\n", "at least two"),
        ("\x00\x01", "columns"),
    ],
)
def test_a_table_that_is_no_track_is_refused(tmp_path, text, word) -> None:
    path = tmp_path / "track.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=word):
        read_track(path)


def test_somebody_elses_table_is_read_by_its_column_names(tmp_path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("Zeit;weg\n0,0\n".replace("0,0\n", "0;10\n0.1;20\n0.2;\n"))
    track = read_track(path, columns=("Zeit", "weg"))
    np.testing.assert_allclose(track.pcp.position[:, 0], [0.01, 0.02, np.nan])  # identity
    assert track.tcp is None


def test_curves_survive_their_file(tmp_path) -> None:
    n = 5
    xz, t = np.arange(2.0 * n).reshape(n, 2), np.arange(float(n))
    track = TrackCurve(time_s=t, pcp=xz, pcp_clean=xz, pcp_acceleration=xz, tcp=xz, tcp_clean=xz, tcp_acceleration=xz)
    write_curves(tmp_path / "curves.npz", Curves(track=track))
    again = read_curves(tmp_path / "curves.npz")
    np.testing.assert_array_equal(again.track.pcp, xz)
    assert again.decay is None
    assert "track.time_s" in np.load(tmp_path / "curves.npz").files


@pytest.mark.parametrize("variant", ["example", "peeled_off", "without_tool"])
def test_all_that_is_drawn_and_said_survives_its_files(tmp_path, variant) -> None:
    result, curves = getattr(example_result, variant)()
    write_result(tmp_path / "result.json", result)
    again = read_result(tmp_path / "result.json")
    assert again.estimator_details == result.estimator_details
    assert [event.kind for event in again.events] == [event.kind for event in result.events]
    write_curves(tmp_path / "curves.npz", curves)
    drawn = read_curves(tmp_path / "curves.npz")
    assert drawn.backbone is not None
    assert drawn.excitation is not None
    np.testing.assert_array_equal(drawn.backbone.pieces.frequency_ci95_hz, curves.backbone.pieces.frequency_ci95_hz)
    assert drawn.excitation.move_s == curves.excitation.move_s
    assert "backbone.fit.damping_ci95" in np.load(tmp_path / "curves.npz").files


def test_a_backbone_without_pieces_survives_too(tmp_path) -> None:
    result, curves = example_result.example()
    empty = BackboneCurve(fit=AmplitudeCurve.of(result.modal.backbone), pieces=AmplitudeCurve.of(()))
    write_curves(tmp_path / "curves.npz", replace(curves, backbone=empty))
    again = read_curves(tmp_path / "curves.npz").backbone
    assert again is not None
    assert again.pieces.frequency_ci95_hz.shape == (0, 2)
    assert again.fit.amplitude_m[0] == 0.0105


def test_a_block_that_fails_leaves_the_old_file_and_nothing_else(tmp_path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")

    def fail_half_way() -> None:
        with whole_file(path) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_run_left_is_taken_away_by_the_next_and_nothing_else(tmp_path) -> None:
    program = (
        "import os, pathlib\n"
        "from tagsway.files import staging_folder, whole_file\n"
        "with whole_file(pathlib.Path('film.mp4')), staging_folder(pathlib.Path()) as staging:\n"
        "    (staging / 'figures').mkdir()\n"
        "    os._exit(1)\n"
    )
    (tmp_path / ".tagsway-pictures").mkdir()
    (tmp_path / ".film-original.mp4").write_text("mine")
    (tmp_path / ".film.tagsway-old.mp4").write_text("mine")
    own = sorted(tmp_path.iterdir())
    for _ in range(2):  # the second finds what the first left too young to be taken away
        subprocess.run([sys.executable, "-c", program], cwd=tmp_path)
    left = sorted(set(tmp_path.iterdir()) - set(own))
    assert len(left) == 4
    make_old(*own, *left)
    with whole_file(tmp_path / "film.mp4") as film, staging_folder(tmp_path) as staging:
        assert sorted(tmp_path.iterdir()) == sorted([*own, film, staging])
        if sys.platform != "win32":  # another process that writes the same leaves what is held
            make_old(film, staging)
            subprocess.run([sys.executable, "-c", program.replace("os._exit(1)", "pass")], cwd=tmp_path, check=True)
        assert film.exists()
        assert (staging / ".held").exists()


def make_old(*paths) -> None:
    for path in paths:
        os.utime(path, (time.time() - 3600,) * 2)


def test_a_folder_below_a_file_is_refused_before_any_work(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        check_writable(tmp_path / "file" / "out")


def test_a_step_is_computed_once_for_the_same_dependencies(tmp_path) -> None:
    store, calls = StepStore(folder=tmp_path / "steps"), []

    def compute() -> Residual:
        calls.append(1)
        return Residual(at_mode=0.25, p95=math.pi)

    first = store.get("r", Residual, compute, depends_on={"a": 1})
    store.keep()
    second = store.get("r", Residual, compute, depends_on={"a": 1})
    assert first == second
    assert len(calls) == 1
    store.get("r", Residual, compute, depends_on={"a": 2})
    assert len(calls) == 2


@pytest.mark.parametrize("left", [b"PK damaged", b""])
def test_a_damaged_step_is_computed_again(tmp_path, left) -> None:
    store = StepStore(folder=tmp_path)
    store.get("r", Residual, lambda: Residual(at_mode=0.25), depends_on=1)
    assert not list(tmp_path.iterdir()), "nothing is written before it is to be kept"
    store.keep()
    (kept,) = tmp_path.glob("*.npz")
    kept.write_bytes(left)
    assert store.get("r", Residual, lambda: Residual(at_mode=0.5), depends_on=1).at_mode == 0.5
