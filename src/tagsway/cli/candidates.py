"""`identify shaper --type all`: every candidate with its price."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tagsway.shapers import ShaperPrice

HEADINGS = {
    "type": "type",
    "impulses": "impulses",
    "adds_ms": "adds (ms)",
    "late_ms": "late by (ms)",
    "at_mode_percent": "V (%)",
    "off_15_percent": "15 % off",
    "p95_percent": "95 % of repeats",
    "band_5_percent": "band V ≤ 5 % (%)",
    "pulls_back": "pulls back",
}
"""What each column is called for programs and for people."""


def candidate_table(prices: Sequence["ShaperPrice"]) -> str:
    """Return the candidates as a table for people."""
    rows = [list(HEADINGS.values()), *([cell or "-" for cell in _cells(price)] for price in prices)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    lines = []
    for name, *cells in rows:
        right = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        lines.append("  ".join([name.ljust(widths[0]), *right]))
    return "\n".join(lines) + "\n"


def candidate_csv(prices: Sequence["ShaperPrice"]) -> str:
    """Return the candidates as a table for programs; what is not known is empty."""
    return "\n".join(",".join(row) for row in [list(HEADINGS), *map(_cells, prices)]) + "\n"


def _cells(price: "ShaperPrice") -> list[str]:
    return [
        price.shaper.type,
        str(len(price.shaper.impulses)),
        f"{1e3 * price.duration_s:.1f}",
        f"{1e3 * price.centroid_delay_s:.1f}",
        _percent(price.residual_at_mode),
        _percent(price.residual_off),
        _percent(price.residual_p95),
        _percent(price.insensitivity),
        "yes" if price.negative else "no",
    ]


def _percent(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.2f}"
