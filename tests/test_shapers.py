"""Shapers against published values, closed forms, and an oscillator that knows nothing of V."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tagsway.errors import InputError
from tagsway.model import DesignMode, DigitalFilter, Impulse, Mode, Shaper, Spread, Trajectory
from tagsway.shapers import (
    design_shaper,
    insensitivity,
    residual_curve,
    residual_percentile,
    residual_vibration,
)
from tagsway.trajectories import apply_shaper

NOTES = Path(__file__).parents[2] / "shared" / "notes"
FLEXIBLE = DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4)
STIFF = DesignMode(frequency_hz=3.5906, damping_ratio=0.0012)
UNDAMPED = DesignMode(frequency_hz=1.0, damping_ratio=0.0)
EXACT_TYPES = ("zv", "zvd", "zvdd", "zvddd", "mzv")

frequencies = st.floats(0.1, 100.0)
dampings = st.floats(0.0, 0.5)


def as_arrays(shaper: Shaper) -> tuple[np.ndarray, np.ndarray]:
    return np.array([i.time_s for i in shaper.impulses]), np.array([i.amplitude for i in shaper.impulses])


def published(key: str):
    if not NOTES.exists():
        pytest.skip("the published values are not beside this clone")
    return json.loads((NOTES / "acceptance.json").read_text(encoding="utf-8"))[key]


def residual_at(shaper: Shaper, ratio: float) -> float:
    design = shaper.modes[0]
    return residual_vibration(
        shaper, Mode(natural_frequency_hz=design.frequency_hz * ratio, damping_ratio=design.damping_ratio)
    )


@pytest.mark.parametrize(
    ("mode", "amplitudes", "times"),
    [
        (FLEXIBLE, [0.50027604, 0.49972396], [0.0, 0.20220813]),
        (STIFF, [0.50094248, 0.49905752], [0.0, 0.13925259]),
    ],
)
def test_zv_of_the_thesis_two_subsets_has_its_impulses(mode, amplitudes, times):
    found_times, found_amplitudes = as_arrays(design_shaper("zv", mode))
    assert found_amplitudes == pytest.approx(amplitudes, abs=5e-9)  # published value
    assert found_times == pytest.approx(times, abs=5e-9)  # published value


def test_zvd_of_the_zero_delay_paper_has_its_impulses():
    found_times, found_amplitudes = as_arrays(design_shaper("zvd", DesignMode(frequency_hz=2.55, damping_ratio=0.04)))
    assert found_amplitudes == pytest.approx([0.28238566, 0.49802812, 0.21958623], abs=5e-9)  # published value
    assert found_times == pytest.approx([0.0, 0.19623548, 0.39247097], abs=6e-9)  # published value


@pytest.mark.parametrize(
    ("kind", "width"),
    [
        ("zv", 0.0637),
        ("zvd", 0.2871),
        ("zvdd", 0.4804),
        ("mzv", 0.1035),
        ("ei", 0.3995),
        ("2hump_ei", 0.7245),
        ("3hump_ei", 0.9639),
    ],
)
def test_insensitivity_without_damping_is_the_tabulated_one(kind, width):
    assert design_shaper(kind, UNDAMPED).insensitivity_5_percent == pytest.approx(width, abs=5e-5)  # published value


@pytest.mark.parametrize("tolerance", [0.01, 0.05, 0.2, 0.6])
def test_insensitivity_without_damping_follows_the_closed_forms(tolerance):
    zv = 4 / math.pi * math.asin(tolerance)
    zvd = 4 / math.pi * math.asin(math.sqrt(tolerance))
    assert insensitivity(design_shaper("zv", UNDAMPED), tolerance) == pytest.approx(zv, abs=1e-8)  # identity, TOUCH
    assert insensitivity(design_shaper("zvd", UNDAMPED), tolerance) == pytest.approx(zvd, abs=1e-7)
    if tolerance < 1 / 3:
        ei = 2 / math.pi * math.acos((1 - 3 * tolerance) / (1 + tolerance))
        assert insensitivity(design_shaper("ei", UNDAMPED, tolerance=tolerance), tolerance) == pytest.approx(
            ei, abs=1e-7
        )


def test_insensitivity_is_zero_where_the_mode_itself_is_above_the_tolerance():
    assert insensitivity(design_shaper("ei", UNDAMPED), 0.04) == 0.0


def test_insensitivity_has_no_upper_end_under_strong_damping():
    strongly = design_shaper("zvd", DesignMode(frequency_hz=1.0, damping_ratio=0.7))
    assert insensitivity(strongly) == math.inf
    assert strongly.insensitivity_5_percent is None


@pytest.mark.parametrize(("kind", "percent"), [("zv", 23.3445), ("zvd", 5.4497), ("ei", 0.7222)])
def test_residual_at_15_percent_is_the_recomputed_one(kind, percent):
    assert residual_at(design_shaper(kind, UNDAMPED), 1.15) * 100 == pytest.approx(percent, abs=5e-5)  # published value


@pytest.mark.parametrize(
    ("mode", "frequency_hz", "percent"),
    [
        (FLEXIBLE, 2.4727 * 1.1146, 17.895),
        (FLEXIBLE, 2.4727 * 0.8854, 17.897),
        (FLEXIBLE, 2.15, 20.347),
        (STIFF, 4.80, 50.347),
        (STIFF, 3.5906 * 1.2313, 35.456),
    ],
)
def test_zv_residual_on_the_thesis_deviations(mode, frequency_hz, percent):
    actual = Mode(natural_frequency_hz=frequency_hz, damping_ratio=mode.damping_ratio)
    assert residual_vibration(design_shaper("zv", mode), actual) * 100 == pytest.approx(
        percent, abs=0.01
    )  # published value


def test_a_zv_designed_for_a_guessed_damping_leaves_what_the_notes_say():
    guess = design_shaper("zv", DesignMode(frequency_hz=2.47, damping_ratio=0.1))
    left = residual_vibration(guess, Mode(natural_frequency_hz=2.47, damping_ratio=3.5e-4))
    assert left == pytest.approx(0.156, abs=5e-4)  # published value


@pytest.mark.parametrize(("std_percent", "p95"), [(0.2, 0.6), (1.0, 3.1), (3.0, 9.2)])
def test_p95_of_zv_over_a_spread_is_the_tabulated_one(std_percent, p95):
    spread = Spread(source="option", natural_frequency_std_percent=std_percent, n=None)
    shaper = design_shaper("zv", DesignMode(frequency_hz=2.47, damping_ratio=3.5e-4), spread=spread)
    assert shaper.residual is not None
    assert shaper.residual.p95 * 100 == pytest.approx(p95, abs=0.05)  # published value
    assert shaper.residual.spread == spread


def test_p95_agrees_with_a_random_sample():
    shaper = design_shaper("zvd", FLEXIBLE)
    frequency = FLEXIBLE.frequency_hz * (1 + 0.05 * np.random.default_rng(1).standard_normal(200_000))
    sampled = np.percentile(residual_curve(shaper, frequency, FLEXIBLE.damping_ratio).residual, 95)
    assert residual_percentile(shaper, 5.0) == pytest.approx(sampled, rel=0.01)  # statistics: 3 of its standard errors


def test_without_a_spread_p95_is_unknown():
    shaper = design_shaper("zv", FLEXIBLE, source="video")
    assert shaper.residual is not None
    assert shaper.residual.p95 is None
    assert shaper.source == "video"


def test_exact_ei_is_the_recomputed_one():
    for key, value in published("1_shapers").items():
        if not key.startswith("EI_V5_zeta"):
            continue
        mode = DesignMode(frequency_hz=1.0, damping_ratio=float(key.removeprefix("EI_V5_zeta")))
        times, amplitudes = as_arrays(design_shaper("ei", mode))
        assert amplitudes == pytest.approx(value["exact_A"], abs=value["tol"])
        assert times * math.sqrt(1 - mode.damping_ratio**2) == pytest.approx(value["exact_t_over_Td"], abs=value["tol"])


@pytest.mark.parametrize("kind", ["zv", "zvd", "mzv"])
def test_impulses_are_those_of_other_programs(kind):
    if not NOTES.exists():
        pytest.skip("the reference values are not beside this clone")
    for case in json.loads((NOTES / "klipper_reference.json").read_text(encoding="utf-8"))["cases"]:
        times, amplitudes = as_arrays(
            design_shaper(kind, DesignMode(frequency_hz=case["f_hz"], damping_ratio=case["zeta"]))
        )
        assert amplitudes == pytest.approx(case["klipper"][kind]["A"], abs=1e-12)  # identity
        assert times == pytest.approx(case["klipper"][kind]["T"], rel=1e-12)  # identity


@settings(deadline=None, derandomize=True)
@given(frequency_hz=frequencies, damping_ratio=dampings, kind=st.sampled_from(EXACT_TYPES))
def test_any_exact_shaper_cancels_its_mode(frequency_hz, damping_ratio, kind):
    shaper = design_shaper(kind, DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio))
    _, amplitudes = as_arrays(shaper)
    assert math.fsum(amplitudes) == pytest.approx(1.0, abs=1e-12)  # identity
    assert np.all(amplitudes > 0)
    assert shaper.residual is not None
    assert shaper.residual.at_mode < 1e-9  # identity


@settings(deadline=None, derandomize=True, max_examples=25)
@given(
    frequency_hz=frequencies,
    damping_ratio=st.floats(0.0, 0.15),
    tolerance=st.floats(0.02, 0.15),
    kind=st.sampled_from(["ei", "2hump_ei", "3hump_ei"]),
)
def test_any_hump_shaper_stays_at_its_tolerance_over_its_band(frequency_hz, damping_ratio, tolerance, kind):
    mode = DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio)
    shaper = design_shaper(kind, mode, tolerance=tolerance)
    at_mode = 0.0 if kind == "2hump_ei" else tolerance
    assert residual_at(shaper, 1.0) == pytest.approx(at_mode, abs=1e-9)  # identity
    order = len(shaper.impulses) - 1
    half = 1 - 2 / math.pi * math.acos(
        1 / math.cosh(math.acosh(1 / tolerance) / order)
    )  # without damping; more with it
    curve = residual_curve(shaper, frequency_hz * np.linspace(1 - half, 1 + half, 301), damping_ratio)
    assert curve.residual.max() <= tolerance + 1e-9  # identity
    humps = np.count_nonzero(np.diff(np.sign(np.diff(_wide(shaper).residual))) < 0)
    assert humps >= {"ei": 1, "2hump_ei": 2, "3hump_ei": 3}[kind]


def _wide(shaper: Shaper):
    mode = shaper.modes[0]
    return residual_curve(shaper, mode.frequency_hz * np.linspace(0.3, 1.7, 2801), mode.damping_ratio)


def test_zvd_is_the_zv_applied_twice():
    times, amplitudes = as_arrays(design_shaper("zv", STIFF))
    twice_times, twice = as_arrays(design_shaper("zvd", STIFF))
    assert twice == pytest.approx(np.convolve(amplitudes, amplitudes), abs=1e-15)  # identity
    assert twice_times == pytest.approx([0, times[1], 2 * times[1]], rel=1e-15)


def envelope_after(trajectory: Trajectory, mode: Mode) -> float:
    """Swing of a linear oscillator under x at the end of the motion, by an integrator that knows no shaper."""
    omega, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    state = np.zeros(2)
    for start, end in zip(trajectory.breaks_s[:-1], trajectory.breaks_s[1:], strict=True):

        def slope(t, y, start=start, end=end):
            push = trajectory(min(max(t, start), np.nextafter(end, start)), 2)[0]
            return [y[1], -2 * zeta * omega * y[1] - omega**2 * y[0] - push]

        state = solve_ivp(slope, (start, end), state, method="DOP853", rtol=1e-10, atol=1e-13).y[:, -1]
    rate = (state[1] + zeta * omega * state[0]) / (omega * math.sqrt(1 - zeta**2))
    return math.hypot(state[0], rate)


def quick_quintic(duration_s: float) -> Trajectory:
    powers = duration_s ** -np.arange(6.0)
    shape = np.array([0, 0, 0, 10, -15, 6]) * powers
    return Trajectory(
        breaks_s=np.array([0, duration_s]), coefficients=np.stack([shape, 0 * shape, 0 * shape], axis=1)[None]
    )


@pytest.mark.parametrize("kind", ["zv", "zvd", "mzv", "3hump_ei", "umzv", "fir-zv", "notch"])
@pytest.mark.parametrize("ratio", [0.8, 1.0])
def test_an_oscillator_under_a_shaped_move_swings_as_v_says(kind, ratio):
    design = DesignMode(frequency_hz=2.4727, damping_ratio=0.03)
    actual = Mode(natural_frequency_hz=ratio * design.frequency_hz, damping_ratio=0.05 if ratio != 1 else 0.03)
    shaper, move = design_shaper(kind, design), quick_quintic(0.3)
    motion = apply_shaper(move, shaper, ("x",))
    # V holds at the end of impulses and box; the mode decays while a filter rings on.
    ringing = motion.duration_s - move.duration_s - (shaper.duration_s - shaper.tail_s)
    decay = math.exp(-actual.damping_ratio * actual.angular_frequency_rad_s * ringing)
    expected = residual_vibration(shaper, actual) * envelope_after(move, actual) * decay
    fit = 1e-9 if shaper.filter is None else 1e-6  # discretisation: the integrator's, and a filter's fitted response
    assert envelope_after(motion, actual) == pytest.approx(expected, rel=1e-6, abs=fit)


def test_a_box_of_one_damped_period_leaves_what_its_closed_form_says():
    mode = Mode(natural_frequency_hz=6.34, damping_ratio=0.022)
    box = Shaper(type="fir", modes=(), impulses=(Impulse(time_s=0, amplitude=1),), box_s=mode.damped_period_s)
    omega, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    closed = (1 - math.exp(-zeta * omega * mode.damped_period_s)) / (omega * mode.damped_period_s)
    assert residual_vibration(box, mode) == pytest.approx(closed, rel=1e-12)  # identity
    assert closed == pytest.approx(0.0205468, abs=5e-8)  # published value
    move = quick_quintic(0.1)
    shaped = envelope_after(apply_shaper(move, box, ("x",)), mode)
    assert shaped == pytest.approx(closed * envelope_after(move, mode), rel=1e-6)  # discretisation


def test_a_filter_multiplies_v_by_its_gain_at_the_pole():
    mode = Mode(natural_frequency_hz=2.0, damping_ratio=0.0)
    omega = mode.angular_frequency_rad_s
    notch = DigitalFilter(numerator=(1, 0, omega**2), denominator=(1, 2 * omega, omega**2))
    shaper = Shaper(type="notch", modes=(), impulses=(Impulse(time_s=0, amplitude=1),), filter=notch)
    assert residual_vibration(shaper, mode) == pytest.approx(0, abs=1e-12)  # identity
    off = Mode(natural_frequency_hz=4.0, damping_ratio=0.0)
    assert residual_vibration(shaper, off) == pytest.approx(3 / 5, rel=1e-12)  # |1 - 4| / |1 - 4 + 4j|


@pytest.mark.parametrize(
    ("frequency_hz", "damping_ratio", "words"),
    [
        (0.0, 0.0, "natural frequency"),
        (-2.0, 0.0, "natural frequency"),
        (math.nan, 0.0, "natural frequency"),
        (math.inf, 0.0, "natural frequency"),
        (1.0, 1.0, "damping ratio"),
        (1.0, -0.1, "damping ratio"),
        (1.0, math.nan, "damping ratio"),
    ],
)
def test_a_mode_that_cannot_be_is_refused(frequency_hz, damping_ratio, words):
    with pytest.raises(InputError, match=words):
        design_shaper("zv", DesignMode(frequency_hz=frequency_hz, damping_ratio=damping_ratio))


def test_an_unknown_type_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"'zvx' is not known: expected one of zv, zvd"):
        design_shaper("zvx", UNDAMPED)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -1.0, math.nan])
def test_a_tolerance_outside_0_and_1_is_refused(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        design_shaper("ei", UNDAMPED, tolerance=tolerance)
    with pytest.raises(InputError, match="tolerance"):
        insensitivity(design_shaper("zv", UNDAMPED), tolerance)


@pytest.mark.parametrize("std_percent", [-1.0, 31.0, math.nan])
def test_a_spread_that_cannot_be_is_refused(std_percent):
    with pytest.raises(InputError, match="frequency spread"):
        residual_percentile(design_shaper("zv", UNDAMPED), std_percent)


def test_a_curve_through_frequency_zero_is_refused():
    with pytest.raises(InputError, match="positive frequencies"):
        residual_curve(design_shaper("zv", UNDAMPED), np.array([0.0, 1.0]), 0.0)


def test_a_heavily_damped_hump_shaper_says_that_there_is_none():
    with pytest.raises(InputError, match="or a si, zv or zvd"):
        design_shaper("3hump_ei", DesignMode(frequency_hz=1.0, damping_ratio=0.6))
