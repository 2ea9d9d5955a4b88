"""A smoothing spline that chooses its own bandwidth and knows its errors."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PPoly, make_interp_spline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from tagsway.errors import InputError
from tagsway.filters.contrasts import ORDER, Contrasts
from tagsway.model import FloatArray

LEAST_SAMPLES = 9
"""Below this many samples there is nothing to choose a bandwidth from."""

LONGEST_MEMORY = 100.0
"""Smoothing time constant, in samples, beyond which the banded system loses digits and nothing is gained."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothingSpline:
    """Posterior of a path with random-walk acceleration, given noisy samples of it.

    Parameters
    ----------
    contrasts : Contrasts
        Of the samples that were used, in units of `step_s`.
    step_s : float
        Median distance of the samples.
    sample_std : ndarray, shape (n,)
        Standard deviation of the noise of each sample used, in the unit of the values.
    intensity : float
        q in x''' = √q w: in the values' unit squared, over `step_s`⁵.
    mean : BSpline
        The posterior's mean over (t - start_s) / step_s: a natural quintic spline.
    start_s : float
        Time of the first sample used.
    bandwidth_hz : float
        Where the smoothing halves an oscillation's amplitude; it falls as 1 / (1 + (f / bandwidth)⁶).

    Notes
    -----
    Outside the samples everything is NaN: a path is not guessed where it was not seen. Inside a gap the mean is the
    spline's, and the standard error says what that is worth.
    """

    contrasts: Contrasts
    step_s: float
    sample_std: FloatArray
    intensity: float
    mean: BSpline
    start_s: float
    bandwidth_hz: float

    @property
    def noise_std(self) -> float:
        """Standard deviation of a typical sample's noise, as it was estimated."""
        return float(np.median(self.sample_std))
