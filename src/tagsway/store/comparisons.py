"""comparison.json, and the tables beside it."""

from pathlib import Path
from typing import Any

import pandas as pd

from tagsway.model import Comparison
from tagsway.store.documents import from_document, read_json, to_document

COMPARISON_SCHEMA = "tagsway/comparison/1"


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """Return what comparison.json holds."""
    return {"schema": COMPARISON_SCHEMA, **to_document(comparison)}


def read_comparison(path: Path) -> Comparison:
    """Read comparison.json."""
    return from_document(Comparison, read_json(path, COMPARISON_SCHEMA), origin=str(path))


def differences_table(comparison: Comparison) -> pd.DataFrame:
    """Return differences.csv: a row a quantity of a condition against the reference."""
    rows = []
    for found in comparison.differences:
        row = to_document(found)
        change = row.pop("change")
        p_holm, significant = row.pop("p_holm"), row.pop("significant")
        for name in ("ci95", "ratio_ci95"):
            low, high = change.pop(name) or (None, None)
            change |= {f"{name}_low": low, f"{name}_high": high}
        rows.append({**row, **change, "p_holm": p_holm, "significant": significant})
    return pd.DataFrame.from_records(rows)


def conditions_table(comparison: Comparison) -> pd.DataFrame:
    """Return conditions.csv: a row a quantity of a condition."""
    return pd.DataFrame.from_records([to_document(summary) for summary in comparison.summaries])
