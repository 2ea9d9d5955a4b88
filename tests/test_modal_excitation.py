"""What a move excites, against the transform of its acceleration in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.filters import clean_track
from tagsway.modal.excitation import ExcitationFit, measure_excitation
from tagsway.model import Estimate, FloatArray, TagTrack, Track, Window
from test_filters_moves import ACCELERATION, END_S, START_S, TIME, TRAVEL_M, go

HALF_S = float(np.sqrt(TRAVEL_M / ACCELERATION))
NOISE_M = 3e-5
FREE = Window(start_s=END_S + 0.03, end_s=5.9)


def tag(position: FloatArray, seed: int) -> TagTrack:
    nothing = np.full(len(position), np.nan)
    noise = NOISE_M * np.random.default_rng(seed).standard_normal(position.shape)
    return TagTrack(
        position=position + noise,
        position_std=np.full(position.shape, NOISE_M),
        angle_rad=nothing,
        angle_std_rad=nothing,
    )


def measure(frequency_hz: float, *, std: float = 0.0, gone: bool = False) -> ExcitationFit:
    """Measure a bang-bang move and the linear sway that it leaves."""
    omega = 2 * np.pi * frequency_hz
    pushes = [(0.0, -1.0), (HALF_S, 2.0), (2 * HALF_S, -1.0)]
    rows = [np.where(t < TIME - START_S, a * (1 - np.cos(omega * (TIME - START_S - t))), 0.0) for t, a in pushes]
    sway = ACCELERATION / omega**2 * np.sum(rows, axis=0)
    path = go() if not gone else np.zeros_like(go())
    tool = np.column_stack([path[:, 0], 0 * TIME])
    track = Track(
        frame=np.arange(len(TIME)),
        time_s=TIME,
        length_unit="m",
        tcp=tag(tool, 1),
        pcp=tag(tool + np.column_stack([sway, 0 * TIME - 0.05]), 2),
    )
    return measure_excitation(track, clean_track(track), FREE, frequency_hz=Estimate.normal(frequency_hz, std))


def expected_m_s(frequency_hz: float) -> float:
    """|∫ X'' exp(-iωt) dt| of a acceleration for h and as much deceleration: 4 a sin²(ωh/2) / ω."""
    omega = 2 * np.pi * frequency_hz
    return float(4 * ACCELERATION * np.sin(omega * HALF_S / 2) ** 2 / omega)


@pytest.mark.parametrize("frequency_hz", [1.2, 2.0, 3.6])
def test_a_bang_bang_move_excites_what_its_transform_says(frequency_hz: float) -> None:
    found = measure(frequency_hz).excitation
    assert found is not None
    assert found.sway_m is not None
    omega = 2 * np.pi * frequency_hz
    # discretisation: the smoothing of the jolts
    assert found.sway_m.value == pytest.approx(expected_m_s(frequency_hz) / omega, rel=0.03)
    assert found.share_of_push.value == pytest.approx(
        expected_m_s(frequency_hz) / (2 * ACCELERATION * HALF_S), rel=0.05
    )
    assert found.strongest_hz == pytest.approx(0.371 / HALF_S, rel=0.03)  # where 4 sin²(u) / u is largest: u = 1.1656
    peak = max(expected_m_s(f) for f in np.linspace(0.3, 3, 500))
    assert found.share_of_peak.value == pytest.approx(expected_m_s(frequency_hz) / peak, rel=0.05)


def test_a_move_of_whole_periods_excites_nothing() -> None:
    found = measure(1 / HALF_S).excitation
    assert found is not None
    assert found.share_of_push.value < 0.01


def test_the_error_of_the_frequency_is_carried() -> None:
    sure, unsure = measure(2.0).excitation, measure(2.0, std=0.1).excitation
    assert sure is not None
    assert unsure is not None
    slope = (expected_m_s(2.1) - expected_m_s(1.9)) / 0.2
    assert sure.share_of_push.std < 0.01
    assert unsure.share_of_push.std == pytest.approx(abs(slope) * 0.1 / (2 * ACCELERATION * HALF_S), rel=0.05)


def test_the_product_sways_on_after_the_move_and_the_tool_does_not() -> None:
    curve = measure(2.0).curve
    assert curve.move_s is not None
    assert curve.move_s == pytest.approx((START_S, END_S), abs=0.02)
    assert curve.late_s == pytest.approx((curve.move_s[1] + FREE.end_s) / 2)
    at = int(np.argmin(np.abs(curve.frequency_hz - 2.0)))
    assert curve.frequency_hz[int(np.argmax(curve.pcp_late))] == pytest.approx(2.0, abs=0.05)
    assert curve.pcp_after[at] > 1.8 * curve.pcp_late[at]
    assert curve.tcp_after[at] < 0.01 * curve.tcp_whole[at]


def test_without_a_move_there_are_spectra_but_no_excitation() -> None:
    found = measure(2.0, gone=True)
    assert found.excitation is None
    assert found.curve.move_s is None
    assert np.isfinite(found.curve.pcp_whole).all()


def test_a_tool_that_was_never_seen_leaves_its_spectra_empty() -> None:
    track = Track(frame=np.arange(len(TIME)), time_s=TIME, length_unit="m", pcp=tag(go(), 1))
    found = measure_excitation(track, clean_track(track), FREE, frequency_hz=Estimate.normal(2.0, 0.01))
    assert found.excitation is None
    assert np.isnan(found.curve.tcp_whole).all()
    lost = replace(track, tcp=tag(np.full_like(go(), np.nan), 2))
    assert measure_excitation(lost, clean_track(lost), FREE, frequency_hz=Estimate.normal(2.0, 0.01)).excitation is None
