"""Where the fit starts, and whether there is anything to fit."""

import numpy as np

from tagsway.modal.decay import COSINE, SINE
from tagsway.modal.least_squares import Samples, fit_linear_part
from tagsway.modal.noise import grid_places
from tagsway.modal.pencil import find_pole
from tagsway.modal.spectrum import find_peaks_of, find_spectrum
from tagsway.modal.sway import remove_spikes
from tagsway.model import FloatArray


def find_start(samples: Samples) -> tuple[FloatArray, float] | None:
    """Return parameters near the best plain decay and the scale of what they leave.

    Parameters
    ----------
    samples : Samples
        Of the window; gaps, uneven times and spikes allowed.

    Returns
    -------
    parameters : ndarray, shape (8,)
    scale : float
        None where there are fewer than 8 samples or they do not vary.

    Notes
    -----
    Candidates are the matrix pencil's pole on the longest piece without a gap and the highest peaks of the padded
    spectrum with a few dampings; the one that leaves the least is taken.
    """
    value = remove_spikes(samples.value)
    time = samples.time_s
    if len(time) < 8 or not float(np.ptp(value)) > 0:
        return None
    span = float(time[-1] - time[0])
    curve = find_spectrum(time, value)
    tops = find_peaks_of(curve, lowest_hz=0.8 / span, count=3)
    candidates = [(2 * np.pi * f, k / span) for f in tops for k in (0.1, 1.0, 3.0)]
    if tops:
        pole = _pole_of_longest_piece(time, value, tops[0])
        if pole is not None:
            candidates.append((pole.imag, -pole.real))
    best: tuple[FloatArray, float] | None = None
    for omega, alpha in candidates:
        if not 0.5 * 2 * np.pi / span < omega:
            continue
        p, scale = fit_linear_part(samples, omega, alpha)
        if best is None or scale < best[1]:
            best = p, scale
    if best is None or not np.hypot(best[0][COSINE], best[0][SINE]) > 0:
        return None
    return best[0], max(best[1], 1e-9 * float(np.ptp(value)))


def _pole_of_longest_piece(time_s: FloatArray, value: FloatArray, near_hz: float) -> complex | None:
    place = grid_places(time_s)
    breaks = np.flatnonzero(np.diff(place) > 1) + 1
    pieces = np.split(np.arange(len(place)), breaks)
    piece = max(pieces, key=len)
    step = float((time_s[-1] - time_s[0]) / max(int(place[-1]), 1))
    # Averages over a 24th to an 8th of a period, at most 300: the pencil's cost grows with the cube of their number.
    period = 1 / (near_hz * step)
    block = max(1, int(period / 24), min(len(piece) // 300, int(period / 8)))
    count = min(len(piece) // block, 300)
    means = value[piece[: count * block]].reshape(count, block).mean(axis=1)
    return find_pole(means, block * step)
