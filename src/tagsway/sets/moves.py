"""A move laid over others, as a set keeps it: a line of JSON."""

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


def _rounded(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]
