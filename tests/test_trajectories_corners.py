"""Corner planning: the SCARA paper's corners to every printed digit, and corners that no paper has."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagsway.errors import InputError
from tagsway.model import DesignMode, DigitalFilter, Impulse, Shaper
from tagsway.shapers import design_shaper
from tagsway.trajectories import Feed, find_corner_error, plan_corner, plan_feed

NOTES = Path(__file__).parents[2] / "shared" / "notes"
FEED_RATE = 0.16
DAMPED_PERIOD = 1 / (6.34 * math.sqrt(1 - 0.022**2))
MODE = DesignMode(frequency_hz=6.34, damping_ratio=0.022)
ZV, ZVD = design_shaper("zv", MODE), design_shaper("zvd", MODE)
FIR = Shaper(type="fir", modes=(MODE,), impulses=(Impulse(time_s=0, amplitude=1),), box_s=DAMPED_PERIOD)
PREFILTERS = {
    "ZV": ZV,
    "ZVD": ZVD,
    "FIR": FIR,
    "FIR-ZV": replace(ZV, box_s=DAMPED_PERIOD),
    "FIR-ZVD": replace(ZVD, box_s=DAMPED_PERIOD),
}


def feed(name: str, length_m: float = 0.5, rate_m_s: float = FEED_RATE) -> Feed:
    return plan_feed(length_m, max_velocity_m_s=rate_m_s, shaper=PREFILTERS[name])


def distances(first: Feed, second: Feed, angle_rad: float, cornering_time_s: float, n: int = 200_001) -> np.ndarray:
    """The distance from the corner while both ways are under way, from their samples."""
    begin = first.distance.duration_s - cornering_time_s
    time = np.linspace(begin, first.distance.duration_s, n)
    left = first.length_m - first.distance(time)[:, 0]
    gone = second.distance(time - begin)[:, 0]
    return np.sqrt(left**2 + gone**2 - 2 * left * gone * math.cos(angle_rad))


@pytest.fixture(scope="module")
def published() -> dict:
    if not NOTES.exists():
        pytest.skip("the published values are not beside this clone")
    return json.loads((NOTES / "acceptance.json").read_text(encoding="utf-8"))["4_seed004"]


@pytest.mark.parametrize("name", PREFILTERS)
def test_ramps_take_the_scara_papers_deceleration_times(published, name):
    assert feed(name).ramp_s == pytest.approx(published["Tdec_s"][name], abs=5.1e-9)  # published value


@pytest.mark.parametrize("name", PREFILTERS)
def test_cornering_delay_and_error_times_are_the_scara_papers(published, name):
    ramp = feed(name)
    for degrees, printed in published["tc_td_te_ms_at_500um"][name].items():
        corner = plan_corner(ramp, ramp, angle_rad=math.radians(float(degrees)), error_m=5e-4)
        times = [corner.cornering_time_s, corner.delay_time_s, corner.error_time_s]
        assert [1e3 * time for time in times] == pytest.approx(printed, abs=6e-6)  # published value
        assert corner.error_m == pytest.approx(5e-4, rel=1e-9)


@pytest.mark.parametrize("name", PREFILTERS)
def test_the_error_of_the_quickest_corner_is_the_scara_papers(published, name):
    ramp = feed(name)
    for degrees, printed_mm in published["error_mm_if_tc=Tdec"][name].items():
        angle = math.radians(float(degrees))
        corner = find_corner_error(ramp, ramp, angle_rad=angle, cornering_time_s=ramp.ramp_s)
        assert 1e3 * corner.error_m == pytest.approx(printed_mm, abs=6e-6)  # published value


@pytest.mark.parametrize("name", PREFILTERS)
def test_no_error_means_a_stop_at_the_corner(name):
    ramp = feed(name)
    corner = plan_corner(ramp, ramp, angle_rad=1.0, error_m=0.0)
    assert (corner.cornering_time_s, corner.error_m) == (0.0, 0.0)
    assert corner.delay_time_s == corner.error_time_s == ramp.ramp_s


@pytest.mark.parametrize("degrees", [1, 30, 90, 150, 180])
def test_a_trapezoid_has_the_closed_form_of_its_corner(degrees):
    ramp, angle = feed("FIR"), math.radians(degrees)
    time = 2 * math.sqrt(DAMPED_PERIOD * 5e-5 / (FEED_RATE * math.sin(angle / 2)))
    corner = plan_corner(ramp, ramp, angle_rad=angle, error_m=5e-5)
    assert corner.cornering_time_s == pytest.approx(time, rel=1e-9)  # identity
    assert corner.error_time_s == pytest.approx(DAMPED_PERIOD - time / 2, rel=1e-7)  # identity


@pytest.mark.parametrize("degrees", [20, 60, 90, 120, 145])
@pytest.mark.parametrize("shaper", [ZV, ZVD], ids=["ZV", "ZVD"])
def test_an_impulse_shaper_has_the_closed_form_of_its_corner(shaper, degrees):
    ramp, angle, error = plan_feed(0.5, max_velocity_m_s=FEED_RATE, shaper=shaper), math.radians(degrees), 1e-4
    last, first = shaper.impulses[-1].amplitude, shaper.impulses[0].amplitude
    root = math.sqrt(last**2 + first**2 + 2 * last * first * math.cos(angle))
    time = error * root / (FEED_RATE * last * first * math.sin(angle))
    assert plan_corner(ramp, ramp, angle_rad=angle, error_m=error).cornering_time_s == pytest.approx(time, rel=1e-9)


@pytest.mark.parametrize(("name", "degrees"), [("ZV", 158.9), ("ZVD", 150.6)])
def test_above_its_angle_the_foot_is_gone_and_the_least_distance_counts(name, degrees):
    ramp = feed(name)
    below, above = (
        plan_corner(ramp, ramp, angle_rad=math.radians(degrees + side), error_m=5e-4) for side in (-0.1, 0.1)
    )
    assert below.perpendicular  # published value
    assert not above.perpendicular
    for corner in (below, above):
        least = np.min(distances(ramp, ramp, corner.angle_rad, corner.cornering_time_s))
        assert least == pytest.approx(5e-4, abs=2e-8)  # discretisation


@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    names=st.tuples(st.sampled_from(sorted(PREFILTERS)), st.sampled_from(sorted(PREFILTERS))),
    rates=st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5)),
    lengths=st.tuples(st.floats(0.005, 0.5), st.floats(0.005, 0.5)),
    angle=st.floats(0.05, math.pi),
    error=st.floats(1e-5, 2e-3),
)
def test_any_two_ways_pass_within_the_error_and_no_more_slowly_than_they_must(names, rates, lengths, angle, error):
    first, second = (feed(*each) for each in zip(names, lengths, rates, strict=True))
    corner = plan_corner(first, second, angle_rad=angle, error_m=error)
    least = np.min(distances(first, second, angle, corner.cornering_time_s, 20_001))
    assert least == pytest.approx(corner.error_m, abs=2e-5 * max(rates))  # discretisation
    assert corner.error_m <= error * (1 + 1e-9)
    longest = min(first.ramp_s, second.ramp_s, first.distance.duration_s / 2, second.distance.duration_s / 2)
    assert corner.error_m == pytest.approx(error, rel=1e-6) or corner.cornering_time_s == longest


def test_a_straight_corner_is_no_corner():
    ramp = feed("FIR-ZVD")
    corner = plan_corner(ramp, ramp, angle_rad=0.0, error_m=1e-6)
    assert corner.cornering_time_s == ramp.ramp_s
    assert corner.error_m < 1e-15  # identity


@pytest.mark.parametrize("angle", [-0.1, 3.2, math.nan])
def test_an_angle_beyond_half_a_turn_is_refused(angle):
    with pytest.raises(InputError, match="direction"):
        plan_corner(feed("ZV"), feed("ZV"), angle_rad=angle, error_m=1e-3)


@pytest.mark.parametrize("error", [-1e-6, math.nan])
def test_an_error_that_is_none_is_refused(error):
    with pytest.raises(InputError, match="cornering error"):
        plan_corner(feed("ZV"), feed("ZV"), angle_rad=1.0, error_m=error)


@pytest.mark.parametrize("time", [-1e-3, 0.2, math.nan])
def test_a_cornering_time_longer_than_the_ramp_is_refused(time):
    with pytest.raises(InputError, match="cornering time"):
        find_corner_error(feed("ZV"), feed("ZV"), angle_rad=1.0, cornering_time_s=time)


@pytest.mark.parametrize(
    "changes", [{"time_scale": 1.1}, {"filter": DigitalFilter(numerator=(1.0,), denominator=(0.1, 1.0))}], ids=str
)
def test_a_feed_takes_no_filter_and_no_time_scale(changes):
    with pytest.raises(InputError, match="without filter or time scale"):
        plan_feed(0.5, max_velocity_m_s=0.16, shaper=replace(ZV, **changes))


@pytest.mark.parametrize(
    ("length", "rate"), [(0.0, 1.0), (math.nan, 1.0), (math.inf, 1.0), (1.0, 0.0), (1.0, math.nan)]
)
def test_a_feed_over_no_way_or_at_no_rate_is_refused(length, rate):
    with pytest.raises(InputError, match="planned"):
        plan_feed(length, max_velocity_m_s=rate)
