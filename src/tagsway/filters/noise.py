"""How noisy a path is at each time, as its own smoothing shows it."""

import numpy as np

from tagsway.filters.spline import fit_smoothing_spline
from tagsway.model import FloatArray

NEIGHBOURS = 25
"""Samples whose residuals are pooled: an eighth of a second at 200 fps, 14 % of error in a standard deviation."""

CODEC_COLOUR = 1.6
"""Power density of a codec's noise at the frequencies of a motion, over that of white noise of the same variance: what
H.264 adds has an autocorrelation of 0.2 to 0.3 two frames apart."""

LARGEST_RESIDUAL_STD = 3.0
"""A residual counts as no more than this: one spike must not make its neighbours noisy."""


BEST_PERCENT = 2.0
"""Of a record's samples: so many are as sure as the images alone allow."""


def find_image_noise(std: FloatArray, *, share: float = 1.0) -> float:
    """Return the standard error that the images' own noise leaves, without a codec's share.

    Parameters
    ----------
    std : ndarray
        Stated standard errors of a whole record; what is not finite is left out.
    share : float
        Part of their variances that the images' own noise makes, as the tracker knows it.

    Returns
    -------
    float
        That of the best samples but the very best, times the root of that share; 0 where none is stated. What comes on
        top of it is a codec's, or a blur's.
    """
    stated = std[np.isfinite(std)]
    return float(np.sqrt(share) * np.percentile(stated, BEST_PERCENT)) if len(stated) else 0.0


def measure_noise(time_s: FloatArray, values: FloatArray, std: FloatArray) -> FloatArray:
    """Return the noise of each sample, from how far it and its neighbours lie off a smoothing spline.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Rising.
    values : ndarray, shape (n,)
        Samples of a path, NaN where there is none.
    std : ndarray, shape (n,)
        Their stated standard errors, the least that is returned; NaN where none is stated.

    Returns
    -------
    ndarray, shape (n,)
        NaN where there is no sample.

    Notes
    -----
    A compressed video is the reason: where nothing moves a block is copied and its noise is frozen, where a tag moves
    it is ten times as large, and the alignment of one image cannot see that. What exceeds the stated error is taken for
    a codec's, and counts for more because neighbouring frames share it. The residual of a sample that took part in
    the smoothing is too small by √(1 - h), h its leverage: the posterior's variance over the noise's.
    """
    spline = fit_smoothing_spline(time_s, values, std)
    used = np.isfinite(values) & np.isfinite(time_s)
    noise = spline.sample_std
    free = np.sqrt(np.maximum(1 - (spline.std(time_s[used]) / noise) ** 2, 0.05))
    scaled = np.abs(values[used] - spline(time_s[used])) / (noise * free)
    square = np.minimum(scaled, LARGEST_RESIDUAL_STD) ** 2
    window = np.ones(min(NEIGHBOURS, len(square)))
    local = np.sqrt(np.convolve(square, window, "same") / np.convolve(np.ones_like(square), window, "same"))
    measured = np.full(len(values), np.nan)
    shown = np.maximum(noise * local, 1e-3 * noise)
    stated = np.where(np.isfinite(std), std, shown.max(initial=0.0))[used] if np.isfinite(std).any() else shown
    excess = np.maximum(shown**2 - stated**2, 0.0)
    measured[used] = np.sqrt(np.maximum(shown**2, stated**2) + (CODEC_COLOUR - 1) * excess)
    return measured
