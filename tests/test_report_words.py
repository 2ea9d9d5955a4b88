import math
from dataclasses import replace

import pytest

import example_result
from tagsway.model import Estimate, Residual, Spread
from tagsway.report.words import (
    describe_residual,
    describe_spread,
    format_error,
    format_estimate,
    format_interval,
    format_percent,
    next_steps,
    plain,
    summary_lines,
)


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (2.473142, 0.00123, "2.4731 ± 0.0012 Hz"),
        (2.473142, 0.0996, "2.47 ± 0.10 Hz"),
        (2.473142, 0.00999, "2.473 ± 0.010 Hz"),
        (12.34, 4.4, "12.3 ± 4.4 Hz"),
        (12.34, 44.0, "12 ± 44 Hz"),
        (1234.5, 120.0, "1230 ± 120 Hz"),
        (-0.0001, 0.2, "0.00 ± 0.20 Hz"),
        (9.016e-8, 3.1e-9, "(9.02 ± 0.31)×10⁻⁸ Hz"),
        (2.5e7, 1e5, "(2.500 ± 0.010)×10⁷ Hz"),
        (0.0, 1.0, "0.0 ± 1.0 Hz"),
        (2.47, 0.0, "2.47 Hz"),
        (0.0, 0.0, "0 Hz"),
        (2.473142, math.inf, "2.47 Hz (error not known)"),
        (2.473142, 3.2e-9, "2.473142 ± 3.2e-09 Hz"),
    ],
)
def test_an_estimate_is_rounded_to_two_digits_of_its_error(value: float, std: float, text: str) -> None:
    assert format_estimate(Estimate.normal(value, std), "Hz") == text


def test_a_scale_applies_to_value_and_error() -> None:
    assert format_estimate(Estimate.normal(0.04585, 0.00021), "mm", scale=1e3) == "45.85 ± 0.21 mm"


def test_a_ratio_has_no_unit_and_no_trailing_blank() -> None:
    assert format_estimate(Estimate.normal(0.004, 0.0001)) == "0.00400 ± 0.00010"


@pytest.mark.parametrize(
    ("ci95", "text"),
    [
        ((2.4707, 2.4755), "2.4707 to 2.4755 Hz"),
        ((0.0, 0.0), "0.000000 to 0.000000 Hz"),
        ((1.0, math.inf), "1 to ∞ Hz"),
        ((8.4e-8, 9.6e-8), "(8.40 to 9.60)×10⁻⁸ Hz"),
    ],
)
def test_an_interval_names_both_ends(ci95: tuple[float, float], text: str) -> None:
    assert format_interval(Estimate(value=ci95[0], std=1.0, ci95=ci95), "Hz") == text


@pytest.mark.parametrize(("error", "text"), [(9e-5, "0.000090"), (0.0123, "0.012"), (120.0, "120"), (3e-9, "3e-09")])
def test_an_error_alone_has_two_digits(error: float, text: str) -> None:
    assert format_error(error) == text


@pytest.mark.parametrize(
    ("fraction", "text"), [(3e-16, "below 0.1 %"), (0.0234, "2.3 %"), (0.156, "16 %"), (math.nan, "nan %")]
)
def test_a_fraction_becomes_percent(fraction: float, text: str) -> None:
    assert format_percent(fraction) == text


def test_the_summary_gives_values_with_errors_and_ends_with_the_warnings() -> None:
    result, _ = example_result.example()
    lines = summary_lines(result)
    assert lines[0] == "natural frequency: 2.47270 ± 0.00031 Hz (95 %: 2.47209 to 2.47331 Hz)"
    assert "damping ratio: 0.004020 ± 0.000094" in lines
    assert "length l: 45.85 ± 0.21 mm" in lines
    assert "shaper: ZV, 2 impulses, adds 202.5 ms" in lines
    assert lines[-1] == f"note: {result.warnings[-1].message}"


def test_the_summary_names_no_millimetres_where_there_is_no_scale() -> None:
    result, _ = example_result.in_pixels()
    assert not any(" mm" in line for line in summary_lines(result))


def test_the_summary_begins_with_what_happened_to_the_grip_and_lists_every_mode() -> None:
    result, _ = example_result.peeled_off()
    lines = summary_lines(result)
    assert lines[0] == "event: the product peeled off at 9.000 ± 0.002 s; what follows is not used"
    assert not any(line.startswith("warning") and "peeled" in line for line in lines)
    assert "at this swing: 2.46960 ± 0.00033 Hz (what the shaper is designed for)" in lines
    assert "further mode: 5.431 ± 0.012 Hz, damping ratio 0.0110 ± 0.0020" in lines


def test_the_summary_of_nothing_says_so() -> None:
    result, _ = example_result.not_determined()
    lines = summary_lines(result)
    assert lines[0] == "natural frequency: not determined"
    assert lines[-1].startswith("warning: Nothing swings")


def test_the_summary_keeps_control_characters_from_the_terminal() -> None:
    result, _ = example_result.hostile()
    assert all(line.isprintable() for line in summary_lines(result))
    assert plain("a\x1b[31m\r\nb\x07") == "a�[31m b�"


def test_one_video_is_said_not_to_know_the_spread() -> None:
    result, _ = example_result.example()
    shaper = result.shaper
    assert shaper is not None
    assert describe_residual(shaper) == "below 0.1 % of the swing is left at the design frequency"
    assert "film repeats" in describe_spread(shaper)
    known = Residual(at_mode=0.0, p95=0.031, spread=Spread(source="stated", natural_frequency_std_percent=1.0, n=None))
    text = describe_spread(replace(shaper, residual=known))
    assert text == "at most 3.1 % of the swing is left in 95 of 100 picks (spread 1 %, stated)"


@pytest.mark.parametrize(
    ("variant", "word"),
    [
        ("example", "--frequency-spread"),
        ("in_pixels", "--tag-size"),
        ("not_determined", "--window"),
        ("without_tool", "film the move too"),
    ],
)
def test_the_next_step_fits_the_result(variant: str, word: str) -> None:
    result, _ = getattr(example_result, variant)()
    assert any(word in step for step in next_steps(result))


def test_a_mass_is_asked_for_only_where_it_helps() -> None:
    result, _ = example_result.example()
    settings = replace(result.source.settings, mass_kg=None)
    without = replace(result, source=replace(result.source, settings=settings))
    assert any("--mass" in step for step in next_steps(without))
    assert not any("--mass" in step for step in next_steps(result))
