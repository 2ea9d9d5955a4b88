"""Running medians that know about ends and gaps."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tagsway.errors import InputError
from tagsway.model import FloatArray

CHUNK = 4096
"""Windows that are sorted together."""


def median_filter(values: FloatArray, *, width: int) -> FloatArray:
    """Return the running median of one or more channels.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        NaN where nothing was seen.
    width : int
        Samples in the window. An even window of 10 reaches 5 samples back and 4 ahead, the next one 4 and 5, and the
        mean of both medians is taken, so that nothing is shifted.

    Returns
    -------
    ndarray, shape (n, ...)
        NaN stays NaN, and is left out of its neighbours' medians. At the ends the window shrinks on both sides, so
        that it stays centred: a slope is not bent, and nothing is padded.

    Notes
    -----
    A median passes any monotone signal unchanged and removes every burst shorter than half its window; it flattens the
    peaks of an oscillation whose period is not many windows long.
    """
    if width < 1:
        raise InputError(f"a median filter needs a window of at least 1 sample, not {width}")
    half, count = width // 2, len(values)
    result = np.full(values.shape, np.nan)
    for back, ahead in ((half, half),) if width % 2 else ((half, half - 1), (half - 1, half)):
        for first in range(half, count - half, CHUNK):
            inner = result[first : min(first + CHUNK, count - half)]
            windows = sliding_window_view(values, back + ahead + 1, axis=0)[first - back :][: len(inner)]
            middle = _nan_median(windows)
            inner[...] = np.where(np.isnan(inner), middle, (inner + middle) / 2)
    for i in {*range(min(half, count)), *range(max(count - half, 0), count)}:
        reach = min(i, count - 1 - i)
        result[i] = _nan_median(np.moveaxis(values[i - reach : i + reach + 1], 0, -1))
    result[np.isnan(values)] = np.nan
    return result


def _nan_median(windows: FloatArray) -> FloatArray:
    """Return the median over the last axis without NaN, NaN where there is nothing else."""
    ordered = np.sort(windows, axis=-1)
    count = np.count_nonzero(~np.isnan(ordered), axis=-1)[..., None]
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, ordered.shape[-1] - 1)
    middle = np.take_along_axis(ordered, low, axis=-1) + np.take_along_axis(ordered, high, axis=-1)
    return np.asarray(middle[..., 0] / 2)
