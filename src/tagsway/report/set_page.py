"""One page for a whole set: what its measurements say together, what failed, and where each one's own page is."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tagsway.model import Notice, Shaper
from tagsway.report.page import render_template
from tagsway.report.set_charts import chart_effects, chart_measurements
from tagsway.report.set_words import (
    Record,
    describe_effects,
    describe_set_shaper,
    number,
    share_rows,
    spread_rows,
    summary_tables,
)
from tagsway.report.tables import shaper_rows


@dataclass(frozen=True, slots=True, kw_only=True)
class SubsetPictures:
    """The figures of a subset, or of the whole set.

    Parameters
    ----------
    name : str
        Of the subset.
    pictures : tuple of (str, bytes)
        What each shows, and the PNG.
    """

    name: str
    pictures: tuple[tuple[str, bytes], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SetReport:
    """What the page of a set says.

    Parameters
    ----------
    title : str
        The set's name.
    version : str
        Of the program.
    whole : str
        The name under which the summary has all subsets.
    summary, shares, effects : sequence of mapping
        The rows of summary.csv, shares.csv and effects.csv.
    spans : mapping of str to (float, float)
        Over which each continuous factor was varied.
    measurements : sequence of mapping
        The rows of measurements.csv that are drawn and listed, each with `page`, the address of its own page or "".
    failed : sequence of mapping
        Rows without a number that are listed.
    shaper : Shaper or None
        For the whole set.
    no_shaper : str
        Why there is none.
    notices : tuple of Notice
        What to know.
    factors : SubsetPictures or None
        The frequency against the factors.
    subsets : sequence of SubsetPictures
        The figures.
    """

    title: str
    version: str
    whole: str
    summary: Sequence[Record]
    shares: Sequence[Record]
    effects: Sequence[Record]
    spans: Mapping[str, tuple[float, float]]
    measurements: Sequence[Record]
    failed: Sequence[Record]
    shaper: Shaper | None
    no_shaper: str
    notices: tuple[Notice, ...]
    factors: SubsetPictures | None
    subsets: Sequence[SubsetPictures]


def render_set_page(report: SetReport, *, script_url: str) -> str:
    """Return the page of a set as HTML.

    Parameters
    ----------
    report : SetReport
        What it says.
    script_url : str
        Where the script that draws its charts lies, as seen from the page: the pages of a set share one.

    Returns
    -------
    str
        Figures, style and data are inside; it loads nothing but that script. The same input gives the same page.
    """
    return render_template(
        "set.html",
        _charts(report),
        title=report.title,
        generator=f"tagsway {report.version}",
        script_url=script_url,
        report=report,
        total=report.summary[-1],
        number=number,
        tables=summary_tables(report.summary, whole=report.whole),
        spreads=spread_rows(report.summary, whole=report.whole),
        shares=share_rows(report.shares, whole=report.whole),
        effect_sentences=describe_effects(report.effects, report.spans),
        shaper_words=describe_set_shaper(report.shaper, report.no_shaper),
        shaper_rows=[] if report.shaper is None else shaper_rows(report.shaper),
        picture=_data_url,
    )


def _charts(report: SetReport) -> dict[str, Any]:
    charts = {"measurements": chart_measurements(report.measurements)}
    effects = chart_effects(report.effects, report.spans)
    return charts if effects is None else {**charts, "effects": effects}


def _data_url(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
