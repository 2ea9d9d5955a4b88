"""Two payload masses at the same arm: what their frequencies tell together."""

import math

import numpy as np

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, Estimate, FloatArray, Notice, TwoMasses

ARM_STD_M = 5e-4
"""How well the second payload hangs at the first one's arm: the 0.5 mm that shift k by 8 to 23 %."""

LEAST_MASS_RATIO = 1.05
"""Masses nearer to each other tell nothing."""

_ARM_STEPS = 20


def combine_masses(
    frequency_hz: Estimate, mass_kg: float, other_frequency_hz: Estimate, other_mass_kg: float, *, file: str
) -> tuple[TwoMasses, Notice]:
    """Return l and k of two point masses on one arm and one spring.

    Parameters
    ----------
    frequency_hz, other_frequency_hz : Estimate
        f_n of the two payloads.
    mass_kg, other_mass_kg : float
        Their masses.
    file : str
        Where the other one's come from.

    Returns
    -------
    TwoMasses
        With errors of both frequencies and of 0.5 mm between the two arms.
    Notice
        Code `two_masses`: by how much k moves with 0.5 mm.

    Raises
    ------
    InputError
        Masses within 5 % of each other.
    NotIdentifiableError
        Frequencies that no common arm and spring explain.

    Notes
    -----
    m_i ω_i² = m_i g/l + k/l², so that g/l = (m_1 ω_1² - m_2 ω_2²) / (m_1 - m_2), and k follows from either. Where the
    second arm is longer by δ, its equation holds l + δ instead.

    Not for payloads that are no points, nor for two grippers.
    """
    if not max(mass_kg, other_mass_kg) >= LEAST_MASS_RATIO * min(mass_kg, other_mass_kg):
        raise InputError(
            f"--with {file}: masses of {1e3 * mass_kg:g} and {1e3 * other_mass_kg:g} g are too near to each other: "
            "expected at least 5 % between them"
        )
    masses = np.array([mass_kg, other_mass_kg])
    frequencies = np.array([frequency_hz.value, other_frequency_hz.value])
    length, stiffness = _solve_arm(frequencies, masses)
    if not math.isfinite(length + stiffness):
        raise NotIdentifiableError(
            f"--with {file}: {frequencies[0]:.4g} Hz with {1e3 * mass_kg:g} g and {frequencies[1]:.4g} Hz with "
            f"{1e3 * other_mass_kg:g} g belong to no common arm and spring: were both held alike?",
            code="two_masses_disagree",
        )
    errors = np.diag([frequency_hz.std, other_frequency_hz.std])
    moved = [_solve_arm(frequencies + error, masses) for error in errors]
    moved.append(_solve_arm(frequencies, masses, longer_m=ARM_STD_M))
    shifts: FloatArray = np.subtract(moved, (length, stiffness))
    length_std, stiffness_std = map(float, np.linalg.norm(shifts, axis=0))
    percent = 100 * abs(float(shifts[2, 1]) / stiffness) if stiffness else math.inf
    if not math.isfinite(length_std + stiffness_std + percent):
        raise NotIdentifiableError(
            f"--with {file}: 0.5 mm between the two arms would leave no solution: the masses are too alike",
            code="two_masses_disagree",
        )
    both = TwoMasses(
        file=file,
        mass_kg=other_mass_kg,
        length_m=Estimate.normal(length, length_std, low=0.0),
        stiffness_n_m_per_rad=Estimate.normal(stiffness, stiffness_std),
        stiffness_shift_percent=percent,
    )
    message = (
        f"with the {1e3 * other_mass_kg:g} g of {file}: l = {1e3 * length:.4g} ± {1e3 * length_std:.2g} mm, "
        f"k = {stiffness:.3g} ± {stiffness_std:.2g} N m/rad, if both are point masses at the same arm: 0.5 mm between "
        f"the two arms moves k by {percent:.2g} %"
    )
    return both, Notice(code="two_masses", message=message)


def _solve_arm(frequencies_hz: FloatArray, masses_kg: FloatArray, *, longer_m: float = 0.0) -> tuple[float, float]:
    """Return l and k of two payloads, the second one's arm so much longer; NaN where there is no such arm."""
    power = masses_kg * (2 * np.pi * frequencies_hz) ** 2
    share = 0.0
    for _ in range(_ARM_STEPS):  # k/l² + m g/l = m ω² at l and at l + δ; converges as δ/l
        # the second equation times (1 + δ/l)²: m2 g (l + δ)/l² + k/l²
        right = power * [1.0, (1 + share) ** 2]
        weight = masses_kg * [1.0, 1 + share]
        gravity = float(np.diff(right)[0] / np.diff(weight)[0])
        length = GRAVITY_M_S2 / gravity if gravity > 0 else math.nan
        share = longer_m / length
    return length, float(power[0] - masses_kg[0] * gravity) * length**2
