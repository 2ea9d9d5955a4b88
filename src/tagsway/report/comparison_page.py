"""The page of a comparison."""

from collections.abc import Sequence
from typing import Any

from tagsway.model import Comparison, ConditionCurves
from tagsway.report.comparison import chart_moves
from tagsway.report.comparison_words import (
    counts,
    describe_exchange,
    describe_method,
    describe_promise,
    describe_rate,
    difference_rows,
    median_rows,
    overview_rows,
)
from tagsway.report.page import render_template

MOST_CHARTS = 12
"""Groups whose moves are drawn on the page; the others are in the figures."""


def render_comparison(comparison: Comparison, curves: Sequence[ConditionCurves], *, title: str) -> str:
    """Return a comparison as one self-contained HTML page.

    Parameters
    ----------
    comparison : Comparison
        What is said.
    curves : sequence of ConditionCurves
        What is drawn.
    title : str
        The page's heading.

    Returns
    -------
    str
        The same input gives the same page; all text is escaped.
    """
    charts, parts = {}, []
    for number, group in enumerate(comparison.groups):
        own = [curve for curve in curves if curve.group == group and curve.moves]
        name = f"moves-{number}"
        if own and number < MOST_CHARTS:
            charts[name] = chart_moves(own)
        parts.append(_part(comparison, group, name))
    return render_template(
        "comparison.html",
        charts,
        title=title,
        generator=f"{comparison.created_by.name} {comparison.created_by.version}",
        comparison=comparison,
        parts=parts,
        overview=overview_rows(comparison) if len(comparison.groups) > 1 else [],
        sentences=[
            *(describe_rate(rate) for rate in comparison.rates),
            *(describe_exchange(exchange, comparison.reference) for exchange in comparison.exchanges),
            *(describe_promise(promise) for promise in comparison.promises),
        ],
        method=describe_method(comparison),
    )


def _part(comparison: Comparison, group: str, chart: str) -> dict[str, Any]:
    return {
        "group": group,
        "counts": counts(comparison, group),
        "medians": median_rows(comparison, group),
        "differences": difference_rows(comparison, group),
        "chart": chart,
    }
