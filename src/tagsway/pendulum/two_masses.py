"""Two payload masses at the same arm: what their frequencies tell together."""

import math

import numpy as np

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, Estimate, Notice, TwoMasses

ARM_STD_M = 5e-4
"""How well the second payload hangs at the first one's arm: the 0.5 mm that shift k by 8 to 23 %."""

LEAST_MASS_RATIO = 1.05
"""Masses nearer to each other tell nothing."""


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

    def solve(first_hz: float, second_hz: float, longer_m: float = 0.0) -> tuple[float, float]:
        power = masses * (2 * np.pi * np.array([first_hz, second_hz])) ** 2
        gravity = float(np.diff(power)[0] / np.diff(masses)[0])
        length = GRAVITY_M_S2 / gravity if gravity > 0 else math.nan
        for _ in range(20):  # k/l² + m g/l = m ω² at l and at l + δ; converges as δ/l
            stretched = (1 + longer_m / length) ** 2
            # the second equation times (1 + δ/l)²: m2 g (l + δ)/l² + k/l²
            right = power * np.array([1.0, stretched])
            weight = masses * np.array([1.0, 1 + longer_m / length])
            gravity = float(np.diff(right)[0] / np.diff(weight)[0])
            length = GRAVITY_M_S2 / gravity if gravity > 0 else math.nan
        return length, float(power[0] - masses[0] * gravity) * length**2

    plain = solve(frequency_hz.value, other_frequency_hz.value)
    if not np.all(np.isfinite(plain)):
        raise NotIdentifiableError(
            f"--with {file}: {frequency_hz.value:.4g} Hz with {1e3 * mass_kg:g} g and {other_frequency_hz.value:.4g} "
            f"Hz with {1e3 * other_mass_kg:g} g belong to no common arm and spring: were both held alike?",
            code="two_masses_disagree",
        )
    shifts = np.array(
        [
            solve(frequency_hz.value + frequency_hz.std, other_frequency_hz.value),
            solve(frequency_hz.value, other_frequency_hz.value + other_frequency_hz.std),
            solve(frequency_hz.value, other_frequency_hz.value, ARM_STD_M),
        ]
    ) - np.array(plain)
    length_std, stiffness_std = (
        float(std) if math.isfinite(std) else math.inf for std in np.linalg.norm(shifts, axis=0)
    )
    percent = 100 * abs(float(shifts[2, 1]) / plain[1]) if plain[1] else math.inf
    if not np.all(np.isfinite([length_std, stiffness_std, percent])):
        raise NotIdentifiableError(
            f"--with {file}: 0.5 mm between the two arms would leave no solution: the masses are too alike",
            code="two_masses_disagree",
        )
    both = TwoMasses(
        file=file,
        mass_kg=other_mass_kg,
        length_m=Estimate.normal(plain[0], length_std, low=0.0),
        stiffness_n_m_per_rad=Estimate.normal(plain[1], stiffness_std),
        stiffness_shift_percent=percent,
    )
    message = (
        f"with the {1e3 * other_mass_kg:g} g of {file}: l = {1e3 * plain[0]:.4g} ± {1e3 * length_std:.2g} mm, "
        f"k = {plain[1]:.3g} ± {stiffness_std:.2g} N m/rad, if both are point masses at the same arm: 0.5 mm between "
        f"the two arms moves k by {percent:.2g} %"
    )
    return both, Notice(code="two_masses", message=message)
