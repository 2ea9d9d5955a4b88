"""The thesis' own way of estimating, to hold beside the fit: f_n, ζ of the decay, r = l, and the nearest positions."""

import numpy as np

from tagsway.model import GRAVITY_M_S2, FloatArray, ModalEstimate, PointMassFit
from tagsway.pendulum.model import Unknown, predict_angle
from tagsway.pendulum.record import Record

LENGTHS = 41
WIDEST = 0.4
"""Lengths are tried on both sides of the arc's radius, to this much in ln l, then more finely."""


def fit_positions(
    record: Record, start: FloatArray, modal: ModalEstimate, *, radius_m: float, mass_kg: float | None
) -> PointMassFit | None:
    """Return the point mass whose simulated positions come nearest to the measured ones.

    Parameters
    ----------
    record : Record
        The data.
    start : ndarray, shape (15,)
        The motion at the start, and where the pivot is; the camera is taken at its word.
    modal : ModalEstimate
        f_n and ζ.
    radius_m : float
        Of the arc, where the search begins.
    mass_kg : float or None
        For k and b.

    Returns
    -------
    PointMassFit or None
        None where the decay shows no frequency, or nothing comes near.

    Notes
    -----
    With ω_n and ζ given, k/J = ω_n² - g/l and b/J = 2 ζ ω_n; l alone is free. Its error on a level move is large, and
    where the payload is no point it is the method's: see `tagsway.pendulum.fit_pendulum` for what is known.
    """
    if modal.natural_frequency_hz is None:
        return None
    centre, reach = np.log(radius_m), WIDEST
    for _ in range(2):
        columns = np.repeat(start[:, None], LENGTHS, axis=1)
        columns[Unknown.LOG_FREQUENCY] = np.log(modal.natural_frequency_hz.value)
        columns[Unknown.DAMPING_RATIO] = 0.0 if modal.damping_ratio is None else modal.damping_ratio.value
        columns[Unknown.DRAG : Unknown.FRICTION + 1] = 0.0
        columns[Unknown.SCALE : Unknown.TILT + 1] = 0.0
        columns[Unknown.LOG_LENGTH] = columns[Unknown.LOG_RADIUS] = np.linspace(centre - reach, centre + reach, LENGTHS)
        miss = _misses(record, columns)
        rms = np.sqrt(np.nanmean(miss**2, axis=0))
        if not np.any(np.isfinite(rms)):
            return None
        best = int(np.nanargmin(rms))
        centre, reach = columns[Unknown.LOG_LENGTH, best], 2 * reach / (LENGTHS - 1)
    length = float(np.exp(centre))
    omega = 2 * np.pi * modal.natural_frequency_hz.value
    stiffness, damping = omega**2 - GRAVITY_M_S2 / length, 2 * float(columns[Unknown.DAMPING_RATIO, 0]) * omega
    return PointMassFit(
        length_m=length,
        stiffness_over_inertia_rad2_s2=stiffness,
        damping_over_inertia_rad_s=damping,
        stiffness_n_m_per_rad=None if mass_kg is None else stiffness * mass_kg * length**2,
        damping_n_m_s_per_rad=None if mass_kg is None else damping * mass_kg * length**2,
        rms_residual_m=float(rms[best]),
        max_residual_m=float(np.nanmax(miss[:, best])),
    )


def _misses(record: Record, columns: FloatArray) -> FloatArray:
    """Return the distances between measured and simulated sway, each laid on by its mean; shape (n, m)."""
    with np.errstate(all="ignore"):
        angle = predict_angle(record, columns)
    radius = np.exp(columns[Unknown.LOG_RADIUS])
    seen = np.all(np.isfinite(record.sway_m), axis=1)
    gap = record.sway_m[seen].T[:, :, None] - np.stack([radius * np.sin(angle[seen]), -radius * np.cos(angle[seen])])
    return np.asarray(np.hypot(*(gap - np.median(gap, axis=1, keepdims=True))))
