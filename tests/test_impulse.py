"""Hammer blows with a known answer."""

import json

import numpy as np
import pytest

from tagsway.cli.app import run
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.impulse import find_blows
from tagsway.pipeline.impulse import identify_impulses
from tagsway.store.documents import read_json

TIME = np.arange(0, 8, 1e-3)
BLOWS_S = (0.5, 3.1, 5.6)
FIRST_HZ, ZETA = 36.6, 0.04


def answer(frequencies, *, noise=0.05, seed=1, second=0.6):
    rng = np.random.default_rng(seed)
    x = noise * rng.normal(size=len(TIME))
    for start, hz in zip(BLOWS_S, frequencies, strict=True):
        t = TIME[start <= TIME] - start
        x[start <= TIME] += np.exp(-2 * np.pi * hz * ZETA * t) * np.sin(2 * np.pi * hz * np.sqrt(1 - ZETA**2) * t)
        x[start <= TIME] += second * np.exp(-2 * np.pi * 82 * 0.03 * t) * np.sin(2 * np.pi * 82 * t)
    return x


def write(path, channels, *, time=TIME):
    head = ",".join(["time_s", *(f"q{i + 1}" for i in range(len(channels)))])
    np.savetxt(path, np.column_stack([time, *channels]), delimiter=",", header=head, comments="", fmt="%.6f")
    return path


def test_the_blows_of_a_record_are_found_where_they_fall() -> None:
    blows = find_blows(TIME, answer([FIRST_HZ] * 3), channel="q1")
    assert len(blows) == 3
    for blow, start in zip(blows, BLOWS_S, strict=True):
        assert 0 <= blow.start_s - start < 0.02  # the first extremes, before the answer has died by a tenth


def test_the_first_frequency_is_the_mean_of_axes_directions_and_repeats(tmp_path) -> None:
    frequencies = FIRST_HZ * (1 + np.array([[-0.04, 0.0, 0.01], [0.02, 0.03, -0.02], [0.0, -0.03, 0.03]]))
    file = write(tmp_path / "blows.csv", [answer(row, seed=i) for i, row in enumerate(frequencies)])
    result, _ = identify_impulses([file])
    assert result.peaks.n == 9
    truth = [blow.natural_frequency_hz for blow in result.blows]
    for fitted, hz in zip(truth, frequencies.ravel(), strict=True):
        assert fitted is not None
        assert abs(fitted.value - hz) < 5 * fitted.std  # statistics: 5 of its own standard errors, nine times
    assert result.natural_frequency_hz is not None
    assert result.natural_frequency_hz.median == pytest.approx(np.median(frequencies), rel=2e-3)
    # The second mode's flank moves the peak of a short record: that is why the fit stands beside it.
    assert result.first_frequency_hz.value == pytest.approx(FIRST_HZ, rel=0.01)
    high, low = frequencies.max(), frequencies.min()
    assert result.peaks.deviation_percent == pytest.approx(100 * (high - low) / (high + low), abs=0.5)
    assert result.damping_ratio is not None
    assert result.damping_ratio.median == pytest.approx(ZETA, rel=0.02)


def test_one_file_a_blow_and_one_column_a_blow_say_the_same(tmp_path) -> None:
    signal = answer([FIRST_HZ] * 3)
    parts = [signal[(s - 0.02 <= TIME) & (s + 0.9 > TIME)] for s in BLOWS_S]
    time = np.arange(len(parts[0])) / 1e3
    parts = [part[: len(time)] for part in parts]
    files = [write(tmp_path / f"blow{i}.csv", [part], time=time) for i, part in enumerate(parts)]
    together = write(tmp_path / "all.csv", parts, time=time)
    apart = identify_impulses(files)[0]
    assert apart.first_frequency_hz == identify_impulses([together])[0].first_frequency_hz
    assert apart.blows[0].channel == "blow0: q1"


def test_three_answers_tell_the_mean_with_student_s_interval(tmp_path) -> None:
    blows = [FIRST_HZ, 1.02 * FIRST_HZ, 0.99 * FIRST_HZ]
    mean = identify_impulses([write(tmp_path / "x.csv", [answer(blows)])])[0].first_frequency_hz
    # published value: Student's t, 97.5 % with two degrees of freedom
    assert (mean.ci95[1] - mean.value) / mean.std == pytest.approx(4.303, abs=5e-4)


def test_a_joint_that_does_not_answer_is_left_out(tmp_path) -> None:
    silent = 0.05 * np.random.default_rng(9).normal(size=len(TIME))
    result, _ = identify_impulses([write(tmp_path / "x.csv", [answer([FIRST_HZ] * 3), silent])])
    assert {blow.channel for blow in result.blows} == {"q1"}


@pytest.mark.parametrize(
    ("payload_hz", "far"), [(2.47, True), (FIRST_HZ / 4.7, True), (FIRST_HZ / 4.4, False), (50.0, False)]
)
def test_far_enough_means_that_the_arm_is_rigid_to_five_percent(tmp_path, payload_hz, far) -> None:
    result, _ = identify_impulses([write(tmp_path / "x.csv", [answer([FIRST_HZ] * 3)])], payload_hz=payload_hz)
    assert result.payload is not None
    assert result.payload.far_enough is far


def test_noise_alone_has_no_first_frequency(tmp_path) -> None:
    rng = np.random.default_rng(8)
    for _ in range(12):
        file = write(tmp_path / "noise.csv", list(rng.normal(size=(3, len(TIME)))))
        with pytest.raises(NotIdentifiableError, match="no blow"):
            identify_impulses([file])
    with pytest.raises(NotIdentifiableError, match="no blow"):
        identify_impulses([write(tmp_path / "still.csv", [np.zeros(len(TIME))])])


def test_the_command_writes_its_files_and_says_what_it_found(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "x.csv", [answer([FIRST_HZ] * 3)])
    assert run(["impulse", "x.csv", "--frequency", "2.47"]) == 0
    said = capsys.readouterr().out
    assert "far enough" in said
    assert "±" in said
    document = read_json(tmp_path / "x-impulse" / "impulse.json", "tagsway/impulse/1")
    assert document["first_frequency_hz"]["value"] == pytest.approx(FIRST_HZ, rel=0.02)
    assert len((tmp_path / "x-impulse" / "impulse.csv").read_text().splitlines()) == 4
    assert (tmp_path / "x-impulse" / "figures" / "impulse.png").stat().st_size > 10_000
    assert run(["impulse", "x.csv", "--json", "--out", "again"]) == 0
    assert json.loads(capsys.readouterr().out)["payload"] is None


@pytest.mark.parametrize(
    ("text", "options", "code", "word"),
    [
        ("time_s,q1\n0,1\n", ["--frequency", "-1"], 2, "--frequency"),
        ("a,b\n1,2\n2,3\n", [], 2, "time column"),
        ("time_s\n1\n", [], 2, "no columns"),
        ("time_s,q1\n0,1\n0.001,2\n0.002,1\n", [], 3, "no blow"),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path, monkeypatch, capsys, text, options, code, word) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.csv").write_text(text)
    assert run(["impulse", "x.csv", *options]) == code
    error = capsys.readouterr().err
    assert word in error
    assert error.count("\n") == 1
    assert not (tmp_path / "x-impulse").exists()


def test_uneven_times_are_refused() -> None:
    time = TIME.copy()
    time[100:] += 0.01
    with pytest.raises(InputError, match="not even"):
        find_blows(time, answer([FIRST_HZ] * 3), channel="q1")
