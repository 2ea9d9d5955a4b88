import base64
import functools
import hashlib
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import example_result
from tagsway.model import Estimate, TwoMasses
from tagsway.report.charts import make_charts, share_abscissae
from tagsway.report.page import render_page
from tagsway.report.style import thin
from tagsway.report.tables import answers, indicator_rows
from tagsway.report.traces import MAX_POINTS, rounded

VARIANTS = ["example", "in_pixels", "not_determined", "without_tool", "hostile", "peeled_off"]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PLOTLY_SHA256 = "c23b03591a6bdad0bd0f47a0c5c52305a5519812b73ce254be65cd841553c9c2"  # of plotly.js-basic-dist-min 3.7.0
PROBE = """<script>addEventListener("load", () => setTimeout(() => {
  const seen = performance.getEntriesByType("resource").map((entry) => entry.name);
  document.body.setAttribute("data-resources", seen.join(" "));
}, 300));</script></body>"""


class Outline(HTMLParser):
    """Collects what a page is made of, as a browser would see it."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.data: Any = None
        self._in: tuple[str, dict[str, str | None]] | None = None
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._in = self.tags[-1]

    def handle_endtag(self, tag: str) -> None:
        self._in = None

    def handle_data(self, data: str) -> None:
        if self._in is not None and self._in[0] == "script":
            if self._in[1].get("id") == "charts":
                self.data = json.loads(data)
        elif self._in is None or self._in[0] != "style":
            self.text += data


@functools.cache
def _page(variant: str) -> str:
    result, curves = getattr(example_result, variant)()
    return render_page(result, curves, title=result.source.file)


@functools.cache
def _outline(variant: str) -> Outline:
    return Outline(_page(variant))


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_page_refers_to_nothing_outside_itself(variant: str) -> None:
    for tag, attributes in _outline(variant).tags:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base"}
        assert not {"src", "href", "action", "data", "srcset"} & set(attributes), (tag, attributes)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_chart_has_its_place_and_a_place_its_chart(variant: str) -> None:
    outline = _outline(variant)
    places = [(a.get("id") or "").removeprefix("chart-") for _, a in outline.tags if "chart" in (a.get("class") or "")]
    assert sorted(places) == sorted(outline.data["charts"])


def test_markup_in_a_file_name_stays_text() -> None:
    outline = _outline("hostile")
    assert example_result.HOSTILE_NAME in outline.text
    assert "{{ 7 * 7 }}" in outline.text
    assert [a.get("id") for tag, a in outline.tags if tag == "script"] == ["charts", None, None]
    assert not any(name.startswith("on") for _, attributes in outline.tags for name in attributes)


def test_only_the_page_s_own_scripts_may_run() -> None:
    html = _page("example")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy is not None
    assert "default-src 'none'" in policy[1]
    allowed = re.search(r"script-src ([^;]*);", policy[1])
    assert allowed is not None
    assert all(word.startswith("'sha256-") for word in allowed[1].split())


def test_a_file_name_that_is_no_text_can_still_be_written() -> None:
    result, curves = example_result.not_determined()
    render_page(result, curves, title="bag\udcff.mp4").encode("utf-8")


def test_the_same_result_gives_the_same_page() -> None:
    result, curves = example_result.not_determined()
    assert render_page(result, curves, title=result.source.file) == _page("not_determined")


def test_the_page_gives_the_answer_with_its_error_and_the_shaper() -> None:
    text = _outline("example").text.replace("\u00a0", " ")
    for words in (
        "2.47270 ± 0.00031 Hz",
        "0.004020 ± 0.000094",
        "45.85 ± 0.21 mm",
        "202.4640.496860",
        "film repeats",
        "(2.264 ± 0.060)×10⁻⁴ N·m/deg",
        "Cramér-Rao bound",
        "2400 frames of 1280 × 720",
        "1.710 to 11.900 s",
    ):
        assert words in text


def test_the_error_in_the_box_is_among_the_indicators_where_there_was_one() -> None:
    indicators = example_result.example()[0].indicators
    assert indicators is not None
    assert ("error in the box", "16.4 mm") in [(row.label, row.value) for row in indicator_rows(indicators)]
    level = replace(indicators, box_error_m=None)
    assert "error in the box" not in [row.label for row in indicator_rows(level)]


@pytest.mark.parametrize(("variant", "words"), [("degraded", "Usable with care"), ("not_determined", "does not tell")])
def test_a_result_that_is_not_whole_says_so_at_the_top(variant: str, words: str) -> None:
    text = _outline({"degraded": "in_pixels"}.get(variant, variant)).text
    assert words in text
    assert words not in _outline("example").text


def test_a_result_without_a_scale_shows_no_millimetres() -> None:
    outline = _outline("in_pixels")
    assert "sway (px)" in json.dumps(outline.data, ensure_ascii=False)
    assert "sway (mm)" not in json.dumps(outline.data, ensure_ascii=False)


def test_a_length_that_is_not_determined_is_not_shown_as_if_it_were() -> None:
    result, _ = example_result.example()
    assert result.pendulum is not None
    doubtful = replace(result.pendulum, determined=False, reason="indicative only: no move")
    length = answers(replace(result, pendulum=doubtful))[2]
    assert length.number is not None
    assert length.detail == "not determined: indicative only: no move"
    assert answers(result)[2].detail == "k = 0.01297 ± 0.00034 N·m/rad; b = (5.90 ± 0.14)×10⁻⁵ N·m·s/rad"


def test_what_happened_to_the_grip_stands_at_the_top_and_only_there() -> None:
    text = _outline("peeled_off").text
    assert text.count("he product peeled off at 9.000") == 1
    assert text.index("The product peeled off") < text.index("Natural frequency")


def test_further_modes_disagreement_and_the_design_are_said() -> None:
    text = _outline("peeled_off").text
    assert "A further mode: 5.431 ± 0.012 Hz, ζ = 0.0110 ± 0.0020, 0.41 mm." in text
    assert "Here Fourier transform disagrees" in text
    assert "designed for 2.4696 Hz and ζ = 0.004" in text
    assert "the move's spectrum has 23 % of its peak at 0.84 Hz" in text
    assert "Here they agree" in _outline("example").text


def test_many_warnings_are_all_there() -> None:
    text = _outline("hostile").text
    assert all(f"odd_{i}" in text for i in range(14))


def test_thinning_keeps_the_extremes_and_the_gaps() -> None:
    time = np.linspace(0, 1, 100_000)
    sway = np.sin(40 * time)
    sway[54_321], sway[70_000:80_000] = 9.0, np.nan
    short_time, short = thin(time, sway, most=MAX_POINTS)
    assert len(short) <= MAX_POINTS
    assert np.nanmax(short) == 9.0  # identity
    assert np.nanmin(short) == np.nanmin(sway)  # identity
    assert np.all(np.isnan(short[(short_time > 0.701) & (short_time < 0.799)]))
    assert np.any(np.isnan(short))
    assert np.all(np.diff(short_time) > 0)


def test_a_thinned_cloud_is_not_hollow() -> None:
    noise = np.random.default_rng(0).normal(size=300_000)
    _, kept = thin(np.arange(300_000.0), noise, most=MAX_POINTS)
    inner = np.mean(np.abs(kept) < 1)
    assert 0.18 < inner < 0.28  # statistics: 0.68 of a third, and no extreme of 300 lies there; ± 5 deviations


def test_a_short_line_is_not_thinned() -> None:
    time = np.arange(MAX_POINTS, dtype=float)
    assert thin(time, time, most=MAX_POINTS)[0] is time


def test_numbers_are_rounded_for_the_screen_and_gaps_are_null() -> None:
    assert rounded(np.array([0.123456789, np.nan, np.inf, 10.0])) == [0.1235, None, None, 10.0]
    assert rounded(np.array([np.nan])) == [None]
    assert rounded(np.array([])) == []
    assert rounded(np.array([123456789.0, 123459999.0])) == [123456789.0, 123459999.0]


def test_charts_hold_no_nan() -> None:
    result, curves = example_result.example()
    charts, abscissae = share_abscissae(make_charts(result, curves))
    json.dumps([charts, abscissae], allow_nan=False)


def test_a_long_record_does_not_make_a_large_page() -> None:
    result, curves = example_result.not_determined()
    n = 200_000
    rng = np.random.default_rng(1)
    xz = rng.normal(size=(n, 2))
    track = replace(
        curves.track, time_s=np.arange(n) / 1000, pcp=xz, pcp_clean=xz, pcp_acceleration=xz,
        tcp=xz, tcp_clean=xz, tcp_acceleration=xz,
    )  # fmt: skip
    short = len(render_page(result, curves, title="short"))
    assert len(render_page(result, replace(curves, track=track), title="long")) < short + 600_000


def test_the_chart_library_is_the_published_one_with_its_licence() -> None:
    files = resources.files("tagsway.report")
    script = files.joinpath("plotly-basic.min.js").read_bytes()
    assert hashlib.sha256(script).hexdigest() == PLOTLY_SHA256
    assert files.joinpath("plotly-basic.LICENSE.txt").read_text("utf-8").startswith("MIT License")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium to open the page in")
@pytest.mark.parametrize("variant", ["not_determined", "hostile"])
def test_a_browser_draws_every_chart_and_loads_nothing(variant: str, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    html = _page(variant)
    # the page forbids every script that it does not bring along: the probe is allowed here by its own hash only
    page.write_text(_with_probe(html), "utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync", "--enable-logging=stderr",
        f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    outline = Outline(done.stdout)
    root = next(attributes for tag, attributes in outline.tags if tag == "html")
    assert root["data-charts"] == "drawn"
    body = next(attributes for tag, attributes in outline.tags if tag == "body")
    assert body["data-resources"] == ""
    charts = outline.data["charts"]
    drawn = sum("main-svg" in (attributes.get("class") or "").split() for _, attributes in outline.tags)
    assert drawn >= len(charts)
    assert "CONSOLE" not in done.stderr
    assert "plotly.com" not in " ".join(a.get("data-title") or "" for _, a in outline.tags)


def _with_probe(html: str) -> str:
    script = PROBE.removeprefix("<script>").removesuffix("</script></body>")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return html.replace("script-src ", f"script-src 'sha256-{digest}' ").replace("</body>", PROBE)


def test_the_pendulum_shows_its_priors_its_rival_and_its_ridge() -> None:
    result, curves = example_result.example()
    html = render_page(result, curves, title="x")
    text = Outline(html).text
    for words in ("by positions alone", "scale of both tags ± 0.3 %", "stated l = 45.85 ± 0.5 mm", "a narrow valley"):
        assert words.lower() in text.lower()
    ridge = make_charts(result, curves)["ridge"]
    assert min(ridge["data"][1]["y"]) < 0.2 < 3.84 < max(ridge["data"][1]["y"])
    assert result.pendulum is not None
    assert "by two masses" not in text
    both = TwoMasses(
        file="other.json",
        mass_kg=0.4,
        length_m=Estimate.normal(0.0459, 2e-4),
        stiffness_n_m_per_rad=Estimate.normal(0.013, 1e-3),
        stiffness_shift_percent=12.0,
    )
    heavier = replace(result, pendulum=replace(result.pendulum, two_masses=both))
    assert "by two masses" in Outline(render_page(heavier, curves, title="x")).text
