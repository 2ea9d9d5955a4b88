"""What a set's factors do, as its files say it: effects.csv, shares.csv, the figure, the page."""

import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from shutil import which

import numpy as np
import pandas as pd
import pytest

from set_files import inline, write_decay
from tagsway.repeats import factor_share, pool_shares
from tagsway.report.set_words import effect_over_span
from tagsway.sets.batch import Batch, measure_set
from tagsway.sets.effects import find_effects
from tagsway.sets.ledger import open_ledger
from tagsway.sets.tables import make_tables, share_picks

CHROMIUM = which("chromium") or which("chromium-browser") or which("google-chrome")


def rows_of(frequency, **factors) -> list[dict[str, object]]:
    return [
        {"file": f"{number:03d}", "subset": "s", "status": "ok", "natural_frequency_hz": float(value),
         "natural_frequency_std_hz": 1e-3, "damping_ratio": 0.01 * value / 2,
         **{name: values[number] for name, values in factors.items()}}
        for number, value in enumerate(frequency)
    ]  # fmt: skip


def run(path: Path, out: Path) -> Batch:
    with open_ledger(out) as ledger:
        return measure_set(path, ledger, inline, begin=lambda *_: None, report=lambda _: None)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """Results of a set with factors, a failed file, a copy, and names that a page must escape."""
    root = tmp_path_factory.mktemp("set")
    rng = np.random.default_rng(0)
    lines = ["file,subset,set,gripper,vacuum_mbar,pick_position,repeat"]
    for number in range(16):
        gripper, vacuum, whole = "AB"[number % 2], 500 + 100 * (number // 2 % 2), 1 + number // 8
        value = 2.0 + 0.3 * (gripper == "B") + 1e-3 * (vacuum - 500) + 0.01 * rng.normal()
        name = f"r {number} <b>&ü.csv"
        write_decay(root / name, frequency_hz=value, seed=number)
        lines.append(f"{name},{gripper} <i>,{whole},{gripper},{vacuum},{['held', 'varied'][whole - 1]},{number}")
    (root / "copy.csv").write_bytes((root / "r 0 <b>&ü.csv").read_bytes())
    (root / "bad.csv").write_text("<script>alert(1)</script>")
    lines += ["copy.csv,A <i>,1,A,500,held,16", "bad.csv,A <i>,1,A,500,held,17"]
    (root / "set.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    run(root, root.parent / "out-of-set")
    return root.parent / "out-of-set"


def test_days_that_are_written_as_numbers_are_different_days() -> None:
    days = [20260129, 20260130, 20260131] * 4
    values = [2.0 + 0.1 * (day == 20260131) + 0.001 * number for number, day in enumerate(days)]
    table = find_effects(make_tables(rows_of(values, date=days)).kept()).table
    own = table[table["quantity"] == "natural_frequency_hz"]
    assert list(own["level"]) == ["20260130", "20260131"]


def test_a_slope_of_the_damping_s_logarithm_compounds_over_the_span() -> None:
    vacuum = np.repeat([400.0, 600.0, 800.0], 6)
    rng = np.random.default_rng(3)
    damping = 0.01 * np.exp(2e-3 * (vacuum - 400) + 0.01 * rng.normal(size=18))
    rows = [
        {**row, "damping_ratio": zeta}
        for row, zeta in zip(rows_of(2 + 0.01 * rng.normal(size=18), vacuum_mbar=vacuum), damping, strict=True)
    ]
    table = find_effects(make_tables(rows).kept()).table
    (row,) = table[table["quantity"] == "damping_ratio"].to_dict("records")
    effect, name = effect_over_span(row, {"vacuum_mbar": (400.0, 800.0)})
    assert name == "vacuum_mbar: 800 against 400"
    # statistics: four of its own standard errors of e^0.8 - 1
    assert effect.value == pytest.approx(100 * np.expm1(0.8), abs=4 * effect.std)
    assert effect.ci95[0] < effect.value < effect.ci95[1]
    assert effect.std == pytest.approx((effect.ci95[1] - effect.ci95[0]) / 4, rel=0.2)


def test_the_effects_of_a_set_are_those_that_were_put_in(finished) -> None:
    table = pd.read_csv(finished / "effects.csv")
    own = table[table["quantity"] == "natural_frequency_hz"].set_index("factor")
    assert list(own.index) == ["gripper", "pick_position", "vacuum_mbar"]
    assert (own.loc["gripper", "level"], own.loc["gripper", "against"], own.loc["gripper", "unit"]) == ("B", "A", "Hz")
    assert own.loc["vacuum_mbar", "unit"] == "Hz per unit of vacuum_mbar"
    for name, truth in (("gripper", 0.3), ("vacuum_mbar", 1e-3), ("pick_position", 0.0)):
        low, high = own.loc[name, ["low", "high"]]
        assert low - (high - low) / 2 < truth < high + (high - low) / 2  # statistics: twice the 95 % interval
    assert (finished / "figures" / "factors.png").stat().st_size > 10_000


def test_a_quantity_that_spans_decades_has_its_effects_in_percent() -> None:
    gripper = ["a", "b"] * 20
    kept = make_tables(rows_of([2.0, 3.0] * 20, gripper=gripper)).kept()
    effect = find_effects(kept).table.set_index("quantity").loc["damping_ratio"]
    assert (effect["effect"], effect["unit"]) == (pytest.approx(50.0), "%")  # identity: 3 is 50 % more than 2


def test_factors_varied_together_are_named_and_not_answered() -> None:
    values = np.random.default_rng(1).normal(2, 0.1, 24)
    both = {"gripper": ["a", "b"] * 12, "vacuum_mbar": [500, 600] * 12, "direction": ["x", "x", "z", "z"] * 6}
    effects = find_effects(make_tables(rows_of(values, **both)).kept())
    (told,) = [notice.message for notice in effects.notices if notice.code == "factors_confounded"]
    assert "gripper and vacuum_mbar" in told
    answered = effects.table[effects.table["effect"].notna()]
    assert set(answered["factor"]) == {"direction"}
    assert effects.table.set_index("factor").loc["gripper", "remark"].iloc[0].startswith("confounded with vacuum_mbar")


def test_without_factors_there_is_no_table_of_effects_and_counters_are_none() -> None:
    assert not len(find_effects(make_tables(rows_of([2.0, 2.1, 2.2])).kept()).table)
    counted = make_tables(rows_of([2.0, 2.1, 2.2, 2.3], set=[1, 1, 2, 2], repeat=[1, 2, 1, 2])).kept()
    assert not len(find_effects(counted).table)
    few = find_effects(make_tables(rows_of([2.0, 2.1, 2.2], gripper=["a", "b", "a"])).kept())
    assert [notice.code for notice in few.notices] == ["no_effects"]


def test_samples_with_numbers_are_names_also_where_a_gap_made_them_floats() -> None:
    values = np.random.default_rng(2).normal(2, 0.1, 13)
    rows = rows_of(values, sample=[1, 2, 3] * 4 + [None])
    rows[-1]["natural_frequency_hz"] = None
    table = find_effects(make_tables(rows).kept()).table
    assert set(table[table["quantity"] == "natural_frequency_hz"]["level"]) == {"2", "3"}


def test_several_shares_have_one_of_all_that_lies_between() -> None:
    rng = np.random.default_rng(3)
    shares = [factor_share(2 * rng.normal(size=25), rng.normal(size=25)) for _ in range(6)]
    pooled = pool_shares(shares)
    assert min(s.value for s in shares) < pooled.value < max(s.value for s in shares)
    assert pooled.std < min(s.std for s in shares)
    assert pooled.ci95[0] < 0.75 < pooled.ci95[1]  # statistics: seeded; the truth is 1 - 1/4
    alike = pool_shares(shares[:1] * 6)
    assert alike.value == pytest.approx(shares[0].value)  # identity
    assert alike.std == pytest.approx(shares[0].std / np.sqrt(6)), "agreement by chance makes nothing surer"


def test_a_factor_that_varies_within_subsets_does_not_split_the_shares() -> None:
    values = np.random.default_rng(4).normal(2, 0.1, 20)
    rows = rows_of(values, pick_position=["held"] * 10 + ["varied"] * 10, humidity=list(range(20)))
    for row in rows:
        row["subset"] = row["pick_position"]
    (share,) = share_picks(make_tables(rows).kept()).query("quantity == 'natural_frequency_hz'").to_dict("records")
    assert (share["n_varied"], share["n_held"]) == (10, 10)


def test_a_subset_of_two_sets_is_told_apart_and_each_set_has_its_row(finished) -> None:
    summary = pd.read_csv(finished / "summary.csv", dtype={"set": str}, keep_default_na=False)
    assert list(summary["subset"]) == ["1/A <i>", "1/B <i>", "2/A <i>", "2/B <i>", "(all)", "(all)", "(all)"]
    assert list(summary["set"]) == ["1", "1", "2", "2", "1", "2", ""]
    assert list(summary["n"]) == [6, 4, 4, 4, 10, 8, 18]


def test_a_copy_is_no_repeat(finished) -> None:
    table = pd.read_csv(finished / "measurements.csv", keep_default_na=False).set_index("file")
    assert table.loc["r 0 <b>&ü.csv", "rejected_by"] == "copy of copy.csv"
    assert table.loc["copy.csv", "rejected_by"] == ""


class Page(HTMLParser):
    """The tags of a page with their attributes, and its text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_of_a_set_says_all_and_its_links_lead_somewhere(finished) -> None:
    html = (finished / "report.html").read_text("utf-8")
    page = Page(html)
    for words in ("bad.csv", "Set 1", "Set 2", "1/A <i>", "share of the pick position", "gripper: B against A",
                  "r 0 <b>&ü.csv", "copy of copy.csv", "a copy is no repeat"):  # fmt: skip
        assert words in page.text
    assert not {tag for tag, _ in page.tags} & {"b>", "i"}, "names are escaped"
    assert "<script>alert" not in html
    links = [attributes["href"] for tag, attributes in page.tags if tag == "a"]
    assert len([link for link in links if link.startswith("pages/")]) == 17, "all but the failed one"
    for link in [*links, *(a["src"] for tag, a in page.tags if tag == "script" and "src" in a)]:
        assert (finished / link).is_file()
    assert not re.search(r"(src|href)=\"?(https?:)?//", html)
    own = (finished / links[0]).read_text("utf-8")
    assert 'src="../../pages/plotly-basic.min.js"' in own
    assert 'href="../../report.html"' in own
    assert len(own) < 600_000, "the script is shared"


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium to open the pages in")
@pytest.mark.parametrize("which_page", ["report.html", "own"])
def test_a_browser_draws_the_charts_with_the_shared_script(which_page, finished, tmp_path) -> None:
    page = finished / which_page if which_page != "own" else next((finished / "pages").glob("*/*.html"))
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--enable-logging=stderr",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert 'data-charts="drawn"' in done.stdout
    assert "CONSOLE" not in done.stderr
