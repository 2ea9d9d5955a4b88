"""Many moves for many payloads, and the rows that come of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from tagsway.criteria import Criteria
from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Shaper, StudyRow, Trajectory
from tagsway.simulation import Payload, longest_step, simulate_moves
from tagsway.trajectories import plan_move, plan_shaped

STEP_S = 2e-3
"""Of the simulation: 1e-6 mm of error at 2.5 Hz, and a peak acceleration 0.05 % low."""

REST_S = 2.0
"""How long a payload is watched after its move; one that settles later counts as never settled."""

SIDE_BY_SIDE = 1024
"""Motions that are simulated at once: as many as stay in a core's cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaping:
    """A shaper, and the axes that it is laid over.

    Parameters
    ----------
    name : str
        "unshaped", "x", "x,z" …
    shaper : Shaper or None
        None leaves the move as it is.
    axes : tuple of str
        As a move's `shaped_axes`.
    """

    name: str
    shaper: Shaper | None
    axes: tuple[str, ...]

    def plan(self, move: Move, acceleration_m_s2: float) -> Trajectory:
        """Return the move at an acceleration, shaped."""
        faster = replace(move, max_acceleration_m_s2=acceleration_m_s2, shaped_axes=self.axes)  # type: ignore[arg-type]
        return plan_move(faster) if self.shaper is None else plan_shaped(faster, self.shaper)


UNSHAPED = Shaping(name="unshaped", shaper=None, axes=())


def shapings_of(shaper: Shaper | None) -> tuple[Shaping, ...]:
    """Return the three ways to run a move with a shaper: unshaped, x, x and z; without one the first alone."""
    if shaper is None:
        return (UNSHAPED,)
    return (
        UNSHAPED,
        Shaping(name="x", shaper=shaper, axes=("x",)),
        Shaping(name="x,z", shaper=shaper, axes=("x", "z")),
    )


def sweep_moves(
    move: Move,
    accelerations_m_s2: Sequence[float],
    payload: Payload,
    shaping: Shaping,
    *,
    reference_m: float | None = None,
    step_s: float | None = None,
    rest_s: float = REST_S,
) -> Criteria:
    """Simulate one move at many accelerations for every sample of a payload.

    Parameters
    ----------
    move : Move
        Its own acceleration does not count.
    accelerations_m_s2 : sequence of float
        c of them.
    payload : Payload
        m samples.
    shaping : Shaping
        How it is shaped.
    reference_m : float, optional
        Of the percentages; by default the travel.
    step_s, rest_s : float
        Of the simulation, see `simulate_moves`; the step is by default 2 ms, or a 50th of the payload's period.

    Returns
    -------
    Criteria
        Each array of shape (c, m).
    """
    accelerations = list(accelerations_m_s2)
    if not accelerations or not all(0 < a < np.inf for a in accelerations):
        raise InputError(f"accelerations must be positive, and at least one, not {accelerations}")
    step = min(STEP_S, longest_step(payload)) if step_s is None else step_s
    together = max(1, SIDE_BY_SIDE // len(payload))
    found = [
        simulate_moves(
            [shaping.plan(move, a) for a in accelerations[i : i + together]], payload, step_s=step, rest_s=rest_s
        ).judge(reference_m=reference_m)
        for i in range(0, len(accelerations), together)
    ]
    return Criteria(**{f.name: np.concatenate([getattr(each, f.name) for each in found]) for f in fields(Criteria)})


def worst_rows(
    found: Mapping[str, Criteria],
    shapings: Sequence[Shaping],
    accelerations_m_s2: Sequence[float],
    payload: Payload,
) -> list[StudyRow]:
    """Return a row for each shaping and acceleration: each quantity's worst over the samples.

    The overshoot ratio and the reduction are those of the worst values, against the unshaped ones at the same
    acceleration where they were simulated.
    """
    lowest, highest = float(payload.frequency_hz.min()), float(payload.frequency_hz.max())
    unshaped = found.get(UNSHAPED.name)
    return [
        row_of(
            take_worst(found[shaping.name], i),
            None if unshaped is None else take_worst(unshaped, i),
            shaping,
            acceleration,
            (lowest, highest),
        )
        for shaping in shapings
        for i, acceleration in enumerate(accelerations_m_s2)
    ]


def take_worst(found: Criteria, index: int) -> dict[str, float]:
    """Return the largest of each quantity over the samples; NaN (never settled, not known) is worse than any."""
    return {f.name: float(np.max(getattr(found, f.name)[index])) for f in fields(Criteria)}


def take_sample(found: Criteria, index: int, sample: int) -> dict[str, float]:
    """Return the quantities of one sample."""
    return {f.name: float(getattr(found, f.name)[index, sample]) for f in fields(Criteria)}


def row_of(
    values: Mapping[str, float],
    unshaped: Mapping[str, float] | None,
    shaping: Shaping,
    acceleration_m_s2: float,
    frequency_hz: tuple[float, float],
) -> StudyRow:
    """Return the row of one case."""
    overshoot_ratio = residual_share = float("nan")
    if unshaped is not None:
        overshoot_ratio = _ratio(values["overshoot_percent"], unshaped["overshoot_percent"])
        residual_share = _ratio(values["residual_rms_m_s2"], unshaped["residual_rms_m_s2"])
    return StudyRow(
        shaping=shaping.name,
        shaper="none" if shaping.shaper is None else shaping.shaper.type,
        max_acceleration_m_s2=float(acceleration_m_s2),
        frequency_hz=frequency_hz,
        trajectory_time_s=values["trajectory_time_s"],
        settling_time_s=_known(values["settling_time_s"]),
        motion_time_s=_known(values["motion_time_s"]),
        pcp_acceleration_m_s2=values["horizontal_m_s2"],
        pcp_vector_m_s2=values["vector_m_s2"],
        overshoot_percent=values["overshoot_percent"],
        overshoot_ratio_percent=_known(100 * overshoot_ratio),
        residual_max_m_s2=_known(values["residual_max_m_s2"]),
        residual_rms_m_s2=_known(values["residual_rms_m_s2"]),
        residual_reduction_percent=_known(100 * (1 - residual_share)),
        box_error_m=_known(values["box_error_m"]),
        place_error_m=_known(values["place_error_m"]),
    )


def frequency_range(frequency_hz: FloatArray, sample: int) -> tuple[float, float]:
    """Return one sample's frequency as the range of a row."""
    return float(frequency_hz[sample]), float(frequency_hz[sample])


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _ratio(value: float, whole: float) -> float:
    return value / whole if whole > 0 else float("nan")
