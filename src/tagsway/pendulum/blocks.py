"""How far a fit's parameters scatter if its residuals came in another order: the block bootstrap, in one step."""

import numpy as np

from tagsway.model import FloatArray

LEAST_BLOCKS = 4
"""A record of fewer periods is cut into this many blocks."""


def block_covariance(jacobian: FloatArray, residual: FloatArray, *, block: int) -> FloatArray:
    """Return the covariance of Jᵀ r* over all records that residuals make whose blocks are drawn at random.

    Parameters
    ----------
    jacobian : ndarray, shape (channels, n, m)
        Slopes of the whitened samples; zero where there is none.
    residual : ndarray, shape (channels, n)
        Whitened, zero where there is none.
    block : int
        Samples of a block: about a period, so that what is coloured stays so.

    Returns
    -------
    ndarray, shape (m, m)

    Notes
    -----
    The circular block bootstrap [1]_ of a fit that is linear in its residuals. A block of the new record is any of the
    n stretches of the old one, each as likely as the next, independent of the other blocks: its mean over the draws is
    a mean over shifts, a correlation, and no draw is needed.

    References
    ----------
    .. [1] D. N. Politis and J. P. Romano, in Exploring the Limits of Bootstrap (1992) 263-270.
    """
    channels, count, width = jacobian.shape
    block = max(1, min(block, count // LEAST_BLOCKS))
    spectrum = np.fft.rfft(residual, axis=1)[:, :, None]
    total = np.zeros((width, width))
    for start in range(0, count, block):
        part = np.zeros((channels, count, width))
        part[:, start : start + block] = jacobian[:, start : start + block]
        shifted = np.sum(spectrum * np.conj(np.fft.rfft(part, axis=1)), axis=0)
        total += np.cov(np.fft.irfft(shifted, count, axis=0), rowvar=False, bias=True)
    # Where samples are missing the old record is emptier than the new: each shift finds a residual less often.
    present = np.mean(np.any(jacobian != 0, axis=2))
    return total / max(float(present), 1e-3)
