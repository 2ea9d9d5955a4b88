"""How fast a move may become before shaping it costs time."""

from collections.abc import Iterable, Sequence

from tagsway.model import Move, Pair, StudyRow
from tagsway.simulation import Payload
from tagsway.studies.sweep import UNSHAPED, Shaping, sweep_moves, worst_rows


def study_accelerations(
    move: Move,
    accelerations_m_s2: Sequence[float],
    payload: Payload,
    shapings: Sequence[Shaping],
    *,
    reference_m: float | None = None,
) -> list[StudyRow]:
    """Run a move at each acceleration with each shaping (document 1, Tables 8.3 and 8.4).

    Parameters
    ----------
    move : Move
        Its own acceleration does not count.
    accelerations_m_s2 : sequence of float
        In their order.
    payload : Payload
        Samples: each row is the worst of them.
    shapings : sequence of Shaping
        The ratios need `UNSHAPED` among them.
    reference_m : float, optional
        Of the percentages; by default the travel.

    Returns
    -------
    list of StudyRow
        For each shaping, each acceleration.
    """
    found = {
        shaping.name: sweep_moves(move, accelerations_m_s2, payload, shaping, reference_m=reference_m)
        for shaping in shapings
    }
    return worst_rows(found, shapings, accelerations_m_s2, payload)


def find_pairs(rows: Iterable[StudyRow]) -> list[Pair]:
    """Return every unshaped move with every shaped one that is no slower and overshoots no more.

    Parameters
    ----------
    rows : iterable of StudyRow
        Of one study.

    Returns
    -------
    list of Pair
        By motion time, which is the settling time where the payload settles late. A shaped move that never settles is
        in no pair; an unshaped one that never does is slower than all.
    """
    every = list(rows)
    unshaped = [row for row in every if row.shaping == UNSHAPED.name]
    shaped = [row for row in every if row.shaping != UNSHAPED.name and row.motion_time_s is not None]
    return [
        Pair(unshaped=plain, shaped=row, gentler=row.pcp_acceleration_m_s2 <= plain.pcp_acceleration_m_s2)
        for plain in unshaped
        for row in shaped
        if _no_slower(row, plain) and row.overshoot_percent <= plain.overshoot_percent
    ]


def _no_slower(shaped: StudyRow, plain: StudyRow) -> bool:
    if shaped.motion_time_s is None:
        return False
    return plain.motion_time_s is None or shaped.motion_time_s <= plain.motion_time_s
