"""What studies of many simulated moves say: one row a case, and the figures that go with it."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.estimate import FORBID_UNKNOWN

Quantity = Literal["pcp_acceleration_m_s2", "overshoot_percent", "box_error_m"]
"""What a move may be limited by: the largest |x''| of the product, its overshoot, its error below the box's rim."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyRow:
    """How one move ends for one payload, or for the worst of many; None for what cannot be said.

    Parameters
    ----------
    shaping : str
        "unshaped", or the axes that are shaped: "x", "x,z".
    shaper : str
        Its type; "none" for the unshaped move.
    max_acceleration_m_s2 : float
        That the move is planned with.
    frequency_hz : tuple of float
        Lowest and highest natural frequency of the payloads that the row is the worst of; the same twice for one.
    trajectory_time_s, settling_time_s, motion_time_s : float or None
        None where the payload never settles in the time that was simulated.
    pcp_acceleration_m_s2, pcp_vector_m_s2 : float
        Largest |x''|, and largest √(x''² + (z'' + g)²).
    overshoot_percent : float
        Over the reference.
    overshoot_ratio_percent : float or None
        Residual vibration as document 1 has it: the overshoot over that of the unshaped move at the same acceleration;
        None where that is nothing.
    residual_max_m_s2, residual_rms_m_s2 : float or None
        |x''| after the move.
    residual_reduction_percent : float or None
        How much of the RMS is gone against the unshaped move, as document 4 has it.
    box_error_m, place_error_m : float or None
        Largest |x - x_end| below the rim of the box, and after the move.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    shaping: str
    shaper: str
    max_acceleration_m_s2: float
    frequency_hz: tuple[float, float]
    trajectory_time_s: float
    settling_time_s: float | None
    motion_time_s: float | None
    pcp_acceleration_m_s2: float
    pcp_vector_m_s2: float
    overshoot_percent: float
    overshoot_ratio_percent: float | None
    residual_max_m_s2: float | None
    residual_rms_m_s2: float | None
    residual_reduction_percent: float | None
    box_error_m: float | None
    place_error_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """An unshaped move, and a shaped one that is no slower and overshoots no more.

    Parameters
    ----------
    unshaped, shaped : StudyRow
        Both.
    gentler : bool
        Whether the shaped one does not accelerate the product more, either.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    unshaped: StudyRow
    shaped: StudyRow
    gentler: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitRow:
    """The largest acceleration of a move under one limit, worst over the payloads, on the scanned accelerations.

    Parameters
    ----------
    quantity : str
        What is limited.
    limit : float
        Its most.
    shaping : str
        As in `StudyRow`.
    before_first : StudyRow or None
        The last scanned move before the limit is reached for the first time; None where the slowest breaks it.
    last_feasible : StudyRow or None
        The largest scanned acceleration that keeps the limit; above `before_first` where feasibility is not monotone.
    scan_m_s2 : tuple of float
        Lowest and highest scanned acceleration.
    reached : bool
        Whether any scanned move breaks the limit.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    quantity: Quantity
    limit: float
    shaping: str
    before_first: StudyRow | None
    last_feasible: StudyRow | None
    scan_m_s2: tuple[float, float]
    reached: bool
