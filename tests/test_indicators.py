"""Indicators of moves whose answers are known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.filters import clean_track
from tagsway.indicators import indicators_of, measure_indicators
from tagsway.model import GRAVITY_M_S2, FloatArray, TagTrack, Track, Window

START_S, ACCELERATION, TRAVEL_M = 0.5, 5.0, 0.7
END_S = START_S + 2 * np.sqrt(TRAVEL_M / ACCELERATION)
OMEGA, DECAY, SWAY_M = 2 * np.pi * 2.5, 0.8, 0.03
TIME = np.arange(900) / 200


def tool(time_s: FloatArray, *, direction: float = 1.0) -> FloatArray:
    half = (END_S - START_S) / 2
    t = np.clip(time_s - START_S, 0, 2 * half)
    x = np.where(t < half, ACCELERATION * t**2 / 2, TRAVEL_M - ACCELERATION * (2 * half - t) ** 2 / 2)
    return np.stack([direction * x, 0 * x], axis=1)


def product(time_s: FloatArray, *, direction: float = 1.0) -> FloatArray:
    """Return the tool's path and, once it stands, a decaying sine beneath it that starts beyond the end."""
    t = np.maximum(time_s - END_S, 0)
    sway = np.where(time_s > END_S, SWAY_M * np.exp(-DECAY * t) * np.sin(OMEGA * t), 0.0)
    return tool(time_s, direction=direction) + np.stack([direction * sway, np.full(len(sway), -0.05)], axis=1)


def track_of(tcp: FloatArray | None, pcp: FloatArray, *, time_s: FloatArray = TIME, noise_m: float = 2e-5) -> Track:
    rng = np.random.default_rng(1)

    def tag(position: FloatArray) -> TagTrack:
        angle = np.full(len(position), np.nan)
        return TagTrack(
            position=position + noise_m * rng.normal(size=position.shape),
            position_std=np.full(position.shape, noise_m),
            angle_rad=angle,
            angle_std_rad=angle,
        )

    return Track(
        frame=np.arange(len(time_s)),
        time_s=time_s,
        length_unit="m",
        pcp=tag(pcp),
        tcp=None if tcp is None else tag(tcp),
    )


FREE = Window(start_s=END_S + 0.05, end_s=4.4)


def last_crossing(band: float) -> float:
    """Return when the envelope's sine leaves the band for the last time, from the start of the move."""
    fine = np.linspace(0, 4.4 - END_S, 400_001)
    outside = SWAY_M * np.exp(-DECAY * fine) * np.abs(np.sin(OMEGA * fine)) > band
    return float(fine[np.flatnonzero(outside)[-1]]) + END_S - START_S


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_measured_move_has_the_known_indicators(direction: float) -> None:
    track = track_of(tool(TIME, direction=direction), product(TIME, direction=direction))
    found = measure_indicators(track, clean_track(track), FREE)
    assert found is not None
    peak = SWAY_M * np.exp(-DECAY * np.arctan(OMEGA / DECAY) / OMEGA) * OMEGA / np.hypot(OMEGA, DECAY)
    assert found.reference_m == pytest.approx(TRAVEL_M, abs=1e-3)
    assert found.trajectory_time_s == pytest.approx(END_S - START_S, abs=0.02)  # discretisation: two samples an end
    assert found.overshoot_percent == pytest.approx(100 * peak / TRAVEL_M, rel=0.03)
    assert found.settling_time_s == pytest.approx(last_crossing(0.02 * TRAVEL_M), abs=0.015)
    assert found.motion_time_s == found.settling_time_s
    residual = found.residual_acceleration_m_s2
    assert residual is not None
    seconds = 4.4 - END_S
    mean_square = (SWAY_M * OMEGA**2) ** 2 / 2 * (1 - np.exp(-2 * DECAY * seconds)) / (2 * DECAY * seconds)
    # statistics; the jolt with which this sway begins reaches a few samples into the rest
    assert residual.rms == pytest.approx(np.sqrt(mean_square), rel=0.15)
    assert residual.max > 0.8 * SWAY_M * OMEGA**2
    accelerations = found.max_pcp_acceleration_m_s2
    assert accelerations.horizontal is not None
    assert accelerations.vector_with_gravity is not None
    assert accelerations.horizontal.std > 0
    assert accelerations.bandwidth_hz > 10


def test_peak_acceleration_of_a_smooth_motion_is_right_within_its_error() -> None:
    time = np.arange(1200) / 200
    x = 0.35 * (1 - np.cos(np.pi * np.clip((time - 0.5) / 0.8, 0, 1)))
    sway = np.where(time > 1.3, 0.02 * np.sin(2 * np.pi * 2 * (time - 1.3)) ** 3, 0.0)
    tcp, pcp = np.stack([x, 0 * x], axis=1), np.stack([x + sway, 0 * x - 0.05], axis=1)
    miss = []
    for seed in range(12):
        track = track_of(tcp, pcp + 5e-5 * np.random.default_rng(seed).normal(size=pcp.shape), time_s=time, noise_m=0)
        track = replace(track, pcp=replace(track.pcp, position_std=np.full(pcp.shape, 5e-5)))
        found = measure_indicators(track, clean_track(track), Window(start_s=1.4, end_s=5.9))
        assert found is not None
        peak = found.max_pcp_acceleration_m_s2.horizontal
        assert peak is not None
        truth = float(np.max(np.abs(np.gradient(np.gradient(pcp[:, 0], time), time)[265:])))
        miss.append((peak.value - truth) / peak.std)
    # statistics: the largest of many noisy values lies above the truth by about two of their errors
    assert -1.5 < np.mean(miss) < 3.5


def simulated(**changes: FloatArray | float) -> dict[str, FloatArray | float]:
    time = np.arange(START_S, 4.4, 1e-3)
    tcp, pcp = tool(time), product(time)
    acceleration = np.gradient(np.gradient(pcp, time, axis=0), time, axis=0)
    values: dict[str, FloatArray | float] = {
        "time_s": time,
        "tcp_m": tcp,
        "pcp_m": pcp,
        "pcp_acceleration_m_s2": acceleration,
        "end_s": float(END_S),
    }
    return {**values, **changes}


def test_a_simulated_move_uses_the_same_definitions() -> None:
    found = indicators_of(**simulated(), bandwidth_hz=500.0)  # type: ignore[arg-type]
    assert found.settling_time_s == pytest.approx(last_crossing(0.02 * TRAVEL_M), abs=2e-3)
    assert found.trajectory_time_s == pytest.approx(END_S - START_S)
    horizontal, vector = (
        found.max_pcp_acceleration_m_s2.horizontal,
        found.max_pcp_acceleration_m_s2.vector_with_gravity,
    )
    assert horizontal is not None
    assert vector is not None
    assert horizontal.std == 0
    assert vector.value == pytest.approx(np.hypot(horizontal.value, GRAVITY_M_S2), rel=1e-6)


def test_a_lifted_product_has_its_error_in_the_box() -> None:
    time = np.arange(START_S, 4.4, 1e-3)
    share = np.clip((time - START_S) / (END_S - START_S), 0, 1)
    lift = np.stack([0 * time, 0.12 * np.sin(np.pi * share)], axis=1)
    found = indicators_of(
        **simulated(tcp_m=tool(time) + lift, pcp_m=product(time) + lift),  # type: ignore[arg-type]
        final_m=np.array([TRAVEL_M, -0.05]),
        bandwidth_hz=500.0,
    )
    below = time > time[np.flatnonzero(lift[:, 1] >= 0.05)[-1]]
    expected = np.abs(product(time)[below, 0] - TRAVEL_M).max()
    assert found.box_error_m == pytest.approx(expected, rel=1e-9)  # identity
    assert indicators_of(**simulated(), bandwidth_hz=500.0).box_error_m is None  # type: ignore[arg-type]


def test_noise_on_a_level_way_below_the_rim_is_no_descent() -> None:
    """The tool crosses 48 mm up, the product swings above the rim of 50 mm once, and lowers 10 mm before its place."""
    time = np.linspace(0, 2, 2001)
    up = 0.048 * np.clip(np.minimum(time, 2 - time) / 0.4, 0, 1)
    along = np.interp(time, [0, 0.4, 1.6, 2.0], [0, 0, 0.69, 0.7])
    noise = np.random.default_rng(3).normal(0, 2e-5, (2, len(time)))
    tcp = np.stack([along, up + noise[0]], axis=1)
    pcp = np.stack([along, up + 0.006 * np.exp(-(((time - 1) / 0.05) ** 2)) - 0.05 + noise[1]], axis=1)
    push = np.zeros_like(pcp)
    found = indicators_of(time, tcp, pcp, push, end_s=2.0, final_m=np.array([0.7, -0.05]), bandwidth_hz=500.0)
    # From a millimetre below the top: 10 mm, less a 48th of the way down.
    assert found.box_error_m == pytest.approx(0.01, abs=3e-4)


def test_a_reference_of_its_own_changes_the_percentages_only() -> None:
    travel = indicators_of(**simulated(), bandwidth_hz=500.0)  # type: ignore[arg-type]
    place = indicators_of(**simulated(), reference_m=0.35, bandwidth_hz=500.0)  # type: ignore[arg-type]
    assert place.overshoot_percent == pytest.approx(2 * travel.overshoot_percent)
    assert place.settling_time_s is not None
    assert travel.settling_time_s is not None
    assert place.settling_time_s > travel.settling_time_s
    assert place.trajectory_time_s == travel.trajectory_time_s


def test_a_payload_still_swinging_never_settles() -> None:
    time = np.arange(START_S, 4.4, 1e-3)
    sway = np.where(time > END_S, 0.05 * np.cos(9 * (time - time[-1])), 0.0)  # it is farthest out at the very end
    pcp = product(time) + np.stack([sway, 0 * time], axis=1)
    found = indicators_of(**simulated(pcp_m=pcp), final_m=np.array([TRAVEL_M, -0.05]), bandwidth_hz=500.0)  # type: ignore[arg-type]
    assert found.settling_time_s is None
    assert found.motion_time_s is None


def test_a_payload_that_rests_with_its_tool_settles_within_the_move() -> None:
    time = np.arange(START_S, 4.4, 1e-3)
    still = tool(time) + np.array([0, -0.05])
    found = indicators_of(**simulated(pcp_m=still), bandwidth_hz=500.0)  # type: ignore[arg-type]
    assert found.settling_time_s is not None
    assert found.settling_time_s < found.trajectory_time_s
    assert found.motion_time_s == found.trajectory_time_s
    assert found.overshoot_percent == pytest.approx(0, abs=1e-3)


def test_a_record_that_ends_with_the_move_has_no_residual() -> None:
    time = np.arange(START_S, END_S, 1e-3)
    found = indicators_of(
        time, tool(time), tool(time), np.zeros((len(time), 2)), end_s=float(time[-1]), bandwidth_hz=500.0
    )
    assert found.residual_acceleration_m_s2 is None


def test_a_move_that_goes_nowhere_is_refused() -> None:
    with pytest.raises(InputError, match="0 mm"):
        indicators_of(**simulated(tcp_m=np.zeros((3900, 2))), bandwidth_hz=500.0)  # type: ignore[arg-type]


def test_a_tool_that_stands_shakes_or_was_not_seen_makes_no_move() -> None:
    rest = np.zeros((len(TIME), 2))
    for tcp in (None, rest, rest + 1e-4 * np.sin(200 * TIME)[:, None], np.full(rest.shape, np.nan)):
        track = track_of(tcp, product(TIME))
        assert measure_indicators(track, clean_track(track), FREE) is None
    pixels = replace(track_of(tool(TIME), product(TIME)), length_unit="px")
    assert measure_indicators(pixels, clean_track(pixels), FREE) is None


def test_only_the_last_of_two_moves_counts() -> None:
    back = tool(TIME) - 0.5 * tool(TIME - 1.6)
    free = Window(start_s=END_S + 1.65, end_s=4.4)
    track = track_of(back, back + np.array([0, -0.05]))
    found = measure_indicators(track, clean_track(track), free)
    assert found is not None
    assert found.reference_m == pytest.approx(TRAVEL_M / 2, abs=1e-3)
    assert found.trajectory_time_s == pytest.approx(END_S - START_S, abs=0.02)  # discretisation: two samples an end


def test_a_tool_that_comes_back_to_its_place_has_no_travel_to_refer_to() -> None:
    back = tool(TIME) - tool(TIME - (END_S - START_S))
    track = track_of(back, back + np.array([0, -0.05]))
    assert measure_indicators(track, clean_track(track), Window(start_s=2.3, end_s=4.4)) is None


@pytest.mark.parametrize("lost", [slice(0, 20), slice(300, 340), slice(880, 900), slice(0, 900)])
def test_gaps_and_missing_ends_leave_numbers_or_none(lost: slice) -> None:
    pcp = product(TIME)
    pcp[lost] = np.nan
    track = track_of(tool(TIME), pcp)
    found = measure_indicators(track, clean_track(track), FREE)
    if lost == slice(0, 900):
        assert found is None
    else:
        assert found is not None
        assert found.overshoot_percent == pytest.approx(3.7, abs=0.8)
