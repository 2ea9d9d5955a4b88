"""The loop closed on rendered videos: what a design promises is what a second video sees; retune corrects the rest."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from closed_loop import (
    MOVE,
    WINDOW_MM,
    close_loop,
    design_for,
    film,
    film_design,
    from_rest,
    loop_scene,
    with_trajectory,
)
from tagsway.cli.app import run
from tagsway.design import PriorPayload, ResidualRecord, retune_shaper
from tagsway.design.motion import find_way
from tagsway.design.residual import simulate_sways
from tagsway.design.retune import _notices
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, DesignMode, Estimate, Mode, Move, Pendulum
from tagsway.scene import simulate_scene
from tagsway.shapers import design_shaper, given_shaper
from tagsway.simulation import hang_pendulums, simulate_moves
from tagsway.store.designs import retune_document
from tagsway.store.documents import read_shaper, write_shaper
from tagsway.trajectories import apply_shaper, plan_move

LENGTH_M, DESIGNED_HZ, DAMPING = 0.05, 2.5, 0.03
PRIOR = PriorPayload(
    mode=Mode(natural_frequency_hz=DESIGNED_HZ, damping_ratio=DAMPING),
    length_m=Estimate.normal(LENGTH_M, 5e-4),
    tag_radius_m=LENGTH_M,
)
LEVEL = Move(from_m=(-0.2, 0, 0), to_m=(0.2, 0, 0), profile="bang-bang", max_acceleration_m_s2=4.0)
LIFTED = replace(LEVEL, profile="pick-and-place", pick_height_m=0.02, place_height_m=0.02)
RECORD_S = 1.5
OFFERED = ("zv", "zvd", "ei", "zv")
CHOOSING = (3, 15)
"""Scenes that are offered each of them, the others one: choosing takes most of the time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A move of a payload whose frequency is another one than its shaper was designed for."""

    move: Move
    true_hz: float
    drag_per_rad: float = 0.0
    kind: str = "zv"

    def plan(self, shaper):
        return apply_shaper(plan_move(self.move), shaper, ("x",))

    def velocity(self, shaper, start_s: float = 0.0):
        trajectory = self.plan(shaper)
        way = find_way(trajectory)

        def of(time_s):
            vectors = trajectory(time_s - start_s, 1)
            return np.stack([vectors @ way, vectors[:, 2]], axis=1)

        return of, trajectory.duration_s

    def sway(self, shaper):
        """Return times, the true sway, and when the move ends."""
        omega = 2 * np.pi * self.true_hz
        payload = hang_pendulums(
            Pendulum(
                length_m=LENGTH_M,
                tag_radius_m=LENGTH_M,
                stiffness_over_inertia_rad2_s2=omega**2 - GRAVITY_M_S2 / LENGTH_M,
                damping_over_inertia_rad_s=2 * DAMPING * omega,
                quadratic_drag_per_rad=self.drag_per_rad,
            )
        )
        trajectory = self.plan(shaper)
        motion = simulate_moves(trajectory, payload, rest_s=RECORD_S)
        time, first = np.unique(motion.time_s[:, 0], return_index=True)
        return time, (motion.pcp_m[:, 0, 0, 0] - motion.pivot_m[:, 0, 0, 0])[first], trajectory.duration_s

    def residual_m(self, shaper) -> float:
        time, sway, end = self.sway(shaper)
        return float(np.abs(sway[time >= end]).max())

    def retune(self, *, noise_m: float = 5e-5, seed: int = 1, known: bool = True):
        """Return what a film of 200 Hz makes of it, and the shaper that was used."""
        shaper = design_shaper(self.kind, DesignMode(frequency_hz=DESIGNED_HZ, damping_ratio=DAMPING))
        record = self.record(shaper, noise_m=noise_m, seed=seed)
        replan = self.velocity if known else None
        return retune_shaper(record, shaper, PRIOR, replan=replan, rng=np.random.default_rng(1)), shaper

    def record(self, shaper, *, noise_m: float = 5e-5, seed: int = 1) -> ResidualRecord:
        fine, sway, end = self.sway(shaper)
        time = np.arange(0, end + RECORD_S, 0.005)
        noise = np.random.default_rng(seed).normal(0, noise_m, len(time))
        return ResidualRecord(
            time_s=time,
            sway_m=np.interp(time, fine, sway) + noise,
            start_s=0.0,
            end_s=end,
            velocity=self.velocity(shaper)[0],
        )


@pytest.mark.parametrize("true_hz", [2.3, 2.45, 2.7])
def test_amplitude_and_phase_of_a_residual_tell_the_frequency(true_hz) -> None:
    found, _ = Case(move=LEVEL, true_hz=true_hz).retune()
    frequency = found.natural_frequency_hz
    # Statistics: four standard errors; those are small enough to be of use.
    assert frequency.value == pytest.approx(true_hz, abs=4 * frequency.std)
    assert frequency.std < 0.01 * true_hz
    assert found.shaper.modes[0].frequency_hz == pytest.approx(frequency.value, rel=1e-12)


def test_the_stated_error_of_the_frequency_covers_the_truth() -> None:
    errors = []
    for seed in range(5):
        found, _ = Case(move=LEVEL, true_hz=2.575).retune(noise_m=2e-4, seed=seed)
        frequency = found.natural_frequency_hz
        errors.append((frequency.value - 2.575) / frequency.std)
    # Statistics: the root mean square of five standard normals lies below 2.1 in 99.9 %.
    assert np.sqrt(np.mean(np.square(errors))) < 2.1


@pytest.mark.parametrize(("move", "drag"), [(LEVEL, 0.0), (LIFTED, 0.05)], ids=["level", "lifted with drag"])
def test_the_gain_is_what_the_corrected_shaper_gains_within_its_error(move, drag) -> None:
    errors = []
    for seed, true_hz in enumerate([2.3, 2.4, 2.7]):
        case = Case(move=move, true_hz=true_hz, drag_per_rad=drag)
        found, shaper = case.retune(noise_m=1e-4, seed=seed)
        gained = 1 - case.residual_m(found.shaper) / case.residual_m(shaper)
        errors.append((gained - found.gain.value) / found.gain.std)
    # Statistics: the root mean square of three standard normals lies below 2.4 in 99.9 %.
    assert np.sqrt(np.mean(np.square(errors))) < 2.4


def test_a_shaper_for_a_wrong_frequency_is_worth_correcting_on_a_level_move() -> None:
    found, _ = Case(move=LEVEL, true_hz=2.25).retune()
    assert found.gain.value > 0.7
    assert not found.notices


def test_a_residual_that_the_lift_makes_is_not_promised_away() -> None:
    case = Case(move=LIFTED, true_hz=DESIGNED_HZ)
    found, shaper = case.retune()
    # The shaper is right already: what it leaves of this move is no matter of its frequency.
    assert case.residual_m(shaper) > 1e-3
    assert abs(found.gain.value) < 0.15
    worse, _ = Case(move=LIFTED, true_hz=2.375).retune()
    assert worse.gain.value < 0
    assert [notice.code for notice in worse.notices] == ["nothing_to_gain"]


def test_a_gain_that_is_merely_uncertain_is_not_laid_to_another_cause() -> None:
    # The corrected shaper takes 40 % of it; without the move that is 6 ± 34 %.
    case = Case(move=LEVEL, true_hz=2.4)
    found, shaper = case.retune(known=False)
    assert case.residual_m(found.shaper) < 0.7 * case.residual_m(shaper)
    (told,) = found.notices
    assert told.code == "gain_uncertain"
    assert "--move" in told.message
    assert "lift" not in told.message
    assert [notice["code"] for notice in retune_document(found)["warnings"]] == ["gain_uncertain"]


def test_an_uncertain_gain_asks_for_the_move_only_where_it_was_not_given() -> None:
    (told,) = _notices(Estimate.normal(0.06, 0.34), simulated=True)
    assert told.code == "gain_uncertain"
    assert "--move" not in told.message
    assert [one.code for one in _notices(Estimate.normal(0.05, 0.04), simulated=True)] == ["nothing_to_gain"]
    assert [one.code for one in _notices(Estimate.normal(0.05, 0.06), simulated=True)] == ["gain_uncertain"]


@pytest.mark.parametrize(("move", "true_hz"), [(LEVEL, 2.25), (LIFTED, 2.75), (LIFTED, 2.375)])
def test_without_the_move_only_the_linear_part_is_promised_away(move, true_hz) -> None:
    case = Case(move=move, true_hz=true_hz)
    found, _ = case.retune(known=False)
    left = case.residual_m(found.shaper)
    # Statistics: three standard errors, which are wide here.
    assert found.expected_m.value == pytest.approx(left, abs=3 * found.expected_m.std)
    assert found.expected_m.std > 0.05 * found.expected_m.value


def test_a_trial_payload_that_flies_off_is_infinitely_wrong_and_hides_no_other() -> None:
    case = Case(move=LEVEL, true_hz=2.5)
    shaper = design_shaper("zv", DesignMode(frequency_hz=DESIGNED_HZ, damping_ratio=DAMPING))
    nodes, (velocity, _) = np.linspace(0.0, 3.0, 601), case.velocity(shaper)
    sound = [np.log(DESIGNED_HZ), DAMPING, np.log(LENGTH_M), 0.0, 1.0, 0.0]
    driven = [*sound[:3], -300.0, 1.0, 0.0]  # a drag below zero feeds the swing
    found = simulate_sways(velocity, nodes, np.array([sound, driven]), PRIOR, nodes)
    alone = simulate_sways(velocity, nodes, np.array([sound]), PRIOR, nodes)
    assert np.all(np.isinf(found[:, 1]))
    np.testing.assert_allclose(found[:, 0], alone[:, 0], rtol=1e-12, atol=1e-15)  # identity


def test_a_residual_within_the_noise_is_not_tuned() -> None:
    case = Case(move=LEVEL, true_hz=2.5)
    shaper = design_shaper("zv", DesignMode(frequency_hz=DESIGNED_HZ, damping_ratio=DAMPING))
    record = case.record(shaper)
    quiet = replace(record, sway_m=np.random.default_rng(1).normal(0, 1e-4, len(record.time_s)))
    with pytest.raises(NotIdentifiableError, match="nothing"):
        retune_shaper(quiet, shaper, PRIOR, rng=np.random.default_rng(1))


def test_what_cannot_be_retuned_is_refused() -> None:
    case = Case(move=LEVEL, true_hz=2.4)
    shaper = design_shaper("zv", DesignMode(frequency_hz=DESIGNED_HZ, damping_ratio=DAMPING))
    record, rng = case.record(shaper), np.random.default_rng(1)
    unseen = replace(record, sway_m=np.full(len(record.time_s), np.nan))
    with pytest.raises(NotIdentifiableError, match="0 frames after the move"):
        retune_shaper(unseen, shaper, PRIOR, rng=rng)
    with pytest.raises(InputError, match="designed anew"):
        retune_shaper(record, given_shaper([0, 0.2], [0.5, 0.5]), PRIOR, rng=rng)


@pytest.mark.slow
@pytest.mark.parametrize("index", range(20))
def test_a_second_video_sees_what_the_design_promised(index, tmp_path) -> None:
    kinds = OFFERED[:3] if index in CHOOSING else (OFFERED[index % len(OFFERED)],)
    loop = close_loop(loop_scene(index), tmp_path, kinds=kinds)
    assert loop.chosen["share_kept"] >= 0.95
    assert loop.seen_mm <= WINDOW_MM
    assert loop.true_mm <= WINDOW_MM
    # Statistics: three standard errors. What the coder does to tags of 20 px is off by 1.5 of the error that track.csv
    # states (benchmarks/loop.py): a peak is held back, whole swings long, where a mean of many frames would not be.
    assert loop.seen_mm == pytest.approx(loop.filmed_mm, abs=5 * loop.stated_mm)
    # What one camera cannot tell: a sway of 1.6 mm towards it, 140 mm beside the picture's middle, looks like 0.15 mm.
    assert loop.filmed_mm == pytest.approx(loop.true_mm, abs=1.01 * loop.aside_mm)
    assert loop.aside_mm < 0.25


@pytest.mark.slow
def test_a_second_video_tells_a_design_for_another_payload(tmp_path) -> None:
    scene = loop_scene(0)
    wrong = ["--frequency", f"{1.2 * scene.payload.natural_frequency_hz:.4f}", "--damping", "0.03", "--length", "50"]
    design_for(wrong, tmp_path, kinds=("zv",))
    loop = film_design(scene, tmp_path)
    assert loop.chosen["share_kept"] >= 0.95
    assert loop.seen_mm > 1.5 * WINDOW_MM
    assert loop.seen_mm == pytest.approx(loop.filmed_mm, abs=4 * loop.stated_mm)


@pytest.mark.slow
def test_retune_corrects_a_shaper_that_was_designed_for_another_payload(tmp_path, capsys) -> None:
    scene = loop_scene(2)
    truth = scene.payload.natural_frequency_hz
    wrong = DesignMode(frequency_hz=0.9 * truth, damping_ratio=0.03)
    write_shaper(tmp_path / "shaper.json", design_shaper("zv", wrong))
    (tmp_path / "move.toml").write_text(MOVE, encoding="utf-8")
    move = ["--move", str(tmp_path / "move.toml")]
    command = ["trajectory", "--shaper", str(tmp_path / "shaper.json"), *move]
    assert run([*command, "--out", str(tmp_path / "trajectory.csv")]) == 0
    film(with_trajectory(scene, tmp_path)[0], tmp_path / "second")
    capsys.readouterr()
    options = ["--shaper", str(tmp_path / "shaper.json"), "--out", str(tmp_path / "new.json"), "--json"]
    assert run(["retune", str(tmp_path / "second" / "result.json"), *options, *move]) == 0
    document = json.loads(capsys.readouterr().out)
    found = document["natural_frequency_hz"]
    # The second body and the drag, which the fit does not know, move the mode by some percent.
    assert found["value"] == pytest.approx(truth, rel=0.04)
    assert read_shaper(tmp_path / "new.json").modes[0].frequency_hz == pytest.approx(found["value"], rel=0.02)
    gain, now = document["gain"], document["residual"]["now_mm"]["value"]
    # Run the corrected shaper: what was promised of it is what a third video's scene does.
    shaper = ["trajectory", "--shaper", str(tmp_path / "new.json"), *move]
    assert run([*shaper, "--out", str(tmp_path / "trajectory.csv")]) == 0
    again, end = with_trajectory(scene, tmp_path)
    true = simulate_scene(again, np.arange(end, again.duration_s, 2e-3))
    left = np.abs(from_rest(1e3 * (true.pcp_m[:, 0] - true.tcp_m[:, 0]))).max()
    assert gain["value"] > 0.3
    # Statistics: three of its errors, and 5 % for a camera that sees the sway out of the plane as one in it.
    assert 1 - left / now == pytest.approx(gain["value"], abs=3 * gain["std"] + 0.05)
