"""The matrix pencil: poles straight from the samples, without a start value."""

import numpy as np
from scipy.linalg import eigh

from tagsway.model import FloatArray


def find_pole(samples: FloatArray, step_s: float, *, order: int = 3) -> complex | None:
    """Return the strongest oscillating pole of evenly spaced samples.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Without gaps; any unit.
    step_s : float
        Time between two samples.
    order : int
        Number of poles: 2 for each mode and 1 for the offset.

    Returns
    -------
    complex or None
        s = -α + i ω_d in 1/s; None where no pole oscillates or there are fewer than 8 samples.

    Notes
    -----
    The signal subspace of the Hankel matrix is shift-invariant; the shift is solved by total least squares [1]_.
    Within 15 % of the Cramér-Rao bound on a clean decay, but helpless against spikes and gaps: it starts a fit, it does
    not replace one.

    References
    ----------
    .. [1] Y. Hua and T. K. Sarkar, IEEE Trans. ASSP 38 (1990) 814-824.
    """
    n = len(samples)
    if n < 8:
        return None
    length = max(order + 1, n // 3)
    hankel = np.lib.stride_tricks.sliding_window_view(samples - np.mean(samples), length + 1)
    _, vectors = eigh(hankel.T @ hankel, subset_by_index=[length + 1 - order, length])
    both = np.hstack([vectors[:-1], vectors[1:]])
    _, _, right = np.linalg.svd(both, full_matrices=False)
    v12, v22 = right[order:, :order].T, right[order:, order:].T
    poles = np.linalg.eigvals(-v12 @ np.linalg.pinv(v22))
    poles = poles[(np.imag(poles) > 1e-9) & (np.abs(poles) > 1e-3)]
    if poles.size == 0:
        return None
    steps = np.arange(n)[:, None]
    basis = np.exp(np.log(poles)[None, :] * steps)
    columns = np.hstack([basis.real, basis.imag, np.ones((n, 1))])
    weights = np.linalg.lstsq(columns, samples, rcond=None)[0]
    k = len(poles)
    energy = [np.sum((columns[:, [i, k + i]] @ weights[[i, k + i]]) ** 2) for i in range(k)]
    return complex(np.log(poles[int(np.argmax(energy))]) / step_s)
