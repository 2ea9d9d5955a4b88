"""Samples of a payload: the same pendulum as it may be picked the next time."""

from dataclasses import dataclass

import numpy as np

from tagsway.dynamics import LightBody, PendulumEnsemble
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, FloatArray, Mode, Pendulum


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """m samples of a payload.

    Parameters
    ----------
    pendulums : PendulumEnsemble
        Their parameters.
    tag_radius_m : ndarray, shape (m,)
        r, from the pivot to the PCP tag.
    second : LightBody or None
        A second body that hangs from the first, where there is one.
    """

    pendulums: PendulumEnsemble
    tag_radius_m: FloatArray
    second: LightBody | None = None

    @property
    def frequency_hz(self) -> FloatArray:
        """f_n of each sample, for a small swing."""
        square = GRAVITY_M_S2 / self.pendulums.length_m + self.pendulums.stiffness_over_inertia_rad2_s2
        frequency: FloatArray = np.sqrt(square) / (2 * np.pi)
        return frequency

    @property
    def damping_ratio(self) -> FloatArray:
        """ζ of each sample, for a small swing."""
        ratio: FloatArray = self.pendulums.damping_over_inertia_rad_s / (4 * np.pi * self.frequency_hz)
        return ratio

    def __len__(self) -> int:
        return len(self.tag_radius_m)


def hang_pendulums(*pendulums: Pendulum) -> Payload:
    """Return the samples that have these parameters (l, r, k/J, b/J), in their order."""
    if not pendulums:
        raise InputError("a simulation needs at least one pendulum, not none")
    return Payload(
        pendulums=PendulumEnsemble.of(*pendulums), tag_radius_m=np.array([p.tag_radius_m for p in pendulums])
    )


def pendulum_of_mode(mode: Mode, *, tag_radius_m: float | None = None) -> Pendulum:
    """Return the pendulum without a spring that has a mode.

    Parameters
    ----------
    mode : Mode
        Undamped frequency and damping ratio for a small swing.
    tag_radius_m : float, optional
        r; by default l, the point mass.

    Returns
    -------
    Pendulum
        l = g/ω_n². Frequency and damping do not tell l from k: with a spring the same mode has a shorter arm, sways
        less far, and feels the vertical acceleration less.
    """
    _check_mode(mode.natural_frequency_hz, mode.damping_ratio)
    wn = 2 * np.pi * mode.natural_frequency_hz
    length = GRAVITY_M_S2 / wn**2
    return Pendulum(
        length_m=length,
        tag_radius_m=length if tag_radius_m is None else tag_radius_m,
        damping_over_inertia_rad_s=2 * mode.damping_ratio * wn,
    )


def vary_modes(pendulum: Pendulum, frequency_hz: FloatArray, damping_ratio: FloatArray | float) -> Payload:
    """Return samples of a payload whose frequency and damping are not always the same.

    Parameters
    ----------
    pendulum : Pendulum
        The payload as it was measured.
    frequency_hz : ndarray, shape (m,)
        f_n of each sample.
    damping_ratio : ndarray, shape (m,), or float
        ζ of each sample.

    Returns
    -------
    Payload
        Samples whose arm differs, at one spring k and mass, as document 1 varies them: with u = 1/l and
        κ = (k/J) l0², ω_n² = g u + κ u² [1]_. r/l, drag and dry friction stay.

    References
    ----------
    .. [1] The thesis, section 6.4; k below zero, which a longer arm at a fixed frequency would need, cannot occur.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=float))
    zeta = np.broadcast_to(np.asarray(damping_ratio, dtype=float), frequency.shape)
    for f, z in zip(frequency, zeta, strict=True):
        _check_mode(float(f), float(z))
    wn = 2 * np.pi * frequency
    spring = pendulum.stiffness_over_inertia_rad2_s2 * pendulum.length_m**2
    root = GRAVITY_M_S2**2 + 4 * spring * wn**2
    if not np.all(root > 0):
        raise InputError(
            f"k/J is {pendulum.stiffness_over_inertia_rad2_s2:g} 1/s²: no arm makes {frequency.max():g} Hz"
        )
    inverse = 2 * wn**2 / (GRAVITY_M_S2 + np.sqrt(root))
    same = np.ones_like(frequency)
    return Payload(
        pendulums=PendulumEnsemble(
            length_m=1 / inverse,
            stiffness_over_inertia_rad2_s2=spring * inverse**2,
            damping_over_inertia_rad_s=2 * zeta * wn,
            quadratic_drag_per_rad=same * pendulum.quadratic_drag_per_rad,
            coulomb_friction_rad_s2=same * pendulum.coulomb_friction_rad_s2,
        ),
        tag_radius_m=pendulum.tag_radius_m / pendulum.length_m / inverse,
    )


def add_second_body(payload: Payload, mode: Mode, *, gain: float = 1.0) -> Payload:
    """Return the same samples with a light second body hung at the first one's tag.

    Parameters
    ----------
    payload : Payload
        Without one.
    mode : Mode
        Of the second body alone: the second mode that was identified.
    gain : float
        How far it sways per acceleration of its support, against a point mass on a string. A film of the decay tells
        frequency and damping; it tells the gain only together with the move before it.

    Returns
    -------
    Payload
        The tag then moves with the second body. It does not act back on the first: not for a body that weighs as
        much as what carries it, nor for two modes that lie closer than their widths.
    """
    _check_mode(mode.natural_frequency_hz, mode.damping_ratio)
    same = np.ones(len(payload))
    return Payload(
        pendulums=payload.pendulums,
        tag_radius_m=payload.tag_radius_m,
        second=LightBody(
            carried_at_m=payload.tag_radius_m,
            angular_frequency_rad_s=same * 2 * np.pi * mode.natural_frequency_hz,
            damping_ratio=same * mode.damping_ratio,
            gain=same * gain,
        ),
    )


def _check_mode(frequency_hz: float, damping_ratio: float) -> None:
    if not (0 < frequency_hz < np.inf and 0 <= damping_ratio < 1):
        raise InputError(
            f"a mode of {frequency_hz:g} Hz with a damping ratio of {damping_ratio:g}: expected a frequency above 0 "
            "and a ratio from 0 to below 1"
        )
