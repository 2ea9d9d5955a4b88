"""The page's tables, as rows of text: what was found, how sure it is, and how it was measured."""

import math
from dataclasses import fields
from typing import NamedTuple

from tagsway.model import Estimate, Indicators, PendulumEstimate, Prior, Result, Settings, Shaper, TagSummary, Window
from tagsway.report.estimators import BOUND, estimator_lines
from tagsway.report.words import (
    NOT_DETERMINED,
    Rounded,
    describe_pendulum,
    describe_residual,
    format_error,
    format_estimate,
    format_interval,
    format_percent,
    round_estimate,
)

TIME_SOURCES = {
    "container": "the file's own time stamps",
    "option": "the file's time stamps, scaled to --fps",
    "metadata": "the capture rate in the file's metadata",
}


PRIORS = {
    "scale": "scale of both tags",
    "relative_scale": "scale of one tag against the other",
    "vertical_scale": "stretch along z",
    "gravity_tilt": "gravity's direction",
    "quadratic_drag": "drag d",
    "dry_friction": "dry friction",
    "length_over_radius": "stated l/r",
    "length": "stated l",
    "stiffness": "stated k",
}


class Answer(NamedTuple):
    """One of the large numbers at the top of the page; `number` is None where it is not known."""

    label: str
    number: Rounded | None
    unit: str
    detail: str


class Row(NamedTuple):
    """A line of a table: what it is, its value, and a remark."""

    label: str
    value: str
    remark: str = ""


def answers(result: Result) -> list[Answer]:
    """Return the page's large numbers: frequency, damping, length and what the shaper costs."""
    modal, pendulum, shaper = result.modal, result.pendulum, result.shaper
    frequency = None if modal is None else modal.natural_frequency_hz
    ratio = None if modal is None else modal.damping_ratio
    length = None if pendulum is None else pendulum.length_m
    doubt = "" if pendulum is not None and pendulum.determined else describe_pendulum(pendulum)
    spring = _spring_words(pendulum) if pendulum is not None and pendulum.determined else ""
    found = [
        _answer("Natural frequency f_n", frequency, "Hz"),
        _answer("Damping ratio ζ", ratio, ""),
        _answer("Length l", length, "mm", scale=1e3, doubt=doubt or spring),
    ]
    if shaper is None:
        return [*found, Answer("Shaper", None, "", "no shaper without a natural frequency")]
    duration = Rounded(f"{1e3 * shaper.duration_s:.1f}", None, "")
    count = len(shaper.impulses)
    detail = f"{count} impulse{'' if count == 1 else 's'}, added to the move; {describe_residual(shaper)}"
    return [*found, Answer(f"{shaper.type.upper()} shaper", duration, "ms", detail)]


def shaper_rows(shaper: Shaper) -> list[Row]:
    """Return what a shaper was designed for, and what it does."""
    rows = []
    for mode in shaper.modes:
        swing = "" if mode.amplitude_m is None else f"at a swing of {1e3 * mode.amplitude_m:.3g} mm"
        rows.append(Row("designed for", f"{mode.frequency_hz:.5g} Hz, ζ = {mode.damping_ratio:.3g}", swing))
    rows.append(Row("duration", f"{1e3 * shaper.duration_s:.1f} ms", "added to the move"))
    if shaper.box_s is not None:
        rows.append(Row("box", f"{1e3 * shaper.box_s:.1f} ms", "a moving average after the impulses"))
    if shaper.filter is not None:
        rows.append(
            Row("filter", f"of order {len(shaper.filter.denominator) - 1}", "its coefficients are in shaper.json")
        )
    if shaper.time_scale != 1:
        rows.append(Row("time scale", f"{shaper.time_scale:.4g}", "the move is stretched by it first"))
    if shaper.insensitivity_5_percent is not None:
        width = format_percent(shaper.insensitivity_5_percent)
        rows.append(
            Row("tolerates", f"a band {width} wide", "of the frequency, in which at most 5 % of the swing is left")
        )
    if shaper.residual is not None:
        rows.append(Row("leaves", format_percent(shaper.residual.at_mode), "of the swing, at the design frequency"))
    if shaper.residual is not None and shaper.residual.p95 is not None:
        rows.append(Row("leaves at most", format_percent(shaper.residual.p95), "of the swing, in 95 of 100 picks"))
    return rows


def pendulum_rows(pendulum: PendulumEstimate) -> list[Row]:
    """Return what is known of the pendulum, in SI and in newton metres per degree; what is not is left out."""
    per_degree = math.pi / 180
    table: list[tuple[str, Estimate | None, str, float, str]] = [
        ("length l", pendulum.length_m, "mm", 1e3, "equivalent length, J/(m l_c)"),
        ("tag radius r", pendulum.tag_radius_m, "mm", 1e3, "from the pivot to the product's tag"),
        ("pivot above tool tag", pendulum.pivot_offset_m, "mm", 1e3, ""),
        ("stiffness k", pendulum.stiffness_n_m_per_rad, "N·m/rad", 1, ""),
        ("", pendulum.stiffness_n_m_per_rad, "N·m/deg", per_degree, ""),
        ("damping b", pendulum.damping_n_m_s_per_rad, "N·m·s/rad", 1, ""),
        ("", pendulum.damping_n_m_s_per_rad, "N·m·s/deg", per_degree, ""),
        ("k/J", pendulum.stiffness_over_inertia_rad2_s2, "rad²/s²", 1, "needs no mass"),
        ("b/J", pendulum.damping_over_inertia_rad_s, "rad/s", 1, "needs no mass"),
        ("quadratic drag d", pendulum.quadratic_drag_per_rad, "1/rad", 1, ""),
    ]
    rows = [
        Row(label, format_estimate(estimate, unit, scale=scale), remark)
        for label, estimate, unit, scale, remark in table
        if estimate is not None
    ]
    if pendulum.mass_kg is not None:
        rows.append(Row("mass", f"{1e3 * pendulum.mass_kg:.4g} g", "as given"))
    if pendulum.point_mass is not None:
        remark = (
            "r and l agree within their errors" if pendulum.point_mass else "r and l differ: k and b are equivalents"
        )
        rows.append(Row("point mass", "yes" if pendulum.point_mass else "no", remark))
    if pendulum.implied is not None:
        implied = f"{pendulum.implied.natural_frequency_hz:.5g} Hz, ζ = {pendulum.implied.damping_ratio:.3g}"
        rows.append(Row("implied mode", implied, "of the fitted pendulum, to hold against the decay's"))
    if pendulum.rms_residual_m is not None:
        most = "" if pendulum.max_residual_m is None else f", at most {1e3 * pendulum.max_residual_m:.3g} mm"
        rows.append(Row("position error", f"{1e3 * pendulum.rms_residual_m:.3g} mm RMS{most}", "measured − simulated"))
    return [*rows, *_rival_rows(pendulum), *_prior_rows(pendulum.priors)]


def _rival_rows(pendulum: PendulumEstimate) -> list[Row]:
    """Return what other ways of estimating find: the nearest positions of a point mass, and two masses."""
    rows = []
    if (other := pendulum.comparison) is not None:
        text = f"l = {1e3 * other.length_m:.4g} mm, k/J = {other.stiffness_over_inertia_rad2_s2:.4g} rad²/s²"
        remark = f"f_n and ζ of the decay, r = l, the nearest positions: {1e3 * other.rms_residual_m:.3g} mm RMS"
        rows.append(Row("by positions alone", text, remark))
    if (both := pendulum.two_masses) is not None:
        text = f"l = {format_estimate(both.length_m, 'mm', scale=1e3)}"
        text += f", k = {format_estimate(both.stiffness_n_m_per_rad, 'N·m/rad')}"
        remark = f"with {1e3 * both.mass_kg:.4g} g in {both.file}; 0.5 mm between the arms moves k by "
        rows.append(Row("by two masses", text, remark + format_percent(both.stiffness_shift_percent / 100)))
    return rows


def _prior_rows(priors: tuple[Prior, ...]) -> list[Row]:
    """Return what was assumed before the data; widths are one standard deviation."""
    words = []
    for prior in priors:
        name = PRIORS.get(prior.name, prior.name)
        if prior.at_least:
            words.append(f"{name} ≥ {prior.value:g}")
        elif prior.unit == "1":
            percent = f"± {100 * prior.std:.2g} %"
            words.append(f"{name} {percent}" if prior.value == 0 else f"{name} = {prior.value:g} {percent}")
        else:
            value = f"= {prior.value:.4g} " if prior.value else ""
            words.append(f"{name} {value}± {prior.std:.2g} {prior.unit}")
    return [
        Row("assumed", "; ".join(words), "before the data, one standard deviation; it is part of the errors")
    ] * bool(words)


def estimator_rows(result: Result) -> list[tuple[str, str, str, str]]:
    """Return name, frequency, damping ratio and a remark for each estimator, and for the bound."""
    if result.modal is None:
        return []
    lines = estimator_lines(result.modal, result.estimator_details)
    rows = [
        (
            line.name,
            "–" if line.frequency_hz is None else format_estimate(line.frequency_hz, "Hz"),
            "–" if line.damping_ratio is None else format_estimate(line.damping_ratio),
            line.remark,
        )
        for line in lines
        if line.name != BOUND
    ]
    bound = result.modal.bound
    if bound is not None:
        frequency, ratio = f"± {format_error(bound.natural_frequency_hz)} Hz", f"± {format_error(bound.damping_ratio)}"
        rows.append((BOUND, frequency, ratio, lines[-1].remark))
    return rows


def mode_rows(result: Result) -> list[tuple[str, str, str]]:
    """Return frequency, damping ratio and amplitude of each mode, where there is more than one."""
    if result.modal is None or len(result.modal.modes) < 2:
        return []
    return [
        (
            format_estimate(mode.natural_frequency_hz, "Hz"),
            format_estimate(mode.damping_ratio),
            "–" if mode.amplitude_m is None else f"{1e3 * mode.amplitude_m:.3g} mm",
        )
        for mode in result.modal.modes
    ]


def indicator_rows(indicators: Indicators) -> list[Row]:
    """Return how well the filmed move ended."""
    never = "it never stays within ±2 %"
    settling, motion = indicators.settling_time_s, indicators.motion_time_s
    peak, rest = indicators.max_pcp_acceleration_m_s2, indicators.residual_acceleration_m_s2
    rows = [
        Row("trajectory time", f"{indicators.trajectory_time_s:.3f} s", "the tool's motion"),
        Row("settling time", never if settling is None else f"{settling:.3f} s", "from the start, within ±2 %"),
        Row("motion time", never if motion is None else f"{motion:.3f} s", "the longer of the two"),
        Row("overshoot", f"{indicators.overshoot_percent:.2f} %", f"of {1e3 * indicators.reference_m:.4g} mm"),
    ]
    if peak.horizontal is not None:
        below = f"of the product, seen up to {peak.bandwidth_hz:.3g} Hz"
        rows.append(Row("peak acceleration", format_estimate(peak.horizontal, "m/s²"), below))
    if peak.vector_with_gravity is not None:
        rows.append(
            Row("with gravity", format_estimate(peak.vector_with_gravity, "m/s²"), "what the gripper must hold")
        )
    if rest is not None:
        rows.append(Row("after the move", f"{rest.max:.3g} m/s² at most, {rest.rms:.3g} m/s² RMS", "of the product"))
    if indicators.box_error_m is not None:
        below = "from the descent on, below a rim 50 mm above its place; the thesis' box has room for 15 mm"
        rows.append(Row("error in the box", f"{1e3 * indicators.box_error_m:.3g} mm", below))
    return rows


def measurement_rows(result: Result) -> list[Row]:
    """Return how it was measured: file, clock, tags, scale, window and settings."""
    rows = [Row("file", result.source.file, f"SHA-256 {result.source.sha256[:16]}…")]
    video = result.video
    if video is not None:
        lost = f"{video.dropped} dropped, {video.duplicated} duplicated"
        rows.append(
            Row("video", f"{video.frames} frames of {video.width} × {video.height}, {video.duration_s:.3f} s", lost)
        )
        rounding = f"{TIME_SOURCES[video.time_source]}, rounded to {1e3 * video.pts_rounding_s:.3g} ms"
        rows.append(Row("frame rate", f"{video.fps_hz:.6g} Hz", rounding))
    for name, tag in (("tool", result.tags.tcp), ("product", result.tags.pcp), ("reference", result.tags.reference)):
        if tag is not None:
            rows.append(_tag_row(name, tag))
    if result.window_s is not None:
        start, end = result.window_s
        modal = result.modal
        remark = "" if modal is None else f"{modal.cycles:.1f} cycles"
        if modal is not None and modal.noise_m is not None:
            remark += f", noise {1e3 * modal.noise_m:.2g} mm"
        rows.append(Row("free vibration", f"{start:.3f} to {end:.3f} s", remark))
        if modal is not None and modal.amplitude_m is not None:
            rows.append(Row("swing", format_estimate(modal.amplitude_m, "mm", scale=1e3), "mean over the window"))
        if modal is not None and modal.operating_frequency_hz is not None:
            text = format_estimate(modal.operating_frequency_hz, "Hz")
            rows.append(
                Row("frequency at this swing", text, "at the window's mean amplitude; the shaper is made for it")
            )
    up = f"up is taken from: {result.frame.up_source}"
    rows.append(Row("coordinates", result.frame.axes, f"zero: {result.frame.origin}; {up}"))
    chosen = _chosen(result.source.settings)
    if chosen:
        rows.append(Row("settings", chosen, "the others are the defaults"))
    return rows


def _answer(label: str, estimate: Estimate | None, unit: str, *, scale: float = 1.0, doubt: str = "") -> Answer:
    if estimate is None:
        return Answer(label, None, unit, doubt.removeprefix(f"{NOT_DETERMINED}: "))
    interval = f"95 %: {format_interval(estimate, scale=scale)}"
    return Answer(label, round_estimate(estimate, scale=scale), unit, doubt or interval)


def _spring_words(pendulum: PendulumEstimate) -> str:
    """Return stiffness and damping in short, over the inertia where there is no mass."""
    table = (
        ("k", pendulum.stiffness_n_m_per_rad, "N·m/rad", "k/J", pendulum.stiffness_over_inertia_rad2_s2, "rad²/s²"),
        ("b", pendulum.damping_n_m_s_per_rad, "N·m·s/rad", "b/J", pendulum.damping_over_inertia_rad_s, "rad/s"),
    )
    words = []
    for name, estimate, unit, ratio_name, ratio, ratio_unit in table:
        if estimate is not None:
            words.append(f"{name} = {format_estimate(estimate, unit)}")
        elif ratio is not None:
            words.append(f"{ratio_name} = {format_estimate(ratio, ratio_unit)}")
    return "; ".join(words)


def _tag_row(name: str, tag: TagSummary) -> Row:
    who = f"{name}'s tag" if tag.id is None else f"{name}'s tag, id {tag.id}"
    scale = "no scale: its size was not given" if tag.mm_per_px is None else format_estimate(tag.mm_per_px, "mm/px")
    return Row(who, f"seen in {100 * tag.detected:.1f} % of the frames", scale)


def _chosen(settings: Settings) -> str:
    default = Settings()
    changed = [f.name for f in fields(settings) if getattr(settings, f.name) != getattr(default, f.name)]
    return ", ".join(f"{name} = {_setting(getattr(settings, name))}" for name in changed)


def _setting(value: object) -> str:
    if isinstance(value, Window):
        return f"{value.start_s:g}:{value.end_s:g}"
    return " ".join(value) if isinstance(value, tuple) else str(value)
