"""The payload as a pendulum under a moving pivot."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate

GRAVITY_M_S2 = 9.81
"""Standard gravity as the documents that tagsway follows use it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pendulum:
    """The parameters of the equation of motion (see `tagsway.dynamics`).

    Parameters
    ----------
    length_m : float
        Equivalent length l = J / (m l_c).
    tag_radius_m : float
        r, from the pivot to the PCP tag.
    stiffness_over_inertia_rad2_s2 : float
        k / J.
    damping_over_inertia_rad_s : float
        b / J.
    quadratic_drag_per_rad : float
        d in the drag d q' |q'|.
    coulomb_friction_rad_s2 : float
        Dry friction's angular acceleration, against the motion.
    """

    length_m: float
    tag_radius_m: float
    stiffness_over_inertia_rad2_s2: float = 0.0
    damping_over_inertia_rad_s: float = 0.0
    quadratic_drag_per_rad: float = 0.0
    coulomb_friction_rad_s2: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length_m", "tag_radius_m"):
            if not getattr(self, name) > 0:
                raise InputError(f"a pendulum's {name} must be positive, not {getattr(self, name):g}")
        if not self.angular_frequency_squared > 0:
            raise InputError(f"this pendulum is not stable: g/l + k/J = {self.angular_frequency_squared:g} 1/s²")

    @property
    def angular_frequency_squared(self) -> float:
        """ω_n² = g/l + k/J, for a small swing."""
        return GRAVITY_M_S2 / self.length_m + self.stiffness_over_inertia_rad2_s2

    @property
    def natural_frequency_hz(self) -> float:
        """f_n = ω_n / 2π, for a small swing."""
        return math.sqrt(self.angular_frequency_squared) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """ζ = (b/J) / (2 ω_n), for a small swing."""
        return self.damping_over_inertia_rad_s / (2 * math.sqrt(self.angular_frequency_squared))


@dataclass(frozen=True, slots=True, kw_only=True)
class Implied:
    """The mode that a fitted pendulum implies, to hold against the modal one."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_hz: float
    damping_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """What was assumed before the data, and how firmly.

    Parameters
    ----------
    name : str
        "scale", "relative_scale", "vertical_scale", "gravity_tilt", "quadratic_drag", "dry_friction"; where the user
        stated it "length_over_radius", "length" or "stiffness".
    value, std : float
        Its mean and standard deviation.
    unit : str
        Of both; "1" for a ratio.
    at_least : bool
        Whether all that is believed is that it is no less than the value; the standard deviation is then 0.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    name: str
    value: float
    std: float
    unit: str
    at_least: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalDeviation:
    """The fitted pendulum against the decay's own mode: percent of f_n, and of the damping ratio at that swing."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_percent: float
    damping_ratio_percent: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PointMassFit:
    """What the thesis' own way of estimating finds, for comparison only.

    f_n and ζ are those of the decay, the payload is a point mass at its tag (r = l), and l is where the simulated
    positions come nearest to the measured ones. It tells nothing of its errors.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    length_m: float
    stiffness_over_inertia_rad2_s2: float
    damping_over_inertia_rad_s: float
    stiffness_n_m_per_rad: float | None
    damping_n_m_s_per_rad: float | None
    rms_residual_m: float
    max_residual_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoMasses:
    """What two payload masses at the same arm tell together.

    Parameters
    ----------
    file : str
        The other result.
    mass_kg : float
        The other mass.
    length_m, stiffness_n_m_per_rad : Estimate
        l and k of point masses at one arm on one spring; their errors hold 0.5 mm of difference between the arms.
    stiffness_shift_percent : float
        By how much k moves where the arms differ by 0.5 mm.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    file: str
    mass_kg: float
    length_m: Estimate
    stiffness_n_m_per_rad: Estimate
    stiffness_shift_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumEstimate:
    """What a track tells of the pendulum, and what it does not.

    Parameters
    ----------
    length_m : Estimate or None
        Equivalent length l (the thesis' l); None where it is not determined.
    tag_radius_m : Estimate or None
        Radius r of the PCP's arc.
    pivot_offset_m : Estimate or None
        Height of the pivot above the TCP tag (negative: below).
    pivot_offset_x_m : Estimate or None
        How far the pivot is to the right of the TCP tag.
    mass_kg : float or None
        As the user gave it.
    point_mass : bool or None
        Whether r = l within the errors; None where it cannot be tested.
    stiffness_n_m_per_rad, damping_n_m_s_per_rad : Estimate or None
        k and b; None without a mass.
    stiffness_over_inertia_rad2_s2, damping_over_inertia_rad_s : Estimate or None
        k/J and b/J.
    quadratic_drag_per_rad : Estimate or None
        d in the drag d q' |q'|.
    determined : bool
        Whether l and k are told apart by these data.
    reason : str
        Why, in one sentence.
    implied : Implied or None
        Mode of the fitted pendulum.
    rms_residual_m, max_residual_m : float or None
        Of the sway, measured minus simulated.
    coulomb_friction_rad_s2 : Estimate or None
        Dry friction's angular acceleration c.
    deviation : ModalDeviation or None
        Of the fitted pendulum's mode from the decay's.
    comparison : PointMassFit or None
        The thesis' own way of estimating.
    two_masses : TwoMasses or None
        What another payload mass adds, where one was given.
    priors : tuple of Prior
        What was assumed, each with its width.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    length_m: Estimate | None
    tag_radius_m: Estimate | None
    pivot_offset_m: Estimate | None
    pivot_offset_x_m: Estimate | None = None
    mass_kg: float | None
    point_mass: bool | None
    stiffness_n_m_per_rad: Estimate | None
    damping_n_m_s_per_rad: Estimate | None
    stiffness_over_inertia_rad2_s2: Estimate | None
    damping_over_inertia_rad_s: Estimate | None
    quadratic_drag_per_rad: Estimate | None
    determined: bool
    reason: str
    implied: Implied | None
    rms_residual_m: float | None
    max_residual_m: float | None
    coulomb_friction_rad_s2: Estimate | None = None
    deviation: ModalDeviation | None = None
    comparison: PointMassFit | None = None
    two_masses: TwoMasses | None = None
    priors: tuple[Prior, ...] = ()

    @classmethod
    def unknown(cls, reason: str, *, mass_kg: float | None = None) -> "PendulumEstimate":
        """Return an estimate that says nothing but why."""
        return cls(
            length_m=None,
            tag_radius_m=None,
            pivot_offset_m=None,
            pivot_offset_x_m=None,
            mass_kg=mass_kg,
            point_mass=None,
            stiffness_n_m_per_rad=None,
            damping_n_m_s_per_rad=None,
            stiffness_over_inertia_rad2_s2=None,
            damping_over_inertia_rad_s=None,
            quadratic_drag_per_rad=None,
            determined=False,
            reason=reason,
            implied=None,
            rms_residual_m=None,
            max_residual_m=None,
        )
