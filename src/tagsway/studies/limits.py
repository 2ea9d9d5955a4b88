"""The two use cases of document 1: how fast before the product peels off, and before it hits the box."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from tagsway.errors import InputError
from tagsway.model import LimitRow, Move, Quantity, StudyRow
from tagsway.simulation import Payload
from tagsway.studies.accelerations import study_accelerations
from tagsway.studies.sweep import Shaping

_VALUE_OF: Mapping[Quantity, Callable[[StudyRow], float | None]] = MappingProxyType(
    {
        "pcp_acceleration_m_s2": lambda row: row.pcp_acceleration_m_s2,
        "overshoot_percent": lambda row: row.overshoot_percent,
        "box_error_m": lambda row: row.box_error_m,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """The most that a quantity may reach."""

    quantity: Quantity
    most: float

    def __post_init__(self) -> None:
        if not 0 < self.most < np.inf:
            raise InputError(f"the limit of {self.quantity} is {self.most:g}: expected more than 0")

    def keeps(self, row: StudyRow) -> bool:
        """Return whether a row is within; what is not known is not."""
        value = _VALUE_OF[self.quantity](row)
        return value is not None and value <= self.most


def study_limits(
    move: Move,
    accelerations_m_s2: Sequence[float],
    payload: Payload,
    shapings: Sequence[Shaping],
    limits: Sequence[Limit],
    *,
    reference_m: float | None = None,
) -> tuple[list[LimitRow], list[StudyRow]]:
    """Find the largest acceleration under each limit, worst over a payload's samples (document 1, Table 8.5).

    Parameters
    ----------
    move : Move
        Its own acceleration does not count.
    accelerations_m_s2 : sequence of float
        To be scanned, rising.
    payload : Payload
        Samples.
    shapings : sequence of Shaping
        Each is scanned.
    limits : sequence of Limit
        Each by itself.
    reference_m : float, optional
        Of the percentages; by default the travel.

    Returns
    -------
    limits : list of LimitRow
        For each limit, each shaping: both the last move before the limit is reached for the first time, and the last
        feasible one. The swing that a move leaves has zeros along the acceleration, so feasibility comes and goes:
        every value is tried, none is bisected.
    rows : list of StudyRow
        Of the scan.
    """
    scan = [float(a) for a in accelerations_m_s2]
    if not scan or np.any(np.diff(scan) <= 0):
        raise InputError(f"accelerations to scan must rise, and be at least one, not {scan}")
    rows = study_accelerations(move, scan, payload, shapings, reference_m=reference_m)
    return [_find(limit, shaping, rows, scan) for limit in limits for shaping in shapings], rows


def _find(limit: Limit, shaping: Shaping, rows: Sequence[StudyRow], scan: Sequence[float]) -> LimitRow:
    own = [row for row in rows if row.shaping == shaping.name]
    kept = [limit.keeps(row) for row in own]
    first = kept.index(False) if False in kept else len(kept)
    feasible = [row for row, keeps in zip(own, kept, strict=True) if keeps]
    return LimitRow(
        quantity=limit.quantity,
        limit=limit.most,
        shaping=shaping.name,
        before_first=own[first - 1] if first else None,
        last_feasible=feasible[-1] if feasible else None,
        scan_m_s2=(scan[0], scan[-1]),
        reached=first < len(kept),
    )
