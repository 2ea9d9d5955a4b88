"""The documents' numbers of shapers: each function takes its section of the reference and yields a `Row` a number.

The key of a row is the path of its number in the reference, so that none can be forgotten.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rows import LINES, Row, compare, compare_each, compare_listed, mode_of, times_of
from tagsway.model import DesignMode, FloatArray, Impulse, Shaper
from tagsway.shapers import design_shaper, insensitivity, residual_vibration
from tagsway.shapers.impulses import Impulses, convolve_impulses
from tagsway.shapers.response import step_indicators
from tagsway.shapers.zero_delay import Command, zero_delay_prices

PLANT = 39.36 / (2 * math.pi)
"""Document 3 writes Hz; its own table needs rad/s."""


def _amplitudes(shaper: Shaper) -> list[float]:
    return [impulse.amplitude for impulse in shaper.impulses]


def _by_hand(time_s: Sequence[float], amplitude: Sequence[float]) -> Shaper:
    total = math.fsum(amplitude)
    pairs = zip(time_s, amplitude, strict=True)
    return Shaper(type="given", modes=(), impulses=tuple(Impulse(time_s=t, amplitude=a / total) for t, a in pairs))


def impulse_shapers(section: Mapping[str, Any]) -> Iterator[Row]:
    """Documents 1 and 3: impulses, residual vibration, insensitivity."""
    unit = DesignMode(frequency_hz=1.0, damping_ratio=0.0)
    for name, prefix in {"zv": "ZV", "zvd": "ZVD", "ei": "EI_V5_exact"}.items():
        shaper = design_shaper(name, unit)
        worst = max(residual_vibration(shaper, mode_of(1 + error, 0.0)) for error in (-0.15, 0.15))
        yield compare_listed(f"{prefix}_V_percent_at_15pct", section[f"{prefix}_V_percent_at_15pct"], 100 * worst)
        half = 50 * insensitivity(shaper)
        yield compare_listed(f"{prefix}_halfwidth_percent_V5", section[f"{prefix}_halfwidth_percent_V5"], half)
    closed = section["insensitivity_closed_forms"]["values_percent_V5"]
    halves = [50 * insensitivity(design_shaper(name, unit)) for name in ("zv", "zvd", "ei")]
    yield from compare_each("insensitivity_closed_forms / values_percent_V5", closed, halves, 5.1e-5)
    for name, line in LINES.items():
        entry, shaper = section[f"thesis_ZV_{name}"], design_shaper("zv", line)
        yield from compare_each(f"thesis_ZV_{name} / A", entry["A"], _amplitudes(shaper), 5.1e-9)
        yield from compare_each(f"thesis_ZV_{name} / t", entry["t"], times_of(shaper), 5.1e-9)
        start = f"thesis_V_percent_{name}_"
        for key in (key for key in section if key.startswith(start)):
            value = key.removeprefix(start)
            frequency = (
                float(value.removesuffix(" Hz"))
                if value.endswith("Hz")
                else line.frequency_hz * (1 + float(value.removesuffix("%")) / 100)
            )
            left = residual_vibration(shaper, mode_of(frequency, line.damping_ratio))
            yield compare_listed(key, section[key], 100 * left)
    for key in (key for key in section if key.startswith("EI_V5_zeta")):
        yield from _extra_insensitive(key, section[key])


def _extra_insensitive(key: str, entry: Mapping[str, Any]) -> Iterator[Row]:
    zeta = float(key.removeprefix("EI_V5_zeta"))
    mode = mode_of(1.0, zeta)
    exact = design_shaper("ei", DesignMode(frequency_hz=1.0, damping_ratio=zeta))
    period = mode.damped_period_s
    yield from compare_each(f"{key} / exact_A", entry["exact_A"], _amplitudes(exact), entry["tol"])
    yield from compare_each(
        f"{key} / exact_t_over_Td", entry["exact_t_over_Td"], np.divide(times_of(exact), period), entry["tol"]
    )
    fits = [
        _by_hand([0, entry["fit_t2_over_Td"] * period, period], entry[name])
        for name in ("fit_corrected_A", "fit_as_printed_seed002_A")
    ]
    left = [residual_vibration(shaper, mode) for shaper in (exact, *fits)]
    # the fits' amplitudes are given to six decimals
    yield from compare_each(f"{key} / V_nominal_exact/corr/printed", entry["V_nominal_exact/corr/printed"], left, 3e-6)


def dual_mode_steps(section: Mapping[str, Any]) -> Iterator[Row]:
    """Document 3, Table 5: steps through shapers that are designed 10 % low."""
    first, second = (DesignMode(frequency_hz=w / (2 * math.pi), damping_ratio=0.05) for w in (35.424, 36.405))
    plant = mode_of(PLANT, 0.05)
    for key, entry in section.items():
        if key == "interpretation":
            continue
        kinds = key.lower().split("-")
        parts = [design_shaper(kind, mode) for kind, mode in zip(kinds, (first, second), strict=False)]
        sequence = convolve_impulses(
            *(Impulses(time_s=np.array(times_of(part)), amplitude=np.array(_amplitudes(part))) for part in parts)
        )
        shaper = _by_hand(sequence.time_s.tolist(), sequence.amplitude.tolist())
        step = step_indicators(shaper, plant)
        yield compare_listed(f"{key} / overshoot_pct", entry["overshoot_pct"], step.overshoot_percent)
        yield compare_listed(f"{key} / settling_5pct_s", entry["settling_5pct_s"], step.settling_s)
        if "impulses" in entry:
            yield compare(f"{key} / impulses", entry["impulses"], len(shaper.impulses), 0)
            # an exact EI ends at 0.998 of the damped period that the reference counts for it
            tolerance = 1e-5 + 0.0018 * kinds.count("ei") * plant.damped_period_s * 39.36 / 35.424
            yield compare(f"{key} / duration_s", entry["duration_s"], shaper.duration_s, tolerance)


def zero_delay(section: Mapping[str, Any]) -> Iterator[Row]:
    """Document 2: how long the move must be, and what hastening it costs."""
    mode = DesignMode(frequency_hz=2.55, damping_ratio=0.04)
    zvd = design_shaper("zvd", mode)
    yield from compare_each("ZVD / A", section["ZVD"]["A"], _amplitudes(zvd), 5.1e-9)
    yield from compare_each("ZVD / t", section["ZVD"]["t"], times_of(zvd), 5.1e-9)
    yield compare_listed("Delta_n_ZVD_s", section["Delta_n_ZVD_s"], zvd.duration_s)
    scales = {"alpha": 0.4653, "alpha_prime": 0.6516}
    durations = {"alpha": zvd.duration_s / (1 - 0.4653), "alpha_prime": zvd.duration_s * 0.6516 / (1 - 0.6516)}
    for name, duration in durations.items():
        kind = "ztd-zvd" if name == "alpha" else "mztd-zvd"
        made = design_shaper(kind, mode, move_duration_s=duration)
        assert abs(made.time_scale - scales[name]) < 1e-12
        yield compare_listed(f"T_from_{name}_s", section[f"T_from_{name}_s"], duration)
    key = "alpha_prime_from_alpha=1/(2-alpha)"
    modified = design_shaper("mztd-zvd", mode, move_duration_s=durations["alpha"])
    yield compare_listed(key, section[key], modified.time_scale)
    yield compare_listed("delay_over_T", section["delay_over_T"], zvd.duration_s / durations["alpha"])
    assert modified.filter is not None
    above, below = modified.filter.numerator, modified.filter.denominator
    yield compare("F_dc", section["F_dc"], above[-1] / below[-1], 1e-12)
    yield compare("F_inf", section["F_inf"], above[0] / below[0], 1e-5)
    yield from _hastened_moves(section, mode, durations["alpha"])


def _hastened_moves(section: Mapping[str, Any], mode: DesignMode, duration_s: float) -> Iterator[Row]:
    names = ("none", "IS", "ZTD", "MZTD")
    shaped = [design_shaper(kind, mode, move_duration_s=duration_s) for kind in ("zvd", "ztd-zvd", "mztd-zvd", "zv")]
    nominal, errors = mode_of(2.55, 0.04), (-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15)
    prices = {
        command: zero_delay_prices(unit, duration_s, nominal, shaped, sample_time_s=1e-4, frequency_error=errors)
        for command, unit in _unit_moves(duration_s).items()
    }
    for command, found in prices.items():
        for name, price in zip(names, found, strict=False):
            key, entry = (
                f"quintic_unit_move_T0.734 / {command}_{name}",
                section["quintic_unit_move_T0.734"][f"{command}_{name}"],
            )
            yield compare(f"{key} / end", entry["end"], price.end_s, 1e-6)
            yield compare(f"{key} / resid", entry["resid"], float(price.residual[3]), 1e-5)
            yield compare(f"{key} / vmax", entry["vmax"], price.peak_velocity, 2e-3 * entry["vmax"])
            yield compare(f"{key} / amax", entry["amax"], price.peak_acceleration, 5e-3 * entry["amax"])
    left = max(float(prices[command][3].residual[3]) for command in prices)
    yield compare("residual_nominal_MZTD_max", 0.0, left, section["residual_nominal_MZTD_max"])
    for i, error in enumerate(errors):
        entry, actual = section["robustness_residual_quintic"][f"{error:g}"], mode_of(2.55 * (1 + error), 0.04)
        key = f"robustness_residual_quintic / {error:g}"
        zvd, _, modified, zv = (residual_vibration(shaper, actual) for shaper in shaped)
        # The reference counts the third at the move's end, T; V is counted at the last impulse.
        later = duration_s - times_of(shaped[2])[-1]
        modified *= math.exp(-actual.damping_ratio * actual.angular_frequency_rad_s * later)
        for name, ours in {"V_ZVD": zvd, "V_ZV": zv, "H_MZTD": modified}.items():
            yield compare(f"{key} / {name}", entry[name], ours, 1e-9)
        for name, price in zip((*names, "ZV"), prices["quintic"], strict=True):
            yield compare(f"{key} / {name}", entry[name], float(price.residual[i]), 1e-5)


def _unit_moves(duration_s: float) -> dict[str, Command]:
    """Return the moves by 1 that the reference lays the shapers over."""

    def quintic(time_s: FloatArray) -> FloatArray:
        s = time_s / duration_s
        return s**3 * (10 - 15 * s + 6 * s**2)

    def bang_bang(time_s: FloatArray) -> FloatArray:
        s = time_s / duration_s
        return np.where(s < 0.5, 2 * s**2, 1 - 2 * (1 - s) ** 2)

    def thirds(time_s: FloatArray) -> FloatArray:
        s = time_s / duration_s
        return np.select([s < 1 / 3, s < 2 / 3], [2.25 * s**2, 1.5 * s - 0.25], 1 - 2.25 * (1 - s) ** 2)

    return {"quintic": quintic, "bangbang": bang_bang, "trapv": thirds}
