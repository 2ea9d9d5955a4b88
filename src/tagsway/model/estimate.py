"""A number that knows how sure it is, and the words that go with a result."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

FORBID_UNKNOWN: dict[str, str] = {"extra": "forbid"}
"""The pydantic setting of every type that is read from a file: a key that is not known is an error."""

NORMAL_95 = 1.959963984540054
"""Half the width of a normal distribution's central 95 %, in standard deviations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value with its standard error and its 95 % interval.

    Parameters
    ----------
    value : float
        The estimate.
    std : float
        Its standard error, in the same unit.
    ci95 : tuple of float
        The interval that holds the truth in 95 of 100 measurements; need not be symmetric.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    value: float
    std: float
    ci95: tuple[float, float]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and self.std >= 0 and self.ci95[0] <= self.ci95[1]):
            raise ValueError(f"an estimate needs a finite value, std >= 0 and an ordered interval, not {self}")

    @classmethod
    def normal(cls, value: float, std: float, *, low: float = -math.inf, high: float = math.inf) -> Self:
        """Return an estimate with a normal interval, cut off where the quantity cannot lie.

        Parameters
        ----------
        value, std : float
            The estimate and its standard error.
        low, high : float
            Bounds of the quantity itself (a damping ratio is not negative); the interval is clipped to them.

        Returns
        -------
        Estimate
            With ``ci95 = value ± 1.96 std``, clipped.
        """
        half = NORMAL_95 * float(std)
        interval = (min(max(float(value) - half, low), high), max(min(float(value) + half, high), low))
        return cls(value=float(value), std=float(std), ci95=interval)


REMARKS = frozenset(
    {
        "acceleration_record",
        "angle_record",
        "camera_from_motion",
        "capture_rate_from_metadata",
        "damping_depends_on_amplitude",
        "fast_for_its_radius",
        "frequency_depends_on_amplitude",
        "further_mode",
        "linear_decay_rejected",
        "no_mass",
        "no_move",
        "no_spring",
        "no_tag_size",
        "pendulum_indicative",
        "pendulum_not_determined",
        "pendulum_record_shortened",
        "plain_scale",
        "point_mass_equivalent",
        "prior_stated",
        "several_decays",
        "single_measurement",
        "slow_for_its_radius",
        "sways_across",
        "tool_from_log",
        "two_masses",
        "unit_assumed",
    }
)
"""Codes of notices that say what a measurement cannot tell, not that something was wrong with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """A warning that a result carries: a code for programs, a sentence for people."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    code: str
    message: str

    @property
    def is_remark(self) -> bool:
        """Whether it tells what to know, not that something was wrong."""
        return self.code in REMARKS
