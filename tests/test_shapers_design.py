"""Several modes, specified bands, filters, grids, choices: closed forms, and an oscillator that knows nothing of V."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tagsway.errors import InputError
from tagsway.model import DesignMode, DigitalFilter, Mode, Shaper, Spread
from tagsway.shapers import (
    IMPULSE_TYPES,
    SHAPER_TYPES,
    Band,
    apply_to_command,
    centroid_delay,
    choose_shaper,
    compare_shapers,
    design_multimode,
    design_shaper,
    design_simultaneous,
    frequency_response,
    given_shaper,
    grid_costs,
    insensitivity,
    kind_for_band,
    overshoot_ratio,
    place_on_grid,
    residual_curve,
    residual_of_sample,
    residual_vibration,
    sensitivity_curves,
    step_indicators,
    step_response,
)

FLEXIBLE = DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4)
DAMPED = DesignMode(frequency_hz=2.0, damping_ratio=0.05)
SLOW, FAST = DesignMode(frequency_hz=2.5, damping_ratio=0.02), DesignMode(frequency_hz=7.0, damping_ratio=0.05)
NONE_LEFT = ("zv", "zvd", "zvdd", "zvddd", "mzv", "umzv", "umzvd", "fir-zv", "fir-zvd", "notch")

frequencies = st.floats(0.1, 100.0)
dampings = st.floats(0.0, 0.5)


def mode_of(design: DesignMode, ratio: float = 1.0) -> Mode:
    return Mode(natural_frequency_hz=design.frequency_hz * ratio, damping_ratio=design.damping_ratio)


def left(shaper: Shaper, design: DesignMode, ratio: float = 1.0) -> float:
    return residual_vibration(shaper, mode_of(design, ratio))


def simulated_step(shaper: Shaper, mode: Mode, until_s: float) -> tuple[np.ndarray, float]:
    """State (deviation, velocity) of the mode after a step through the shaper, by an integrator that knows no V."""
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    times = [impulse.time_s for impulse in shaper.impulses]
    steps = np.array([impulse.amplitude for impulse in shaper.impulses])
    above, below = (1.0,), (1.0,)
    if shaper.filter is not None:
        above, below = shaper.filter.numerator, shaper.filter.denominator
    order = len(below) - 1
    top = np.concatenate([np.zeros(order + 1 - len(above)), above]) / below[0]
    poles = np.array(below) / below[0]
    through, weights = top[0], (top[1:] - top[0] * poles[1:])[::-1]

    def command(t: float) -> float:
        if shaper.box_s is None:
            return float(steps @ (t >= np.array(times)))
        return float(steps @ np.clip((t - np.array(times)) / shaper.box_s, 0, 1))

    def slope(t, state, level=None):
        u = command(t) if level is None else level
        inner = np.append(state[1:order], u - poles[:0:-1] @ state[:order]) if order else state[:0]
        driven = through * u + weights @ state[:order] if order else through * u
        return np.concatenate([inner, [state[-1], w**2 * (driven - state[-2]) - 2 * zeta * w * state[-1]]])

    ends = {*times, *(t + (shaper.box_s or 0.0) for t in times), until_s}
    breaks = sorted(end for end in ends if end <= until_s)
    state = np.zeros(order + 2)
    for start, end in itertools.pairwise(breaks):
        level = command((start + end) / 2) if shaper.box_s is None else None
        state = solve_ivp(slope, (start, end), state, args=(level,), method="DOP853", rtol=1e-10, atol=1e-13).y[:, -1]
    return np.array([state[-2] - 1, state[-1]]), until_s


def envelope(state: np.ndarray, mode: Mode) -> float:
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    return math.hypot(state[0], (state[1] + zeta * w * state[0]) / (w * math.sqrt(1 - zeta**2)))


@pytest.mark.parametrize("kind", [*SHAPER_TYPES, "fir-ei", "fir-mzv", "mztd"])
@pytest.mark.parametrize("ratio", [0.85, 1.0])
def test_an_oscillator_after_a_shaped_step_swings_as_v_says(kind, ratio):
    shaper, mode = design_shaper(kind, DAMPED, move_duration_s=2.0), mode_of(DAMPED, ratio)
    ends = shaper.duration_s - shaper.tail_s
    # Where the tail is over: before, the oscillator follows a filter that still moves.
    state, end = simulated_step(shaper, mode, shaper.duration_s + shaper.tail_s)
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    unshaped = math.exp(-zeta * w * (end - ends)) / math.sqrt(1 - zeta**2)
    expected = residual_vibration(shaper, mode) * unshaped
    assert envelope(state, mode) == pytest.approx(expected, rel=1e-6, abs=2e-8)  # discretisation, and the tail
    exact = step_response(shaper, mode, np.array([end])).position[0]
    assert exact - 1 == pytest.approx(state[0], abs=1e-8)  # discretisation


@settings(deadline=None, derandomize=True, max_examples=40)
@given(frequency_hz=frequencies, damping_ratio=dampings, kind=st.sampled_from(NONE_LEFT))
def test_what_cancels_leaves_nothing_at_any_mode(frequency_hz, damping_ratio, kind):
    shaper = design_shaper(kind, DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio))
    assert math.fsum(i.amplitude for i in shaper.impulses) == pytest.approx(1.0, abs=1e-12)  # identity
    assert shaper.residual.at_mode < 1e-9  # identity


@settings(deadline=None, derandomize=True, max_examples=40)
@given(frequency_hz=frequencies, damping_ratio=dampings, kind=st.sampled_from(["ei", "2hump_ei", "3hump_ei", "umei"]))
def test_ei_shapers_up_to_heavy_damping_hold_or_say_where_they_end(frequency_hz, damping_ratio, kind):
    mode = DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    ends = {"2hump_ei": 0.437, "3hump_ei": 0.275}.get(kind, 1.0)
    if damping_ratio < ends:
        shaper = design_shaper(kind, mode)
        at_mode = 0.0 if kind == "2hump_ei" else 0.05
        assert shaper.residual.at_mode == pytest.approx(at_mode, abs=1e-9)  # identity
    elif damping_ratio > ends + 0.01:
        with pytest.raises(InputError, match="they end at a damping ratio"):
            design_shaper(kind, mode)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(first=frequencies, second=frequencies, damping_ratio=dampings, kinds=st.permutations(["zv", "zvd", "mzv"]))
def test_convolution_commutes_and_cancels_both_modes(first, second, damping_ratio, kinds):
    modes = [DesignMode(frequency_hz=f, damping_ratio=damping_ratio) for f in (first, second)]
    one = design_multimode(kinds[:2], modes)
    other = design_multimode(kinds[1::-1], modes[::-1])
    assert one.residual.at_mode < 1e-9  # identity
    assert [i.time_s for i in one.impulses] == pytest.approx([i.time_s for i in other.impulses], rel=1e-9, abs=1e-12)
    assert [i.amplitude for i in one.impulses] == pytest.approx([i.amplitude for i in other.impulses], abs=1e-9)


@settings(deadline=None, derandomize=True, max_examples=5)
@given(
    frequency_hz=frequencies,
    damping_ratio=dampings,
    percent=st.floats(2.0, 45.0),
    damping_percent=st.sampled_from([0.0, 30.0]),
    tolerance=st.sampled_from([0.02, 0.05, 0.1]),
)
def test_specified_insensitivity_keeps_its_tolerance_over_its_band(
    frequency_hz, damping_ratio, percent, damping_percent, tolerance
):
    design = DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    band = Band.around(mode_of(design), percent=percent, damping_percent=damping_percent)
    shaper = design_shaper("si", design, band=band, tolerance=tolerance)
    frequency = np.linspace(band.lowest_hz, band.highest_hz, 301)
    for damping in (band.least_damping, band.most_damping):
        assert residual_curve(shaper, frequency, damping).residual.max() <= tolerance * (1 + 1e-5)  # the grid's peaks
    assert all(i.amplitude >= 0 for i in shaper.impulses)


@pytest.mark.parametrize(("kind", "percent"), [("ei", 19.97), ("2hump_ei", 36.2), ("3hump_ei", 48.15)])
def test_specified_insensitivity_without_damping_is_the_ei_of_that_width(kind, percent):
    design = DesignMode(frequency_hz=1.0, damping_ratio=0.0)
    shaper = design_shaper("si", design, band=Band.around(mode_of(design), percent=percent))
    ei = design_shaper(kind, design)
    assert ei.duration_s * 0.99 < shaper.duration_s <= ei.duration_s
    assert len(shaper.impulses) == len(ei.impulses)


def test_specified_insensitivity_between_the_eis_is_shorter_than_the_next():
    band = Band.around(mode_of(FLEXIBLE), percent=11.46)
    shaper = design_shaper("si", FLEXIBLE, band=band)
    assert shaper.duration_s < 0.93 * design_shaper("zvd", FLEXIBLE).duration_s
    assert max(left(shaper, FLEXIBLE, ratio) for ratio in (0.8854, 1.1146)) <= 0.05 + 1e-9


def test_specified_insensitivity_takes_its_band_from_the_spread():
    spread = Spread(source="set", natural_frequency_std_percent=4.0, n=50)
    shaper = design_shaper("si", FLEXIBLE, spread=spread)
    assert shaper.residual.p95 <= 0.05
    assert left(shaper, FLEXIBLE, 1.0784) == pytest.approx(0.05, abs=1e-4)


def test_simultaneous_zero_vibration_of_two_undamped_modes_is_the_closed_form():
    modes = [DesignMode(frequency_hz=f, damping_ratio=0.0) for f in (1.0, 1.5)]
    shaper, convolved = design_simultaneous(modes), design_multimode(["zv", "zv"], modes)
    # 1 + 2 c cos φ1 = 1 + 2 c cos φ2 = 0 about the middle impulse: φ2 = 2π - φ1, so t = 1/(f1 + f2)
    assert [i.time_s for i in shaper.impulses] == pytest.approx([0, 0.4, 0.8], abs=1e-6)
    assert shaper.residual.at_mode < 1e-12
    assert shaper.duration_s < convolved.duration_s


@pytest.mark.parametrize("fast_hz", [2.6, 4.0, 7.0, 7.5, 23.0])
def test_the_simultaneous_solution_is_never_longer_than_the_convolution(fast_hz):
    modes = [SLOW, DesignMode(frequency_hz=fast_hz, damping_ratio=0.05), DesignMode(frequency_hz=11, damping_ratio=0.1)]
    together, convolved = design_simultaneous(modes), design_multimode(["zv"] * 3, modes)
    assert together.residual.at_mode < 1e-9
    assert together.duration_s <= convolved.duration_s * (1 + 1e-12)
    assert all(i.amplitude >= -1e-9 for i in together.impulses)


def test_each_mode_gets_the_shaper_of_its_own_band():
    assert [kind_for_band(mode_of(FLEXIBLE), percent) for percent in (2, 10, 18, 30, 45)] == [
        *("zv", "zvd", "ei", "2hump_ei", "3hump_ei")
    ]
    shaper = design_multimode(None, [SLOW, FAST], band_percent=[2, 12])
    assert shaper.type == "zv-zvd"
    assert shaper.duration_s == pytest.approx(
        design_shaper("zv", SLOW).duration_s + design_shaper("zvd", FAST).duration_s, rel=1e-12
    )  # identity
    mode = mode_of(SLOW, 1.07)
    parts = residual_vibration(design_shaper("zv", SLOW), mode) * residual_vibration(design_shaper("zvd", FAST), mode)
    assert residual_vibration(shaper, mode) == pytest.approx(parts, rel=1e-9)  # identity


def test_a_given_shaper_is_scaled_and_judged():
    shaper = given_shaper([0.0, 0.25], [3.0, 3.0], modes=[DesignMode(frequency_hz=2.0, damping_ratio=0.0)])
    assert [i.amplitude for i in shaper.impulses] == [0.5, 0.5]
    assert shaper.residual.at_mode < 1e-12
    assert given_shaper([0.0], [2.0]).residual is None


@pytest.mark.parametrize(
    ("times", "amplitudes", "words"),
    [
        ([0, 1], [1], "one amplitude for each time"),
        ([], [], "one amplitude for each time"),
        ([0, math.nan], [1, 1], "finite"),
        ([0.1, 0.2], [1, 1], "rise from 0"),
        ([0, 0.2, 0.2], [1, 1, 1], "rise from 0"),
        ([0, 1], [1, -1], "positive sum"),
    ],
)
def test_a_given_shaper_that_is_none_is_refused(times, amplitudes, words):
    with pytest.raises(InputError, match=words):
        given_shaper(times, amplitudes)


@pytest.mark.parametrize("sample_time_s", [1e-4, 1e-3, 4e-3, 0.013])
@pytest.mark.parametrize("kind", ["zv", "zvd", "mzv", "2hump_ei", "fir-zv", "umzv"])
def test_the_phasor_split_loses_nothing_at_the_mode_where_rounding_does(kind, sample_time_s):
    phasor, linear, rounded = grid_costs(design_shaper(kind, DAMPED), sample_time_s)
    assert phasor.residual_at_mode < 1e-12  # identity
    assert phasor.residual_at_mode <= linear.residual_at_mode
    assert -0.51 < rounded.added_s / sample_time_s < 0.51
    for cost in (phasor, linear, rounded):
        samples = np.array([i.time_s for i in cost.shaper.impulses]) / sample_time_s
        assert samples == pytest.approx(np.round(samples), abs=1e-6)


def test_the_phasor_split_of_two_modes_loses_nothing_at_either():
    shaper = design_multimode(["zv", "zvd"], [SLOW, FAST])
    phasor, linear, rounded = grid_costs(shaper, 0.004)
    assert phasor.residual_at_mode < 1e-11  # identity
    assert rounded.residual_at_mode > 1e-4 > linear.residual_at_mode > 1e-6


@pytest.mark.parametrize("sample_time_s", [0.0, -1.0, math.nan, 0.3, 1e-9])
def test_a_grid_that_cannot_be_is_refused(sample_time_s):
    with pytest.raises(InputError, match="sample time"):
        place_on_grid(design_shaper("zv", DAMPED), sample_time_s)


def test_the_prefilters_cost_what_the_comparison_of_strategies_says():
    prices = {price.shaper.type: price for price in compare_shapers(FLEXIBLE).prices}
    periods = {kind: prices[kind].duration_periods for kind in ("zv", "zvd", "fir", "fir-zv", "notch", "lowpass")}
    assert periods["zv"] == pytest.approx(0.5)
    assert periods["zvd"] == pytest.approx(1)
    assert periods["fir"] == pytest.approx(1)
    assert periods["fir-zv"] == pytest.approx(1.5)
    assert 1 < periods["notch"] < periods["lowpass"] < 8.9  # Table 3.1: 1 to 10 and 1 to 8.9 periods
    assert prices["jerk"].residual_off == pytest.approx(0.17, abs=5e-3)  # published value: 16.7 %
    assert prices["lowpass"].residual_at_mode == pytest.approx(0.05, rel=1e-9)  # identity
    assert prices["umzv"].negative
    assert not prices["fir-zv"].negative


def test_a_comparison_names_what_does_not_exist_for_this_mode():
    comparison = compare_shapers(DesignMode(frequency_hz=1.0, damping_ratio=0.46))
    assert {notice.message.split(":")[0] for notice in comparison.missing} == {"2hump_ei", "3hump_ei"}
    durations = [price.duration_s for price in comparison.prices]
    assert durations == sorted(durations)


@pytest.mark.parametrize("std_percent", [1.5, 8.0])
def test_the_chosen_shaper_is_the_shortest_that_keeps_the_tolerance(std_percent):
    spread = Spread(source="set", natural_frequency_std_percent=std_percent, n=25)
    chosen = choose_shaper(FLEXIBLE, spread=spread)
    assert chosen.residual.p95 <= 0.05 + 1e-9
    for price in compare_shapers(FLEXIBLE, spread=spread).prices:
        if price.duration_s < chosen.duration_s - 1e-9 and not price.negative:
            assert price.residual_p95 > 0.05


def test_a_measured_sample_chooses_by_itself():
    frequency = np.append(2.4727 * (1 + 0.02 * np.linspace(-1, 1, 60)), np.nan)
    chosen = choose_shaper(FLEXIBLE, sample=(frequency, np.full(61, 4e-4)), kinds=["zv", "zvd", "ei"])
    assert chosen.type == "zv"
    assert residual_of_sample(chosen, frequency, 4e-4).percentile[1] < 0.05


def test_choosing_without_a_spread_is_refused():
    with pytest.raises(InputError, match="needs the spread"):
        choose_shaper(FLEXIBLE)


def test_a_spread_that_no_shaper_masters_is_refused_with_the_best():
    spread = Spread(source="set", natural_frequency_std_percent=20.0, n=None)
    with pytest.raises(InputError, match="the best, zvd, leaves"):
        choose_shaper(FLEXIBLE, spread=spread, kinds=["zv", "zvd"], tolerance=0.01)


def test_percentiles_of_a_sample_are_those_of_its_residuals():
    frequency = np.array([2.3, 2.4, math.nan, 2.5, 2.6])
    found = residual_of_sample(design_shaper("zv", FLEXIBLE), frequency, 0.001, percent=(0, 50, 100))
    expected = residual_curve(design_shaper("zv", FLEXIBLE), frequency[[0, 1, 3, 4]], 0.001).residual
    assert found.residual == pytest.approx(expected)
    assert found.percentile == pytest.approx((expected.min(), np.median(expected), expected.max()))
    with pytest.raises(InputError, match="at least one"):
        residual_of_sample(design_shaper("zv", FLEXIBLE), np.array([math.nan]), 0.1)


@pytest.mark.parametrize("kind", ["zv", "ei", "fir-zvd", "notch", "lowpass", "umzvd"])
def test_the_centroid_is_the_phase_of_slow_sines(kind):
    shaper = design_shaper(kind, DAMPED)
    slow_hz = 1e-5
    phase = frequency_response(shaper, np.array([0.0, slow_hz])).phase_rad[1]
    assert centroid_delay(shaper) == pytest.approx(-phase / (2 * math.pi * slow_hz), rel=1e-7)  # discretisation


def test_the_unshaped_step_overshoots_as_the_closed_form_says():
    plain, mode = given_shaper([0.0], [1.0]), Mode(natural_frequency_hz=3.0, damping_ratio=0.1)
    found = step_indicators(plain, mode, band=0.05)
    assert found.overshoot_percent == pytest.approx(100 * math.exp(-math.pi * 0.1 / math.sqrt(0.99)), rel=1e-9)
    undamped = step_indicators(plain, Mode(natural_frequency_hz=3.0, damping_ratio=0.0))
    assert undamped.overshoot_percent == pytest.approx(100, rel=1e-9)
    assert undamped.settling_s == math.inf


def test_sensitivity_curves_are_v_over_each_parameter():
    shaper, mode = design_shaper("zv", DAMPED), mode_of(DAMPED)
    curves = sensitivity_curves(shaper, mode, np.array([0.5, 1.0, 1.5, 25.0]))
    assert curves.over_frequency[1] < 1e-12
    assert curves.over_damping[1] < 1e-12
    heavier = Mode(natural_frequency_hz=2.0, damping_ratio=0.075)
    assert curves.over_damping[2] == pytest.approx(residual_vibration(shaper, heavier), rel=1e-12)  # identity
    assert math.isnan(curves.over_damping[3])


def test_zero_delay_refuses_what_it_cannot_do():
    with pytest.raises(InputError, match="longer than its shaper"):
        design_shaper("ztd", DAMPED, move_duration_s=0.5)
    with pytest.raises(InputError, match="needs the duration"):
        design_shaper("mztd", DAMPED)
    with pytest.raises(InputError, match="with damping"):
        design_shaper("mztd", DesignMode(frequency_hz=2.0, damping_ratio=0.0), move_duration_s=1.0)
    with pytest.raises(InputError, match="leaves nothing at the mode"):
        design_shaper("mztd-ei", DAMPED, move_duration_s=1.0)
    with pytest.raises(InputError, match="must be positive"):
        design_shaper("ztd", DAMPED, move_duration_s=math.nan)


@pytest.mark.parametrize("hold", ["foh", "tustin"])
def test_the_compensator_on_a_grid_converges_with_the_square_of_its_step(hold):
    shaper = design_shaper("mztd", DAMPED, move_duration_s=2.0)

    def smooth(time_s):
        x = time_s / 2.0
        return x**3 * (10 - 15 * x + 6 * x**2)

    fine = apply_to_command(smooth, 2.0, shaper, 2.5e-4, hold=hold)[1]
    errors = [
        np.max(np.abs(apply_to_command(smooth, 2.0, shaper, 2.5e-4 * every, hold=hold)[1] - fine[::every]))
        for every in (8, 16)
    ]
    assert math.log2(errors[1] / errors[0]) == pytest.approx(2, abs=0.05)  # discretisation


def test_an_overshoot_ratio_needs_an_overshoot():
    assert overshoot_ratio(3.0, 12.0) == 0.25
    with pytest.raises(InputError, match="unshaped overshoot"):
        overshoot_ratio(1.0, 0.0)


@pytest.mark.parametrize(
    ("numerator", "denominator", "words"),
    [
        ((1.0,), (1.0, 2.0), "unchanged"),
        ((1.0, 0.0, 1.0), (1.0, 1.0), "no higher power"),
        ((-1.0,), (1.0, -1.0), "stable"),
        ((math.nan,), (1.0, 1.0), "finite"),
        ((), (1.0,), "finite"),
    ],
)
def test_a_filter_that_cannot_be_is_refused(numerator, denominator, words):
    with pytest.raises(InputError, match=words):
        DigitalFilter(numerator=numerator, denominator=denominator)


def test_bands_kinds_and_bases_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="contains 0"):
        Band.around(mode_of(DAMPED), percent=100)
    with pytest.raises(InputError, match="expected it to rise"):
        Band(lowest_hz=0.0, highest_hz=1.0, least_damping=0.0, most_damping=0.0)
    with pytest.raises(InputError, match="2 modes need as many kinds, not 1"):
        design_multimode(["zv"], [SLOW, FAST])
    with pytest.raises(InputError, match="has no impulses alone"):
        design_multimode(["zv", "notch"], [SLOW, FAST])
    with pytest.raises(InputError, match="is not known"):
        design_shaper("fir-notch", DAMPED)
    assert set(IMPULSE_TYPES) < set(SHAPER_TYPES)


def test_insensitivity_of_several_modes_is_that_of_the_narrowest():
    shaper = design_multimode(["zv", "zvd"], [SLOW, FAST])
    each = [insensitivity(shaper, mode=mode_of(mode)) for mode in (SLOW, FAST)]
    assert shaper.insensitivity_5_percent == min(each)
