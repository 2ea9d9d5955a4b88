"""Third divided differences of a record: all that a smoothing spline's likelihood needs.

A path with random-walk acceleration, x''' = √q w with white noise w, has no proper density (position, velocity and
acceleration at the start are unknown), but its third divided differences d = Cᵀ x do: they are normal, of zero mean,
with covariance q R, and both C and R are banded. So the record's restricted likelihood, its smoothed values and their
errors all follow from banded matrices four diagonals wide, in O(n), and exactly, at any times.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from tagsway.model import FloatArray

ORDER = 3
"""Order of the differences: of the derivative that is white noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contrasts:
    """Divided differences of n samples, each scaled so that its weights have unit norm.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the samples, strictly increasing, in units of about one sample.
    weights : ndarray, shape (n - 3, 4)
        Row j holds the weights of the samples j .. j + 3 in the difference j.
    process : ndarray, shape (4, n - 3)
        R for unit intensity, in the upper form of `scipy.linalg.cholesky_banded`.
    """

    time: FloatArray
    weights: FloatArray
    process: FloatArray

    @classmethod
    def of(cls, time: FloatArray) -> Self:
        """Return the contrasts of samples at these times."""
        points = np.lib.stride_tricks.sliding_window_view(time, ORDER + 1)
        gaps = points[:, :, None] - points[:, None, :] + np.eye(ORDER + 1)
        weights = 1 / np.prod(gaps, axis=2)
        norm = np.linalg.norm(weights, axis=1)
        return cls(time=time, weights=weights / norm[:, None], process=_gram_bands(time, norm))

    def apply(self, values: FloatArray) -> FloatArray:
        """Return d = Cᵀ x of values of shape (n, ...)."""
        count = len(self.weights)
        shape = (count,) + (1,) * (values.ndim - 1)
        parts = [self.weights[:, k].reshape(shape) * values[k : k + count] for k in range(ORDER + 1)]
        return np.asarray(sum(parts))

    def spread(self, coefficients: FloatArray) -> FloatArray:
        """Return C γ of coefficients of shape (n - 3, ...): the transpose of `apply`."""
        count = len(self.weights)
        shape = (count,) + (1,) * (coefficients.ndim - 1)
        total = np.zeros((count + ORDER, *coefficients.shape[1:]))
        for k in range(ORDER + 1):
            total[k : k + count] += self.weights[:, k].reshape(shape) * coefficients
        return total

    def noise(self, variance: FloatArray) -> FloatArray:
        """Return the bands of Cᵀ diag(variance) C, in the form of `process`."""
        count = len(self.weights)
        bands = np.zeros((ORDER + 1, count))
        for lag in range(ORDER + 1):
            for k in range(ORDER + 1 - lag):
                product = self.weights[: count - lag, k + lag] * self.weights[lag:, k]
                bands[ORDER - lag, lag:] += product * variance[k + lag : k + count]
        return bands


def _gram_bands(time: FloatArray, norm: FloatArray) -> FloatArray:
    """Return R: the Peano kernels are quadratic B-splines, whose products Gauss' rule integrates exactly."""
    count = len(norm)
    steps = np.arange(1, ORDER + 1)
    knots = np.concatenate([time[0] - steps[::-1], time, time[-1] + steps])
    nodes, node_weights = np.polynomial.legendre.leggauss(ORDER)
    half = np.diff(time)[:, None] / 2
    points = (time[:-1, None] + half * (1 + nodes)).ravel()
    basis = BSpline.design_matrix(points, knots, ORDER - 1)[:, ORDER : ORDER + count]
    # A B-spline that sums to one integrates to (its support) / 3; the Peano kernel integrates to 1 / 3!.
    scale = 1 / (math.factorial(ORDER - 1) * (time[ORDER:] - time[:-ORDER]) * norm)
    gram = basis.T @ sparse.diags_array((half * node_weights).ravel()) @ basis
    bands = np.zeros((ORDER + 1, count))
    for lag in range(ORDER):
        bands[ORDER - lag, lag:] = gram.diagonal(lag) * scale[: count - lag] * scale[lag:]
    return bands
