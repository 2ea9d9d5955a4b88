"""How well a motion ended: the same numbers for measured and for simulated tracks."""

from dataclasses import dataclass
from typing import ClassVar

from tagsway.model.arrays import FloatArray
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakAcceleration:
    """Largest acceleration of the product, below a bandwidth.

    Parameters
    ----------
    horizontal : Estimate or None
        Of |x''|, in m/s².
    vector_with_gravity : Estimate or None
        Of √(x''² + (z'' + g)²): what the gripper must hold, in m/s² per unit of mass.
    bandwidth_hz : float
        Up to which the acceleration was seen.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    horizontal: Estimate | None
    vector_with_gravity: Estimate | None
    bandwidth_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualAcceleration:
    """The product's horizontal acceleration after the move, in m/s²."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    max: float
    rms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Indicators:
    """Indicators of a rest-to-rest move.

    Parameters
    ----------
    reference_m : float
        Length that the two percentages refer to: the travel, unless a place coordinate was given.
    settling_time_s : float or None
        From the start of the move until the product stays within ±2 % of the reference; None where it never does.
    overshoot_percent : float
        Farthest excursion beyond the final position, in the direction of travel, over the reference.
    trajectory_time_s : float
        Duration of the tool's motion.
    motion_time_s : float or None
        The longer of trajectory and settling time; None where it never settles.
    max_pcp_acceleration_m_s2 : PeakAcceleration
        During and after the move.
    residual_acceleration_m_s2 : ResidualAcceleration or None
        After the move; None where the record ends with it.
    box_error_m : float or None
        Largest |x - x_end| of the product below the rim of a box, 50 mm above where it comes to rest, on its way down
        and after; None where it never was above it.
    place_error_m : float or None
        Largest |x - x_end| of the product once the tool stands: what a design's placement window promises.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    reference_m: float
    settling_time_s: float | None
    overshoot_percent: float
    trajectory_time_s: float
    motion_time_s: float | None
    max_pcp_acceleration_m_s2: PeakAcceleration
    residual_acceleration_m_s2: ResidualAcceleration | None
    box_error_m: float | None = None
    place_error_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignedMove:
    """A move from its start on, as it is laid over others; shapes (n,), NaN where the product was not seen.

    Parameters
    ----------
    time_s : ndarray
        From the start of the tool's motion.
    sway_m : ndarray
        Product minus tool along the travel, from where both rest.
    beyond_m : ndarray
        Product beyond its resting place, along the travel.
    acceleration_m_s2 : ndarray
        x'' of the product.
    end_s : float
        When the tool stands again.
    """

    time_s: FloatArray
    sway_m: FloatArray
    beyond_m: FloatArray
    acceleration_m_s2: FloatArray
    end_s: float
