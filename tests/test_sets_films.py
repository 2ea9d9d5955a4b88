"""A small set of rendered videos, from the command to the page: what was rendered is what the tables say."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from set_films import SUBSETS, plan_films, render_set
from tagsway.cli.app import run

BROKEN = {"set1/flexible-x/r01.mp4": "empty", "set1/flexible-x/r03.mp4": "cut"}
OUTLIERS = {"set2/flexible-x/r01.mp4": 1.3}


@pytest.mark.slow
def test_a_set_of_films_comes_to_the_numbers_that_were_rendered(tmp_path: Path, capsys) -> None:
    films = plan_films(5, subsets=SUBSETS[:1], broken=BROKEN, outliers=OUTLIERS)
    render_set(tmp_path / "set", films)
    out = tmp_path / "out"
    assert run(["batch", str(tmp_path / "set"), "--out", str(out)]) == 4
    told = capsys.readouterr()
    table = pd.read_csv(out / "measurements.csv", keep_default_na=False, na_values=[""]).set_index("file")
    assert set(table.index[table["status"] == "failed"]) == set(BROKEN)
    page = (out / "report.html").read_text("utf-8")
    for name in BROKEN:
        assert f"failed: {name}" in told.err
        assert name in page
    assert set(table.index[table["rejected_by"].notna()]) == set(OUTLIERS)
    truth = pd.Series({film.name: film.frequency_hz for film in films})
    measured = table["natural_frequency_hz"].dropna()
    errors = (measured - truth[measured.index]) / table["natural_frequency_std_hz"].dropna()
    assert np.all(np.abs(errors) < 4)  # statistics: 4 of each one's own standard errors
    summary = pd.read_csv(out / "summary.csv").set_index("subset")
    for name, failed, rejected in (("set1/flexible-x", 2, 0), ("set2/flexible-x", 0, 1)):
        own = truth[[file for file in measured.index if file.startswith(name) and file not in OUTLIERS]]
        row = summary.loc[name]
        assert row["natural_frequency_median_hz"] == pytest.approx(own.median(), abs=2e-3)  # statistics: as above
        assert row["natural_frequency_s_hz"] == pytest.approx(own.std(), abs=2e-3)
        assert (row["n"], row["failed"], row["rejected"], row["used"]) == (5, failed, rejected, len(own))
