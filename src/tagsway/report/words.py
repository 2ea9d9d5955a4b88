"""Numbers and results in words: for the terminal and for the page."""

import math
from typing import NamedTuple

from tagsway.model import Estimate, ModalEstimate, Notice, PendulumEstimate, Result, Shaper
from tagsway.report.estimators import find_disagreements
from tagsway.report.style import length_unit

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NOT_DETERMINED = "not determined"
UNEVEN = 0.1
"""Part of an interval by which its middle may lie beside the value before the interval itself is told."""
UNKNOWN_SPREAD = "one video cannot tell how much the frequency varies between picks: film repeats"


class Rounded(NamedTuple):
    """An estimate as text: ``(value ± error)``, and the power of ten that both share, if any."""

    value: str
    error: str | None
    power: str


def round_estimate(estimate: Estimate, *, scale: float = 1.0) -> Rounded:
    """Round a value to the second significant digit of its standard error.

    Parameters
    ----------
    estimate : Estimate
        The value and its standard error.
    scale : float
        Factor from its unit to the one that is shown.

    Returns
    -------
    Rounded
        ``error`` is None where the standard error is zero or infinite. Below 1e-3 and from 1e6 on, value and error
        share a power of ten. An error under a millionth of the value is written with an exponent of its own.
    """
    value, error = estimate.value * scale, estimate.std * abs(scale)
    largest = max(abs(value), error) if math.isfinite(error) else abs(value)
    exponent = math.floor(math.log10(largest)) if largest > 0 else 0
    shift = 0 if -3 <= exponent < 6 else exponent
    value, error = value / 10.0**shift, error / 10.0**shift
    power = f"×10{str(shift).translate(SUPERSCRIPT)}" if shift else ""
    if not (error > 0 and math.isfinite(error)):
        return Rounded(f"{value:.6g}" if error == 0 else f"{value:.3g}", None, power)
    if error < 1e-6 * abs(value):
        return Rounded(f"{value:.7g}", f"{error:.1e}", power)
    error = float(f"{error:.1e}")
    decimals = 1 - math.floor(math.log10(error))
    return Rounded(_fixed(value, decimals), _fixed(error, decimals), power)


def format_estimate(estimate: Estimate, unit: str = "", *, scale: float = 1.0) -> str:
    """Return ``value ± error unit``, with two significant digits of the error (one standard error).

    Parameters
    ----------
    estimate : Estimate
        The value and its standard error.
    unit : str
        As it is shown; empty for a ratio.
    scale : float
        Factor from the estimate's unit to the one that is shown: 1000 for metres as mm.

    Returns
    -------
    str
        For example ``2.4731 ± 0.0012 Hz`` or ``(9.02 ± 0.31)×10⁻⁸ N·m·s/deg``.
    """
    value, error, power = round_estimate(estimate, scale=scale)
    number = value if error is None else f"{value} ± {error}"
    if power:
        number = f"({number}){power}" if error is not None else f"{number}{power}"
    unknown = " (error not known)" if math.isinf(estimate.std) else ""
    return f"{number} {unit}".rstrip() + unknown


def format_interval(estimate: Estimate, unit: str = "", *, scale: float = 1.0) -> str:
    """Return the 95 % interval as ``low to high unit``, to two digits of a quarter of its width."""
    low, high = sorted(end * scale for end in estimate.ci95)
    width = high - low
    if not math.isfinite(width):
        return f"{_open_end(low)} to {_open_end(high)} {unit}".rstrip()
    largest = max(abs(low), abs(high))
    exponent = math.floor(math.log10(largest)) if largest > 0 else 0
    shift = 0 if -3 <= exponent < 6 else exponent
    low, high, width = low / 10.0**shift, high / 10.0**shift, width / 10.0**shift
    decimals = min(1 - math.floor(math.log10(width / 4)), 9) if width > 0 else 6
    ends = f"{_fixed(low, decimals)} to {_fixed(high, decimals)}"
    return f"({ends})×10{str(shift).translate(SUPERSCRIPT)} {unit}".rstrip() if shift else f"{ends} {unit}".rstrip()


def format_percent(fraction: float) -> str:
    """Return a fraction as percent, to a tenth below ten percent."""
    percent = 100 * fraction
    if 0 <= percent < 0.05:
        return "below 0.1 %"
    return f"{percent:.1f} %" if percent < 10 else f"{percent:.0f} %"


def format_error(error: float) -> str:
    """Return a standard error with two significant digits, without an exponent where that is readable."""
    if not (1e-7 <= error < 1e6):
        return f"{error:.2g}"
    return _fixed(error, 1 - math.floor(math.log10(error)))


def describe_residual(shaper: Shaper) -> str:
    """Say how much swing a shaper leaves at the frequency it was designed for."""
    if shaper.residual is None:
        return "its residual vibration was not computed"
    return f"{format_percent(shaper.residual.at_mode)} of the swing is left at the design frequency"


def describe_spread(shaper: Shaper) -> str:
    """Say how much swing a shaper leaves over the spread between picks, or that this is not known."""
    residual = shaper.residual
    if residual is None or residual.p95 is None:
        return UNKNOWN_SPREAD
    spread = residual.spread
    source = "" if spread is None else f" (spread {spread.natural_frequency_std_percent:.3g} %, {spread.source})"
    return f"at most {format_percent(residual.p95)} of the swing is left in 95 of 100 picks{source}"


def describe_pendulum(pendulum: PendulumEstimate | None) -> str:
    """Say whether length and stiffness are told apart, and why, without a full stop."""
    if pendulum is None:
        return "no pendulum was fitted"
    verdict = "length and stiffness are told apart by this record" if pendulum.determined else NOT_DETERMINED
    reason = pendulum.reason.rstrip(". ")
    return f"{verdict}: {reason}" if reason else verdict


def split_events(result: Result) -> tuple[list[str], list[Notice]]:
    """Return the sentences on what happened to the grip, and the other warnings, mere remarks last."""
    kinds = {event.kind for event in result.events}
    sentences = [notice.message for notice in result.warnings if notice.code in kinds]
    others = (notice for notice in result.warnings if notice.code not in kinds)
    return sentences, sorted(others, key=lambda notice: notice.is_remark)


def describe_modes(result: Result) -> list[str]:
    """Return a sentence on each further mode, and one on what the shaper is designed for."""
    modal, shaper, sentences = result.modal, result.shaper, []
    for mode in () if modal is None else modal.modes[1:]:
        size = "" if mode.amplitude_m is None else f", {1e3 * mode.amplitude_m:.2g} mm"
        ratio = f"ζ = {format_estimate(mode.damping_ratio)}"
        sentences.append(f"A further mode: {format_estimate(mode.natural_frequency_hz, 'Hz')}, {ratio}{size}.")
    if shaper is not None and shaper.modes:
        first = shaper.modes[0]
        swing = "" if first.amplitude_m is None else f", a mean of {1e3 * first.amplitude_m:.3g} mm"
        sentences.append(
            f"The shaper is designed for {first.frequency_hz:.5g} Hz and ζ = {first.damping_ratio:.3g}: the payload's "
            f"at the swing that was seen{swing}."
        )
    return sentences


def describe_agreement(result: Result) -> str:
    """Say whether an estimator disagrees with the one that decides."""
    if result.modal is None:
        return ""
    names = find_disagreements(result.modal, result.estimator_details)
    if not names:
        return "Here they agree within what matters."
    return f"Here {', '.join(names)} disagree{'s' if len(names) == 1 else ''}: look at the decay for the reason."


def describe_excitation(result: Result) -> str:
    """Say how much of the filmed move falls on the payload's frequency; empty where there was none."""
    excited = result.excitation
    if excited is None:
        return ""
    peak, push = format_percent(excited.share_of_peak.value), format_percent(excited.share_of_push.value)
    level = ""
    if excited.sway_m is not None:
        level = f"; without lift and drag a move like this leaves a sway of {1e3 * excited.sway_m.value:.3g} mm"
    return (
        f"At {excited.frequency_hz:.4g} Hz the move's spectrum has {peak} of its peak at {excited.strongest_hz:.2g} "
        f"Hz, and {push} of what pushes of this size could do at worst{level}."
    )


def summary_lines(result: Result) -> list[str]:
    """Return what a measurement told, a line each, for a terminal.

    Parameters
    ----------
    result : Result
        Of one measurement.

    Returns
    -------
    list of str
        Without line breaks, control characters or markup; what happened to the grip comes first, the warnings and then
        the notes last.
    """
    sentences, warnings = split_events(result)
    lines = [_line("event", sentence) for sentence in sentences]
    lines += [*_modal_lines(result), *_pendulum_lines(result.pendulum), *_shaper_lines(result.shaper)]
    lines += [_line("note" if notice.is_remark else "warning", notice.message) for notice in warnings]
    return [plain(line) for line in lines]


def next_steps(result: Result) -> list[str]:
    """Return what to do next, most useful first, in plain words."""
    steps = []
    modal, pendulum, settings = result.modal, result.pendulum, result.source.settings
    known = modal is not None and modal.natural_frequency_hz is not None
    if not known:
        steps.append(
            "Film again so that the product swings freely for ten cycles or more after the tool has stopped, with both "
            "tags in view; or name the free part of this record with --window START:END."
        )
    elif result.status == "degraded":
        steps.append("Read the warnings above first; film again where one of them can be mended.")
    if result.shaper is not None:
        steps.append("Shape a move: identify trajectory --shaper shaper.json --move move.toml --out trajectory.csv")
        if result.shaper.residual is not None and result.shaper.residual.p95 is None:
            steps.append(
                "Film repeats, with a new pick each time: the frequency varies between picks far more than the error "
                "of one video. Give the spread that you find with --frequency-spread PERCENT."
            )
        steps.append("Run the shaped move slowly, then at full speed, film it, and compare what swing is left.")
    no_lengths = length_unit(result) != "m"
    if no_lengths and result.video is not None:
        steps.append("Measure the side of the tags' black square and give it with --tag-size MM: lengths need a scale.")
    if known and pendulum is not None and not pendulum.determined and not no_lengths:
        steps.append("To tell length from stiffness, film the move too, with a swing of 0.3 rad or more and some lift.")
    if known and settings.mass_kg is None and pendulum is not None and pendulum.determined:
        steps.append("Weigh the product and give it with --mass G: stiffness and damping need it.")
    return steps


def plain(text: str) -> str:
    """Return text on one line without control characters, which a file name may carry to a terminal."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))


def _modal_lines(result: Result) -> list[str]:
    modal = result.modal
    if modal is None or modal.natural_frequency_hz is None:
        return [_line("natural frequency", NOT_DETERMINED)]
    frequency, ratio = modal.natural_frequency_hz, modal.damping_ratio
    interval = f" (95 %: {format_interval(frequency, 'Hz')})"
    lines = [
        _line("natural frequency", format_estimate(frequency, "Hz") + interval),
        _line("damping ratio", NOT_DETERMINED if ratio is None else format_estimate(ratio) + _uneven_interval(ratio)),
    ]
    if modal.operating_frequency_hz is not None:
        lines.append(_line("at this swing", _swing_words(modal, designed=result.shaper is not None)))
    for mode in modal.modes[1:]:
        ratio_words = f"damping ratio {format_estimate(mode.damping_ratio)}"
        lines.append(_line("further mode", f"{format_estimate(mode.natural_frequency_hz, 'Hz')}, {ratio_words}"))
    if result.window_s is not None:
        start, end = result.window_s
        swing = (
            "" if modal.amplitude_m is None else f", {format_estimate(modal.amplitude_m, 'mm', scale=1e3)} on average"
        )
        lines.append(_line("free vibration", f"{start:.2f} to {end:.2f} s, {modal.cycles:.1f} cycles{swing}"))
    return lines


def _swing_words(modal: ModalEstimate, *, designed: bool) -> str:
    assert modal.operating_frequency_hz is not None
    words, ratio = format_estimate(modal.operating_frequency_hz, "Hz"), modal.operating_damping_ratio
    if ratio is not None:
        words += f", damping ratio {format_estimate(ratio)}"
    return words + (" (what the shaper is designed for)" if designed else "")


def _uneven_interval(estimate: Estimate) -> str:
    """Return the interval in words, where the standard error does not tell it."""
    low, high = estimate.ci95
    middle = (low + high) / 2
    return f" (95 %: {format_interval(estimate)})" if abs(middle - estimate.value) > UNEVEN * (high - low) else ""


def _pendulum_lines(pendulum: PendulumEstimate | None) -> list[str]:
    if pendulum is None:
        return []
    lines = []
    if pendulum.length_m is not None:
        lines.append(_line("length l", format_estimate(pendulum.length_m, "mm", scale=1e3)))
    if pendulum.tag_radius_m is not None:
        lines.append(_line("tag radius r", format_estimate(pendulum.tag_radius_m, "mm", scale=1e3)))
    if pendulum.stiffness_n_m_per_rad is not None:
        lines.append(_line("stiffness k", format_estimate(pendulum.stiffness_n_m_per_rad, "N·m/rad")))
    elif pendulum.stiffness_over_inertia_rad2_s2 is not None:
        lines.append(_line("stiffness k/J", format_estimate(pendulum.stiffness_over_inertia_rad2_s2, "rad²/s²")))
    if pendulum.damping_n_m_s_per_rad is not None:
        lines.append(_line("damping b", format_estimate(pendulum.damping_n_m_s_per_rad, "N·m·s/rad")))
    elif pendulum.damping_over_inertia_rad_s is not None:
        lines.append(_line("damping b/J", format_estimate(pendulum.damping_over_inertia_rad_s, "rad/s")))
    if not pendulum.determined:
        lines.append(_line("pendulum", describe_pendulum(pendulum)))
    return lines


def _shaper_lines(shaper: Shaper | None) -> list[str]:
    if shaper is None:
        return []
    count = len(shaper.impulses)
    impulses = f"{count} impulse{'' if count == 1 else 's'}"
    return [
        _line("shaper", f"{shaper.type.upper()}, {impulses}, adds {1e3 * shaper.duration_s:.1f} ms"),
        _line("residual", f"{describe_residual(shaper)}; {describe_spread(shaper)}"),
    ]


def _line(name: str, text: str) -> str:
    return f"{name}: {text}"


def _fixed(value: float, decimals: int) -> str:
    rounded = round(value, decimals) + 0.0  # + 0.0 turns -0.0 into 0.0
    return f"{rounded:.{max(decimals, 0)}f}"


def _open_end(value: float) -> str:
    if math.isfinite(value):
        return f"{value:.4g}"
    return "∞" if value > 0 else "-∞"
