"""What a set of measurements says, in words and as rows of its page's tables."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from tagsway.model import Estimate, Shaper
from tagsway.report.words import format_estimate

Record = Mapping[str, Any]

QUANTITIES = {"natural_frequency_hz": "natural frequency", "damping_ratio": "damping ratio"}

SURE = 0.05
"""Chance with which any of the effects of a set may be called sure where there is none."""


MOST_LOG = 100.0
"""Of a change: what would be more is no number to show."""


class SummaryTable(NamedTuple):
    """One set's subsets as Tables 4.2 and 4.3 of the thesis have them."""

    name: str
    rows: tuple[tuple[str, ...], ...]


def number(value: object, form: str = ".4g") -> str:
    """Return a number as text, a dash where there is none."""
    if value is None or value != value:
        return "–"
    return format(value, form)


def summary_tables(summary: Sequence[Record], *, whole: str) -> list[SummaryTable]:
    """Return a table for each set, its subsets in their order and the set itself last.

    Parameters
    ----------
    summary : sequence of mapping
        The rows of summary.csv.
    whole : str
        The name that stands for all subsets.

    Returns
    -------
    list of SummaryTable
        With subset, n, failed, rejected, median f_n, ± %, s, median ζ, ± %, s.
    """
    sets = list(dict.fromkeys(row["set"] or "" for row in summary if row["subset"] != whole))
    tables = []
    for name in sets:
        own = [row for row in summary if (row["set"] or "") == name and row["subset"] != whole]
        last = [
            row for row in summary if row["subset"] == whole and (row["set"] or "") == (name if len(sets) > 1 else "")
        ]
        rows = [_summary_row(row, row["subset"]) for row in own]
        rows += [_summary_row(row, "all of them") for row in last[:1] if len(own) > 1]
        tables.append(SummaryTable(name=name, rows=tuple(rows)))
    return tables


def spread_rows(summary: Sequence[Record], *, whole: str) -> list[tuple[str, ...]]:
    """Return subset, spread between repeats, its interval and the error of a single one, where they are known."""
    return [
        (
            str(row["subset"]),
            f"{number(row['between_s_hz'], '.4f')} Hz",
            f"{number(row['between_s_low_hz'], '.4f')} to {number(row['between_s_high_hz'], '.4f')} Hz",
            f"{number(row['within_s_hz'], '.2g')} Hz",
        )
        for row in summary
        if row["subset"] != whole and row["between_s_hz"] is not None
    ]


def share_rows(shares: Sequence[Record], *, whole: str) -> list[tuple[str, ...]]:
    """Return quantity, other factors, the share with its error and interval in percent, and how many repeats."""
    return [
        (
            QUANTITIES[row["quantity"]],
            "all together" if row["factors"] == whole else row["factors"] or "–",
            f"{100 * row['share']:.0f} ± {100 * row['std']:.0f} %",
            f"{100 * row['low']:.0f} to {100 * row['high']:.0f} %",
            f"{row['n_varied']} varied, {row['n_held']} held",
        )
        for row in shares
    ]


def describe_effects(effects: Sequence[Record], spans: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return a sentence for each effect, the sure ones first, then those that are not seen, then what is not told.

    Parameters
    ----------
    effects : sequence of mapping
        The rows of effects.csv.
    spans : mapping of str to (float, float)
        Over which each continuous factor was varied.
    """
    told = [row for row in effects if not row["remark"]]
    limit = SURE / max(1, len(told))
    sure = [row for row in told if row["p_value"] < limit]
    sentences = [_effect_words(row, spans, seen=True) for row in sure]
    sentences += [_effect_words(row, spans, seen=False) for row in told if not row["p_value"] < limit]
    for row in effects:
        if row["remark"]:
            who = f"{row['factor']} {row['level']}".strip()
            sentences.append(f"{_capital(QUANTITIES[row['quantity']])}: what {who} does is not told: {row['remark']}.")
    return sentences


def effect_over_span(row: Record, spans: Mapping[str, tuple[float, float]]) -> tuple[Estimate, str]:
    """Return an effect as it is drawn, a continuous factor's over the span in which it was varied, and its name."""
    factor, scale = row["factor"], 1.0
    words = f"{factor}: {row['level']} against {row['against']}"
    if not row["against"]:
        low, high = spans[factor]
        scale, words = high - low, f"{factor}: {high:g} against {low:g}"
    effect, low, high = row["effect"], row["low"], row["high"]
    if not row["unit"].startswith("%"):
        return Estimate(value=scale * effect, std=scale * row["std"], ci95=(scale * low, scale * high)), words
    value, *ends = (_compound(percent, scale) for percent in (effect, low, high))
    std = row["std"] * scale * (100 + value) / (100 + effect) if effect > -100 else math.nan
    return Estimate(value=value, std=std, ci95=(ends[0], ends[1])), words


def _compound(percent: float, times: float) -> float:
    """Return what a change by so many percent comes to after so many times: slopes are of the logarithm."""
    return 100 * math.expm1(min(times * math.log1p(percent / 100), MOST_LOG)) if percent > -100 else percent


def describe_set_shaper(shaper: Shaper | None, reason: str) -> str:
    """Return what the shaper for a whole set is good for, or why there is none."""
    if shaper is None:
        return f"There is no shaper: {reason}."
    words = f"{shaper.type.upper()}, {len(shaper.impulses)} impulses, adds {1e3 * shaper.duration_s:.1f} ms to a move"
    rest = shaper.residual
    if rest is None or rest.spread is None or rest.p95 is None:
        return f"{words}. The spread between measurements is not known: film repeats."
    percent, n = rest.spread.natural_frequency_std_percent, rest.spread.n
    return (
        f"{words}. Over the spread between measurements, {percent:.2g} % of the frequency ({n} measurements), it "
        f"leaves at most {100 * rest.p95:.2g} % of the swing in 95 of 100 moves."
    )


def _summary_row(row: Record, name: str) -> tuple[str, ...]:
    return (
        name,
        str(row["n"]),
        str(row["failed"]),
        str(row["rejected"]),
        number(row["natural_frequency_median_hz"], ".4f"),
        number(row["natural_frequency_deviation_percent"], ".2f"),
        number(row["natural_frequency_s_hz"], ".4f"),
        number(row["damping_ratio_median"], ".5f"),
        number(row["damping_ratio_deviation_percent"], ".1f"),
        number(row["damping_ratio_s"], ".2g"),
    )


def _effect_words(row: Record, spans: Mapping[str, tuple[float, float]], *, seen: bool) -> str:
    effect, name = effect_over_span(row, spans)
    unit = row["unit"].partition(" ")[0]
    known = math.isfinite(effect.std) and effect.std > 0
    amount = format_estimate(effect, unit) if known else f"{effect.value:.4g} {unit}"
    words = f"{_capital(QUANTITIES[row['quantity']])}, {name}: {amount}"
    return f"{words}." if seen else f"{words}: not sure to differ from nothing."


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
