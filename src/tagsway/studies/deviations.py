"""What a shaper still does for a payload whose frequency is not the one that it was designed for."""

from collections.abc import Sequence

from tagsway.model import Move, StudyRow
from tagsway.simulation import Payload
from tagsway.studies.sweep import UNSHAPED, Shaping, frequency_range, row_of, sweep_moves, take_sample


def study_deviations(
    move: Move,
    payload: Payload,
    shapings: Sequence[Shaping],
    *,
    nominal: int,
    reference_m: float | None = None,
) -> list[StudyRow]:
    """Run a move with each shaping for each sample of a payload (document 1, Tables 6.2 and 6.3).

    Parameters
    ----------
    move : Move
        At its own acceleration.
    payload : Payload
        Samples whose frequency differs, see `vary_modes`.
    shapings : sequence of Shaping
        Designed for one frequency.
    nominal : int
        The sample at that frequency: the unshaped move of *this* sample is what the ratios refer to.
    reference_m : float, optional
        Of the percentages; by default the travel.

    Returns
    -------
    list of StudyRow
        For each shaping, each sample.
    """
    accelerations = [move.max_acceleration_m_s2]

    def run(shaping: Shaping) -> list[dict[str, float]]:
        found = sweep_moves(move, accelerations, payload, shaping, reference_m=reference_m)
        return [take_sample(found, 0, sample) for sample in range(len(payload))]

    unshaped = run(UNSHAPED)
    return [
        row_of(
            values,
            unshaped[nominal],
            shaping,
            move.max_acceleration_m_s2,
            frequency_range(payload.frequency_hz, sample),
        )
        for shaping in shapings
        for sample, values in enumerate(unshaped if shaping == UNSHAPED else run(shaping))
    ]
