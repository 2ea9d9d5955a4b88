"""A comparison in words and tables: the same for the terminal and the page."""

from collections.abc import Mapping, Sequence
from math import comb
from types import MappingProxyType
from typing import NamedTuple

from tagsway.model import Comparison, ConditionSummary, Difference, Exchange, PickRate, Promise


class Quantity(NamedTuple):
    """What a quantity is called, its unit, and the decimals that are shown."""

    label: str
    unit: str
    digits: int


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "motion_time_s": Quantity("motion time", "s", 3),
        "settling_time_s": Quantity("settling time", "s", 3),
        "trajectory_time_s": Quantity("trajectory time", "s", 3),
        "overshoot_percent": Quantity("overshoot", "%", 2),
        "max_pcp_acceleration_m_s2": Quantity("max. PCP acceleration", "m/s²", 2),
        "max_pcp_vector_m_s2": Quantity("with gravity", "m/s²", 2),
        "residual_max_m_s2": Quantity("max. after the move", "m/s²", 2),
        "residual_rms_m_s2": Quantity("RMS after the move", "m/s²", 3),
        "place_error_mm": Quantity("off the place after it", "mm", 2),
        "box_error_mm": Quantity("off the place in the box", "mm", 2),
    }
)

RESIDUAL, REDUCTION = "residual vibration", "RMS after the move reduced by"
"""Overshoot over that of the reference, and how much of the acceleration after the move is gone."""
UNIT_WIDTH = 6

OVERVIEW = ("motion_time_s", "max_pcp_acceleration_m_s2", "overshoot_percent", "residual_rms_m_s2")
"""What is shown over the groups."""

LEAST_P = 1e-4


class Cell(NamedTuple):
    """A median, and what stands beside it in brackets."""

    value: str
    remark: str


class TableRow(NamedTuple):
    """A line of the table of medians: what, its unit, a cell for each condition."""

    label: str
    unit: str
    cells: tuple[Cell, ...]


class DifferenceRow(NamedTuple):
    """A line of the table of differences."""

    label: str
    difference: str
    interval: str
    ratio: str
    ratio_interval: str
    p_holm: str
    rank_p_value: str
    verdict: str


def median_rows(comparison: Comparison, group: str) -> list[TableRow]:
    """Return medians and ± deviations of a group, in the shape of document 1's Tables 8.1, 8.3, 8.4 and 8.6."""
    told = {(s.quantity, s.condition): s for s in comparison.summaries if s.group == group}
    rows = []
    for name, quantity in QUANTITIES.items():
        own = [told.get((name, condition)) for condition in comparison.conditions]
        if any(own):
            cells = tuple(Cell("-", "") if one is None else _median_cell(one, quantity.digits) for one in own)
            rows.append(TableRow(quantity.label, quantity.unit, cells))
    for label, name, first in ((RESIDUAL, "overshoot_percent", "100"), (REDUCTION, "residual_rms_m_s2", "")):
        cells = tuple(
            _ratio_cell(comparison, group, name, c, reduced=label == REDUCTION) for c in comparison.conditions
        )
        if any(cell.value for cell in cells):
            rows.append(TableRow(label, "%", (Cell(first, ""), *cells[1:])))
    return rows


def overview_rows(comparison: Comparison) -> list[TableRow]:
    """Return medians over the groups, all conditions in a cell, in the shape of document 1's Tables 8.3 and 8.4.

    A star stands where a condition surely differs from the reference.
    """
    told = {(s.quantity, s.group, s.condition): s for s in comparison.summaries}
    sure = {(d.quantity, d.group, d.condition) for d in comparison.differences if d.significant}
    rows = []
    for name in OVERVIEW:
        quantity, cells = QUANTITIES[name], []
        for group in comparison.groups:
            keys = [(name, group, condition) for condition in comparison.conditions]
            medians = [_median_cell(told[key], quantity.digits).value if key in told else "-" for key in keys]
            stars = ["*" if key in sure else "" for key in keys]
            cells.append(Cell(" / ".join(f"{m}{star}" for m, star in zip(medians, stars, strict=True)), ""))
        rows.append(TableRow(quantity.label, quantity.unit, tuple(cells)))
    return rows


def counts(comparison: Comparison, group: str) -> list[int]:
    """Return how many measured moves of a group each condition has."""
    return [
        max((s.n for s in comparison.summaries if (s.group, s.condition) == (group, condition)), default=0)
        for condition in comparison.conditions
    ]


def difference_rows(comparison: Comparison, group: str) -> dict[str, list[DifferenceRow]]:
    """Return the differences of a group from the reference in words, by condition."""
    rows: dict[str, list[DifferenceRow]] = {}
    by_ranks = comparison.tests - sum(found.change.test == "welch" for found in comparison.differences)
    for found in comparison.differences:
        if found.group != group:
            continue
        quantity, change = QUANTITIES[found.quantity], found.change
        low, high = change.ci95 or (None, None)
        ratio = "" if change.ratio_percent is None else f"{change.ratio_percent:.3g}"
        ends = "" if change.ratio_ci95 is None else f"({change.ratio_ci95[0]:.3g} to {change.ratio_ci95[1]:.3g})"
        shown = change.difference if change.difference is not None else change.median_difference
        rows.setdefault(found.condition, []).append(
            DifferenceRow(
                label=quantity.label,
                difference=_signed(shown, quantity),
                interval="" if low is None or high is None else _range(low, high, quantity.digits),
                ratio=ratio,
                ratio_interval=ends,
                p_holm=_p_words(found.p_holm),
                rank_p_value=_p_words(change.rank_p_value),
                verdict=_verdict(found, comparison.level, by_ranks),
            )
        )
    return rows


def describe_rate(rate: PickRate) -> str:
    """Return what a condition gains, in words."""
    where = f"{rate.group}: " if rate.group else ""
    beside = f" with {rate.other_time_s:g} s of other time in each" if rate.other_time_s > 0 else " by this move alone"
    if rate.gained is None or rate.per_min is None:
        return f"{where}picks a minute of {rate.condition}: not known, as some moves never settle"
    gained = f"{where}{rate.condition} {'gains' if rate.gained >= 0 else 'loses'}"
    if rate.at_least:
        least = f"at least {rate.gained:+.1f}, by the means and without an error"
        return (
            f"{where}{rate.condition} makes {rate.per_min:.1f} picks a minute{beside}; against {rate.reference}, some "
            f"of which never settle while they are watched, that is {least if rate.gained > 0 else 'a gain not known'}"
        )
    interval = "; one measurement tells no error"
    if rate.ci95 is not None:
        interval = f" (95 %: {rate.ci95[0]:+.1f} to {rate.ci95[1]:+.1f})"
    return (
        f"{gained} {abs(rate.gained):.1f} picks a minute{interval}: {rate.per_min:.1f} instead of "
        f"{rate.reference_per_min:.1f}{beside}"
    )


def describe_exchange(exchange: Exchange, reference: str) -> str:
    """Return what a faster move of another condition can take the place of, in words."""
    slow = exchange.reference_motion_time_s
    before = "never settles" if slow is None else f"{slow:.3f} s"
    harder = "" if exchange.gentler else ", though it accelerates the product more"
    return (
        f"no slower than {reference} at {exchange.reference_group} ({before}, overshoot "
        f"{exchange.reference_overshoot_percent:.2f} %): {exchange.condition} at {exchange.group} "
        f"({exchange.motion_time_s:.3f} s, {exchange.overshoot_percent:.2f} %), by the medians{harder}"
    )


def describe_promise(promise: Promise) -> str:
    """Return what was promised and what was measured, in words."""
    where = f"{promise.condition} ({promise.group})" if promise.group else promise.condition
    if promise.promised is None:
        promised = "" if promise.share is None else f"promised for {100 * promise.share:g} % of the picks; "
        return f"{where}, all limits together: {promised}{_kept_words(promise)}"
    quantity = QUANTITIES[promise.quantity]
    value = f"{promise.promised:.{quantity.digits}f} {quantity.unit}"
    measured = "never" if promise.median is None else f"{promise.median:.{quantity.digits}f} {quantity.unit}"
    if promise.kind == "planned":
        return f"{where}, {quantity.label}: planned {value}, measured {measured}"
    share = "" if promise.share is None else f" for {100 * promise.share:g} % of the picks, each limit by itself"
    words = f"{where}, {quantity.label}: promised at most {value}{share}"
    return f"{words}; measured {measured}, {_kept_words(promise)}"


def _kept_words(promise: Promise) -> str:
    interval = ""
    if promise.kept_ci95 is not None:
        interval = f" (95 %: {100 * promise.kept_ci95[0]:.0f} to {100 * promise.kept_ci95[1]:.0f} % of all)"
    verdict = {"kept": ": kept", "broken": ": BROKEN", "open": ": neither shown nor broken by so few", None: ""}
    return f"kept by {promise.kept} of {promise.n}{interval}{verdict[promise.verdict]}"


def describe_method(comparison: Comparison) -> str:
    """Return how the conditions were compared, in words."""
    return (
        "Differences are of the means, with Welch's 95 % interval and test; where a move never settled, or nothing "
        "scatters, of the medians, with the rank test of Mann and Whitney. Ratios are of the means, the reference 100, "
        f"with Fieller's interval. {comparison.tests} tests were made: p (Holm) is corrected for that, and what is "
        f"called significant is so at {100 * comparison.level:g} % for all of them together. Times count from the "
        "start of the tool's motion; settled is within ±2 % of the travel."
    )


def summary_lines(comparison: Comparison) -> list[str]:
    """Return a comparison for the terminal, a line each."""
    lines: list[str] = []
    if len(comparison.groups) > 1:
        lines += _table_lines(comparison.within or "", comparison.groups, overview_rows(comparison))
        lines += [f"{' / '.join(comparison.conditions)}; * significantly different from {comparison.reference}", ""]
    else:
        (group,) = comparison.groups
        heads = [f"{name} (n {n})" for name, n in zip(comparison.conditions, counts(comparison, group), strict=True)]
        lines += _table_lines(group, heads, median_rows(comparison, group))
        lines += ["", *_difference_lines(comparison, group)]
    lines += [describe_rate(rate) for rate in comparison.rates]
    lines += [describe_exchange(exchange, comparison.reference) for exchange in comparison.exchanges]
    lines += [describe_promise(promise) for promise in comparison.promises]
    if comparison.tests:
        ratio = f"; residual vibration is the overshoot over that of {comparison.reference}"
        words = "medians" if len(comparison.groups) > 1 else f"medians (± deviation){ratio}"
        lines.append(
            f"{words}; {comparison.tests} tests, corrected for their number (Holm), at "
            f"{100 * comparison.level:g} % together"
        )
    return lines


def _table_lines(corner: str, heads: Sequence[str], rows: Sequence[TableRow]) -> list[str]:
    body = [[f"{cell.value} {cell.remark}".strip() for cell in row.cells] for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(heads, *body, strict=True)]
    label = max([len(row.label) for row in rows] + [len(corner) - UNIT_WIDTH])
    firsts = [f"{corner:<{label + UNIT_WIDTH}}", *(f"{row.label:<{label}} {row.unit:<5}" for row in rows)]
    lines = zip(firsts, [heads, *body], strict=True)
    return ["  ".join([first, *_pad(cells, widths)]).rstrip() for first, cells in lines]


def _difference_lines(comparison: Comparison, group: str) -> list[str]:
    lines = []
    for condition, rows in difference_rows(comparison, group).items():
        lines.append(f"{condition} against {comparison.reference}{f' ({group})' if group else ''}:")
        for row in rows:
            interval = f" (95 %: {row.interval})" if row.interval else ""
            p = f", p {row.p_holm}" if row.p_holm else ""
            lines.append(f"  {row.label}: {row.difference}{interval}{p}: {row.verdict}")
    return [*lines, ""] if lines else []


def _median_cell(one: ConditionSummary, digits: int) -> Cell:
    some = f"{one.never} of {one.n} never"
    if one.median is None:
        whole = one.never == one.n
        return Cell("never", "" if whole else f"({some})") if 2 * one.never > one.n else Cell(some, "")
    spread = "" if one.deviation_percent is None or one.n < 2 else f"(±{one.deviation_percent:.2g} %)"
    return Cell(f"{one.median:.{digits}f}", f"({some})" if one.never else spread)


def _ratio_cell(comparison: Comparison, group: str, quantity: str, condition: str, *, reduced: bool) -> Cell:
    for found in comparison.differences:
        if (found.group, found.quantity, found.condition) == (group, quantity, condition):
            ratio, ends = found.change.ratio_percent, found.change.ratio_ci95
            if ratio is None:
                break
            turned = [100 - ratio if reduced else ratio]
            turned += [] if ends is None else sorted(100 - end if reduced else end for end in ends)
            remark = "" if ends is None else f"({turned[1]:.1f} to {turned[2]:.1f})"
            return Cell(f"{turned[0]:.1f}", remark)
    return Cell("", "")


def _signed(value: float | None, quantity: Quantity) -> str:
    return "not known" if value is None else f"{value:+.{quantity.digits}f} {quantity.unit}"


def _range(low: float, high: float, digits: int) -> str:
    return f"{low:+.{digits}f} to {high:+.{digits}f}"


def _p_words(p: float | None) -> str:
    if p is None:
        return ""
    return f"< {LEAST_P:g}" if p < LEAST_P else f"= {p:.2g}"


def _verdict(found: Difference, level: float, by_ranks: int) -> str:
    """Return what a test says: one by ranks that cannot come out below its share of the level says nothing."""
    change = found.change
    if found.significant is None:
        return "not tested"
    if found.significant:
        return "significant"
    least = 2 / comb(change.n + change.n_reference, change.n)
    apart = change.p_value is not None and change.p_value <= least  # no repeats could be farther apart
    if change.test == "mann-whitney" and (apart or not by_ranks * least < level):
        return "too few repeats to tell by ranks"
    return "not significant"


def _pad(cells: Sequence[str], widths: Sequence[int]) -> list[str]:
    return [f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True)]
