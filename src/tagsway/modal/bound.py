"""The Cramér-Rao bound: what no unbiased estimator can beat."""

import numpy as np

from tagsway.modal.decay import ALPHA, COSINE, OFFSET, OMEGA, PLACES, SINE, Terms, predict
from tagsway.model import Bound, FloatArray


def find_bound(
    time_s: FloatArray,
    *,
    natural_frequency_hz: float,
    damping_ratio: float,
    amplitude: float,
    noise: float,
    phase_rad: float = 0.0,
) -> Bound:
    """Return the bound for a plain decay with an offset, in white noise.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        The samples that exist, from the start of the decay.
    natural_frequency_hz, damping_ratio : float
        Undamped f_n and ζ.
    amplitude, noise : float
        At t = 0, and standard deviation, in the same unit.
    phase_rad : float
        φ of A e^(-αt) cos(ω_d t + φ).

    Returns
    -------
    Bound
        1σ. Coloured noise, and terms beyond the plain decay, make it larger.

    Notes
    -----
    Cov = σ² (JᵀJ)⁻¹ of (ω_d, α, two amplitudes, offset), mapped to (f_n, ζ).
    """
    omega_n = 2 * np.pi * natural_frequency_hz
    p = np.zeros(PLACES)
    p[OMEGA], p[ALPHA] = omega_n * np.sqrt(1 - damping_ratio**2), omega_n * damping_ratio
    p[COSINE], p[SINE] = amplitude * np.cos(phase_rad), -amplitude * np.sin(phase_rad)
    rows = predict(time_s, p, Terms())[1][:, [OMEGA, ALPHA, COSINE, SINE, OFFSET]]
    unit = np.linalg.norm(rows, axis=0)
    covariance = noise**2 * np.linalg.inv((rows / unit).T @ (rows / unit)) / np.outer(unit, unit)
    mapped = to_modal(p)[1][:, :2] @ covariance[:2, :2] @ to_modal(p)[1][:, :2].T
    return Bound(natural_frequency_hz=float(np.sqrt(mapped[0, 0])), damping_ratio=float(np.sqrt(mapped[1, 1])))


def to_modal(p: FloatArray, *, mode: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return (f_n, ζ) of these parameters, and their derivatives.

    Parameters
    ----------
    p : ndarray, shape (11 + 4 k,)
        Parameters in the order of `tagsway.modal.decay`.
    mode : int
        0 is the first, and so on.

    Returns
    -------
    value : ndarray, shape (2,)
        f_n in Hz and ζ.
    jacobian : ndarray, shape (2, 11 + 4 k)
    """
    at = pole_places(mode)
    omega, alpha = p[at]
    natural = np.hypot(omega, alpha)
    jacobian = np.zeros((2, len(p)))
    jacobian[0, at] = omega / natural / (2 * np.pi), alpha / natural / (2 * np.pi)
    jacobian[1, at] = -alpha * omega / natural**3, omega**2 / natural**3
    return np.array([natural / (2 * np.pi), alpha / natural]), jacobian


def pole_places(mode: int) -> list[int]:
    """Return where ω_d and α of a mode are; its two amplitudes follow them."""
    return [OMEGA, ALPHA] if mode == 0 else [PLACES + 4 * (mode - 1), PLACES + 4 * (mode - 1) + 1]
