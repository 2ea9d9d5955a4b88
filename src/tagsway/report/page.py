"""One self-contained page that says what was found, how sure it is, and shows why."""

import base64
import functools
import hashlib
from importlib import resources
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from tagsway.model import Curves, Result
from tagsway.report.charts import make_charts, share_abscissae
from tagsway.report.style import DARK_PALETTE, LIGHT_PALETTE
from tagsway.report.tables import (
    answers,
    estimator_rows,
    indicator_rows,
    measurement_rows,
    mode_rows,
    pendulum_rows,
    shaper_rows,
)
from tagsway.report.traces import Chart
from tagsway.report.words import (
    describe_agreement,
    describe_excitation,
    describe_modes,
    describe_pendulum,
    describe_spread,
    next_steps,
    split_events,
)

PLOTLY = "plotly-basic.min.js"
SHARED_SCRIPT = f"pages/{PLOTLY}"
"""In the folder of a set."""

BANNERS = {
    "ok": "",
    "degraded": "Usable with care: the data are sound, but something limits what they tell. Read the notes below.",
    "not_determined": "Not determined: this record does not tell the natural frequency. The notes below say why.",
}


def render_page(result: Result, curves: Curves, *, title: str, set_url: str | None = None) -> str:
    """Return the report as one HTML page.

    Parameters
    ----------
    result : Result
        What is said.
    curves : Curves
        What is drawn, interactively.
    title : str
        The page's heading: the name of what was filmed.
    set_url : str, optional
        The folder of the set that the page belongs to, as seen from it: the page then leads to that of the set, and
        shares the script that draws the charts with the others.

    Returns
    -------
    str
        Self-contained: script, style and data are inside, and its content policy forbids the browser to load anything;
        in a set, anything but the shared script.
        The same input gives the same page. All text is escaped, also file names.
    """
    event_sentences, warnings = split_events(result)
    return render_template(
        "page.html",
        make_charts(result, curves),
        title=title,
        generator=f"{result.created_by.name} {result.created_by.version}",
        script_url=None if set_url is None else f"{set_url}/{SHARED_SCRIPT}",
        set_url=set_url,
        result=result,
        banner=BANNERS[result.status],
        answers=answers(result),
        event_sentences=event_sentences,
        warnings=warnings,
        mode_sentences=describe_modes(result),
        agreement=describe_agreement(result),
        excitation_words=describe_excitation(result),
        known=any(answer.number is not None for answer in answers(result)),
        shaper_rows=shaper_rows(result.shaper) if result.shaper is not None else [],
        spread_words=describe_spread(result.shaper) if result.shaper is not None else "",
        pendulum_rows=pendulum_rows(result.pendulum) if result.pendulum is not None else [],
        pendulum_words=describe_pendulum(result.pendulum),
        estimator_rows=estimator_rows(result),
        mode_rows=mode_rows(result),
        indicator_rows=indicator_rows(result.indicators) if result.indicators is not None else [],
        measurement_rows=measurement_rows(result),
        steps=next_steps(result),
    )


def render_template(
    name: str, charts: dict[str, Chart], *, title: str, generator: str, script_url: str | None = None, **words: Any
) -> str:
    """Return a page with its data, script and style inside.

    Parameters
    ----------
    name : str
        Of the template beside this module: it fills the frame that all pages share.
    charts : dict of Chart
        By name.
    title : str
        The page's heading.
    generator : str
        What made it, with its version.
    script_url : str, optional
        Where the script that draws the charts lies, as seen from the page; it is inside by default.
    words : Any
        What the template says.
    """
    slim, abscissae = share_abscissae(charts)
    scripts = [load_asset(each) for each in ((PLOTLY, "page.js") if script_url is None else ("page.js",))]
    html = _load_template(name).render(
        **words,
        title=title,
        generator=generator,
        charts=slim,
        page_data={"charts": slim, "abscissae": abscissae, "light": LIGHT_PALETTE, "dark": DARK_PALETTE},
        style=load_asset("page.css"),
        scripts=scripts,
        script_hashes=[_script_hash(script) for script in scripts],
        script_url=script_url,
    )
    # a file name may hold bytes that are no text
    return html.encode("utf-8", "replace").decode("utf-8")


@functools.cache
def load_asset(name: str) -> str:
    """Return a file of this package as text."""
    return resources.files(__package__).joinpath(name).read_text("utf-8")


@functools.cache
def _load_template(name: str) -> Template:
    """Return a template of this package; it escapes what is put in."""
    return Environment(
        loader=FunctionLoader(load_asset),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    ).get_template(name)


def _script_hash(script: str) -> str:
    """Return the name by which the page's content policy allows exactly this script."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
