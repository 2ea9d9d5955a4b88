"""Studies: the rows follow from the simulation, and document 1's Table 8.5 from an independent implementation."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pendulum_scenes import MASS_KG, G
from tagsway.errors import InputError
from tagsway.model import DesignMode, Pendulum, StudyRow
from tagsway.shapers import design_shaper
from tagsway.simulation import Payload, hang_pendulums, simulate_moves, vary_modes
from tagsway.store.moves import read_move
from tagsway.studies import (
    UNSHAPED,
    Limit,
    find_pairs,
    shapings_of,
    study_accelerations,
    study_deviations,
    study_limits,
)

MOVE = read_move(Path(__file__).parents[1] / "sample_data" / "move.toml")
FLEXIBLE = Pendulum(
    length_m=0.04585, tag_radius_m=0.04585, stiffness_over_inertia_rad2_s2=0.0129707 / (MASS_KG * 0.04585**2)
)
ZV = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
PLACE_M = 0.35


def spread_payload(damping_ratio: float) -> Payload:
    return vary_modes(FLEXIBLE, 2.4727 * (1 + 0.1146 * np.linspace(-1, 1, 21)), damping_ratio)


@pytest.mark.parametrize(
    ("shaping", "acceleration", "limit", "most"),
    [
        (0, 7.25, "pcp_acceleration_m_s2", 20.0),
        (1, 11.5, "pcp_acceleration_m_s2", 20.0),
        (2, 19.0, "pcp_acceleration_m_s2", 20.0),
        (0, 1.3, "overshoot_percent", 2.0),
        (1, 4.75, "overshoot_percent", 2.0),
        (2, 5.0, "overshoot_percent", 2.0),
    ],
)
def test_table_8_5_as_recomputed_by_another_implementation(
    shaping: int, acceleration: float, limit: str, most: float
) -> None:
    step = 0.1 if acceleration < 3 else 0.25
    scan = [acceleration - step, acceleration, acceleration + step]
    found, _ = study_limits(
        MOVE,
        scan,
        spread_payload(0.083),
        [shapings_of(ZV)[shaping]],
        [Limit(quantity=limit, most=most)],  # type: ignore[arg-type]
        reference_m=PLACE_M,
    )
    assert found[0].last_feasible is not None
    assert found[0].last_feasible.max_acceleration_m_s2 == acceleration  # published value, on the scan's grid
    assert found[0].reached


def test_feasibility_that_comes_and_goes_has_two_answers() -> None:
    scan = np.arange(1.5, 5.6, 0.5)
    limits = [Limit(quantity="box_error_m", most=0.015)]
    ((found,), rows) = study_limits(MOVE, scan, spread_payload(0.083), [UNSHAPED], limits, reference_m=PLACE_M)
    kept = [row.max_acceleration_m_s2 for row in rows if row.box_error_m is not None and row.box_error_m <= 0.015]
    assert found.before_first is not None
    assert found.last_feasible is not None
    assert found.before_first.max_acceleration_m_s2 == 1.5 < 4.0 < found.last_feasible.max_acceleration_m_s2 == kept[-1]


def test_a_limit_that_nothing_meets_or_nothing_breaks_says_so() -> None:
    limits = [Limit(quantity="overshoot_percent", most=1e-6), Limit(quantity="pcp_acceleration_m_s2", most=1e5)]
    found, _ = study_limits(MOVE, [2.0, 3.0], hang_pendulums(FLEXIBLE), [UNSHAPED], limits)
    impossible, endless = found
    assert impossible.before_first is None
    assert impossible.last_feasible is None
    assert impossible.reached
    assert not endless.reached
    assert endless.before_first == endless.last_feasible
    assert endless.last_feasible is not None
    assert endless.last_feasible.max_acceleration_m_s2 == 3.0


def test_a_row_is_the_worst_of_the_samples() -> None:
    payload = spread_payload(0.05)
    rows = study_accelerations(MOVE, [3.0, 6.0], payload, shapings_of(ZV), reference_m=PLACE_M)
    assert [(row.shaping, row.max_acceleration_m_s2) for row in rows] == [
        (name, a) for name in ("unshaped", "x", "x,z") for a in (3.0, 6.0)
    ]
    fast = replace(MOVE, max_acceleration_m_s2=6.0)
    found = simulate_moves(shapings_of(ZV)[1].plan(fast, 6.0), payload, step_s=1e-3).judge(reference_m=PLACE_M)
    row = rows[3]
    assert row.overshoot_percent == pytest.approx(found.overshoot_percent.max(), rel=1e-3)  # discretisation
    assert row.pcp_acceleration_m_s2 == pytest.approx(found.horizontal_m_s2.max(), rel=2e-3)
    assert row.motion_time_s == pytest.approx(found.motion_time_s.max(), abs=2e-3)
    assert row.overshoot_ratio_percent == pytest.approx(100 * row.overshoot_percent / rows[1].overshoot_percent)
    assert row.trajectory_time_s == pytest.approx(2.517484 / np.sqrt(6) + ZV.duration_s, abs=1e-5)  # published


def test_the_deviations_refer_to_the_unshaped_move_at_the_nominal_frequency() -> None:
    frequency = np.array([2.11, 2.4727, 2.77])
    payload = vary_modes(FLEXIBLE, frequency, 0.1)
    rows = study_deviations(MOVE, payload, shapings_of(ZV), nominal=1)
    assert [row.frequency_hz[0] for row in rows[:3]] == pytest.approx(frequency)
    assert rows[1].overshoot_ratio_percent == pytest.approx(100)
    for row in rows:
        assert row.overshoot_ratio_percent == pytest.approx(100 * row.overshoot_percent / rows[1].overshoot_percent)
    shaped = [row.overshoot_percent for row in rows if row.shaping == "x,z"]
    assert shaped[1] < min(shaped[0], shaped[2])  # best where it was designed for


def test_max_pcp_accelerations_of_tables_6_2_and_6_3_follow_within_a_fifth() -> None:
    published = {"unshaped": 10.41, "x": 6.26, "x,z": 5.91}
    payload = vary_modes(FLEXIBLE, np.array([2.4727]), 3.5146e-4)
    rows = study_deviations(replace(MOVE, max_acceleration_m_s2=5.0), payload, shapings_of(ZV), nominal=0)
    for row in rows:
        assert 0.8 < row.pcp_acceleration_m_s2 / published[row.shaping] < 1.2  # published value, "about"


def row(shaping: str, motion: float | None, overshoot: float, push: float = 5.0) -> StudyRow:
    return StudyRow(
        shaping=shaping,
        shaper="zv",
        max_acceleration_m_s2=4.0,
        frequency_hz=(2.0, 2.0),
        trajectory_time_s=1.0,
        settling_time_s=motion,
        motion_time_s=motion,
        pcp_acceleration_m_s2=push,
        pcp_vector_m_s2=np.hypot(push, G),
        overshoot_percent=overshoot,
        overshoot_ratio_percent=None,
        residual_max_m_s2=None,
        residual_rms_m_s2=None,
        residual_reduction_percent=None,
        box_error_m=None,
        place_error_m=None,
    )


def test_pairs_are_no_slower_and_overshoot_no_more() -> None:
    plain, lost = row("unshaped", 1.5, 3.0), row("unshaped", None, 9.0)
    same, slower, wilder, never = row("x", 1.5, 3.0), row("x", 1.6, 1.0), row("x", 1.0, 3.1, 6.0), row("x", None, 1.0)
    pairs = find_pairs([plain, lost, same, slower, wilder, never])
    assert [(pair.unshaped, pair.shaped, pair.gentler) for pair in pairs] == [
        (plain, same, True),
        (lost, same, True),
        (lost, slower, True),
        (lost, wilder, False),
    ]


@pytest.mark.parametrize("scan", [[], [3.0, 2.0], [2.0, 2.0], [0.0, 1.0], [np.nan]])
def test_accelerations_that_cannot_be_scanned_are_refused(scan: list[float]) -> None:
    with pytest.raises(InputError, match="accelerations"):
        study_limits(MOVE, scan, hang_pendulums(FLEXIBLE), [UNSHAPED], [Limit(quantity="overshoot_percent", most=2.0)])


@pytest.mark.parametrize("most", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_that_is_none_is_refused(most: float) -> None:
    with pytest.raises(InputError, match="expected more than 0"):
        Limit(quantity="overshoot_percent", most=most)


@pytest.mark.slow
def test_the_page_of_recomputed_tables_is_the_script_s() -> None:
    docs = Path(__file__).parents[1] / "docs"
    sys.path.insert(0, str(docs))
    try:
        import recompute_studies
    finally:
        sys.path.remove(str(docs))
    written = (docs / "studies.md").read_text(encoding="utf-8").splitlines()
    # The tables of simulations, whose rounded numbers do not depend on the machine; noise comes after them.
    end = written.index("## What a film makes of the indicators")
    tables = recompute_studies.simulated_tables(MOVE, recompute_studies.deviations_of(MOVE))
    assert [*tables.splitlines(), ""] == written[:end]
