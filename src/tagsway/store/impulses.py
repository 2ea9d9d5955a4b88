"""Records of hammer blows: read, and what they told written."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.model import FloatArray, ImpulseResult
from tagsway.store.documents import to_document
from tagsway.store.sources.columns import describe_columns
from tagsway.store.sources.grid import find_grids
from tagsway.store.sources.text import read_text

IMPULSE_SCHEMA = "tagsway/impulse/1"
EXPECTED = "a CSV with time_s and one column of accelerations a joint and blow"


def read_impulses(path: Path) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Read the answers of the joints.

    Parameters
    ----------
    path : Path
        A table with a time column; every other column of numbers is a channel.

    Returns
    -------
    time_s : ndarray, shape (n,)
    channels : dict of ndarray, shape (n,)
        By name; NaN where a cell is empty.

    Raises
    ------
    InputError
        Where there is no time, no other column, or the time does not rise.
    """
    grids = find_grids(read_text(path, expected=EXPECTED))
    if not grids:
        raise InputError(f"{path} holds no columns of numbers; give {EXPECTED}")
    grid = max(grids, key=lambda each: len(each.values))
    held = describe_columns(grid)
    place = next((i for i, column in enumerate(held) if column.quantity == "time"), None)
    names = ", ".join(column.name for column in held)
    if place is None:
        raise InputError(f"{path} has no time column; it has {names}; give {EXPECTED}")
    time = grid.values[:, place] * held[place].factor
    kept = np.isfinite(time)
    if not np.all(np.diff(time[kept]) > 0):
        raise InputError(f"{path}: the time does not rise; sort its lines")
    channels = {
        column.name: grid.values[kept, i]
        for i, column in enumerate(held)
        if column.quantity not in ("time", "index") and np.isfinite(grid.values[kept, i]).any()
    }
    if not channels:
        raise InputError(f"{path} has a time and no column of accelerations; it has {names}; give {EXPECTED}")
    return time[kept], channels


def impulse_document(result: ImpulseResult) -> dict[str, Any]:
    """Return what impulse.json holds."""
    return {"schema": IMPULSE_SCHEMA, **to_document(result)}


def impulse_csv(result: ImpulseResult) -> str:
    """Return impulse.csv: one row a blow and channel, empty where the fit does not tell."""

    def row(blow: Any) -> dict[str, Any]:
        natural, damping = blow.natural_frequency_hz, blow.damping_ratio
        return {
            "channel": blow.channel,
            "start_s": f"{blow.start_s:.6f}",
            "duration_s": f"{blow.duration_s:.6f}",
            "peak_hz": f"{blow.peak_hz:.6f}",
            "natural_frequency_hz": "" if natural is None else f"{natural.value:.6f}",
            "natural_frequency_std_hz": "" if natural is None else f"{natural.std:.6g}",
            "damping_ratio": "" if damping is None else f"{damping.value:.6g}",
            "damping_ratio_std": "" if damping is None else f"{damping.std:.6g}",
        }

    text = io.StringIO()
    pd.DataFrame([row(blow) for blow in result.blows]).to_csv(text, index=False, lineterminator="\n")
    return text.getvalue()
