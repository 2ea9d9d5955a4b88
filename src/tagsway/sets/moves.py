"""Moves laid over others: as a set keeps them, and as they are drawn."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tagsway.model import AlignedMove, FloatArray

MOST_DRAWN = 400
"""Points of a kept move."""


def to_plain_move(move: AlignedMove | None) -> dict[str, Any] | None:
    """Return a move as plain lists, thinned, of six digits; None for what was not seen."""
    if move is None:
        return None
    step = -(-len(move.time_s) // MOST_DRAWN)
    return {
        "time_s": _rounded(move.time_s[::step]),
        "sway_mm": _rounded(1e3 * move.sway_m[::step]),
        "beyond_mm": _rounded(1e3 * move.beyond_m[::step]),
        "acceleration_m_s2": _rounded(move.acceleration_m_s2[::step]),
        "end_s": move.end_s,
    }


def to_move(plain: dict[str, Any] | None) -> AlignedMove | None:
    """Return the move that plain lists hold."""
    if plain is None:
        return None
    return AlignedMove(
        time_s=np.asarray(plain["time_s"], dtype=float),
        sway_m=np.asarray(plain["sway_mm"], dtype=float) / 1e3,
        beyond_m=np.asarray(plain["beyond_mm"], dtype=float) / 1e3,
        acceleration_m_s2=np.asarray(plain["acceleration_m_s2"], dtype=float),
        end_s=float(plain["end_s"]),
    )


def median_move(moves: Sequence[AlignedMove]) -> AlignedMove | None:
    """Return the median of some moves at each time, as far as all of them were watched; None for fewer than two."""
    if len(moves) < 2:
        return None
    end = min(float(move.time_s[-1]) for move in moves)
    time = np.linspace(0, end, MOST_DRAWN)

    def middle(name: str) -> FloatArray:
        each: FloatArray = np.full((len(moves), len(time)), np.nan)
        for row, move in zip(each, moves, strict=True):
            values: FloatArray = getattr(move, name)
            seen = np.isfinite(values)
            if seen.any():
                row[:] = np.interp(time, move.time_s[seen], values[seen], left=np.nan, right=np.nan)
        told = np.isfinite(each).sum(axis=0) * 2 >= len(moves)
        result: FloatArray = np.full(len(time), np.nan)
        result[told] = np.nanmedian(each[:, told], axis=0)
        return result

    return AlignedMove(
        time_s=time,
        sway_m=middle("sway_m"),
        beyond_m=middle("beyond_m"),
        acceleration_m_s2=middle("acceleration_m_s2"),
        end_s=float(np.median([move.end_s for move in moves])),
    )


def _rounded(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]
