"""Samples that no motion explains: Hampel's rule on what a local cubic leaves."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from tagsway.model import BoolArray, FloatArray, IntArray

THRESHOLD = 4.2
"""In robust standard deviations: one good sample in 40,000 lies beyond it."""

HALVES = (4, 2)
"""Neighbours on each side: many where the noise is what counts, few where the motion is."""

MEDIAN_TO_STD = 1.482602218505602
"""From the median of a normal deviate's magnitude to its standard deviation."""

JUMP_GAIN = 0.024
"""A jump of the acceleration by J moves a residual by at most this times J (neighbours' farthest distance)²; found by
moving the jump through every neighbourhood, whole, thinned and one-sided."""

SCALE_WIDTH = 81
"""Samples over which the noise is taken as constant."""

REACH = 4
"""A spike's whole pattern (up to three samples) lies within this many samples of its first."""

PATTERNS = tuple((0, *later) for size in (0, 1, 2) for later in itertools.combinations(range(1, REACH + 1), size))

ROUNDS = 8
"""Each takes away spikes that hid others; more have not been seen to help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Record:
    """The samples that are left, and how they are judged: by so many neighbours on each side, none too far away."""

    time: FloatArray
    values: FloatArray
    half: int
    longest: float

    def deviations(self, index: IntArray, without: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return how far samples lie from a cubic through their neighbours, and how much a jump adds to that.

        Parameters
        ----------
        index : ndarray, shape (s, w)
            Samples to judge; outside the record both answers are 0.
        without : ndarray, shape (s, e)
            Samples that may not serve as neighbours, row by row.

        Returns
        -------
        deviation : ndarray, shape (s, w)
            |x - prediction| / √(1 + Σ weights²). 0 where the nearest neighbours are too far away to tell.
        gain : ndarray, shape (s, w)
            The most that a jump of the acceleration by 1 makes of it.
        """
        reach = 2 * self.half + without.shape[1]
        offsets = np.arange(-reach, reach + 1)
        near = index[..., None] + offsets[offsets != 0]
        inside = (near >= 0) & (near < len(self.time))
        for column in range(without.shape[1]):
            inside &= near != without[:, column, None, None]
        judged = (index >= 0) & (index < len(self.time))
        own = np.clip(index, 0, len(self.time) - 1)
        near = np.clip(near, 0, len(self.time) - 1)
        away = np.where(inside, np.abs(self.time[near] - self.time[own][..., None]), np.inf)
        chosen = np.argpartition(away, 2 * self.half - 1, axis=-1)[..., : 2 * self.half]
        span = np.take_along_axis(away, chosen, axis=-1).max(axis=-1)
        judged &= span <= self.longest
        near = np.take_along_axis(near, chosen, axis=-1)
        offset = (self.time[near] - self.time[own][..., None]) / np.where(judged, span, 1.0)[..., None]
        weights = _cubic_weights(np.where(judged[..., None], offset, np.linspace(-1, 1, 2 * self.half)))
        left = self.values[own] - np.einsum("...j,...j->...", weights, self.values[near])
        deviation = np.abs(left) / np.sqrt(1 + np.einsum("...j,...j->...", weights, weights))
        return np.where(judged, deviation, 0.0), np.where(judged, JUMP_GAIN * span**2, 0.0)


def _cubic_weights(offset: FloatArray) -> FloatArray:
    """Return the weights with which a least-squares cubic through offsets predicts its value at offset 0.

    Σ P(0) P(offset) / |P|² over the polynomials P that are orthogonal on the offsets, made one from the last two.
    """
    here, there = np.ones((*offset.shape[:-1], 1)), np.ones_like(offset)
    here_before, there_before = np.zeros_like(here), np.zeros_like(offset)
    weights, norm_before = np.zeros_like(offset), np.ones_like(here)
    for _ in range(4):
        square = there**2
        norm = np.einsum("...j->...", square)[..., None]
        weights += here / norm * there
        centre = np.einsum("...j,...j->...", square, offset)[..., None] / norm
        ratio = norm / norm_before
        there, there_before = (offset - centre) * there - ratio * there_before, there
        here, here_before = -centre * here - ratio * here_before, here
        norm_before = norm
    return weights


def find_spikes(time_s: FloatArray, values: FloatArray, *, std: FloatArray | float = 0.0) -> BoolArray:
    """Find samples that lie off a smooth motion while their neighbours do not.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, at any distances.
    values : ndarray, shape (n,)
        One channel; NaN where nothing was seen.
    std : ndarray, shape (n,), or float
        The least noise to reckon with, in the values' unit.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for a spike. Never where nothing was seen.

    Notes
    -----
    Hampel's rule (a sample more than 4.2 robust standard deviations off the local median is an outlier [1]_) with the
    median of the values replaced by a cubic through the neighbours, so that a fast motion is not taken for noise; the
    scale is the median magnitude of such residuals over 81 samples, never less than the record's own. What a jump
    between the accelerations seen around a sample explains is no spike: on a hard move, spikes must be larger to be
    found, the more so the slower the camera. Every set of one to three samples within five is tried; the smallest is
    taken that is far off while all around it is quiet without it.

    Not for more than three bad samples in a row: those are a wrong detection, which the tracker should refuse.

    References
    ----------
    .. [1] F. R. Hampel, J. Am. Stat. Assoc. 69 (1974) 383-393.
    """
    spikes = np.zeros(len(values), dtype=bool)
    floor = np.broadcast_to(np.nan_to_num(np.asarray(std, dtype=float)), spikes.shape)
    for _ in range(ROUNDS):
        before = np.count_nonzero(spikes)
        for half in HALVES:
            left = np.flatnonzero(np.isfinite(values) & ~spikes)
            if len(left) > 4 * HALVES[0]:
                spikes[left[_find_once(time_s[left], values[left], floor[left], half)]] = True
        if np.count_nonzero(spikes) == before:
            break
    return spikes


def _find_once(time: FloatArray, values: FloatArray, floor: FloatArray, half: int) -> IntArray:
    """Return the spikes that stand clear of each other, judged by so many neighbours on each side."""
    longest = 6 * half * float(np.median(np.diff(time)))
    record = _Record(time=time, values=values, half=half, longest=longest)
    index = np.arange(len(time))
    none = np.empty((len(time), 0), dtype=np.int64)
    deviation, gain = (part[:, 0] for part in record.deviations(index[:, None], none))
    width = min(SCALE_WIDTH, len(time) - 1 + len(time) % 2)
    whole = np.clip(index, width // 2, len(time) - 1 - width // 2)
    noise = np.maximum(median_filter(deviation, width)[whole], np.median(deviation))
    scale = np.maximum(MEDIAN_TO_STD * noise + 1e-12 * float(np.max(np.abs(values))), floor)
    jump = _acceleration_jump(time, values, half)
    suspect = np.flatnonzero(deviation - gain * jump > 3.0 * scale)
    around = suspect[:, None] + np.arange(-half - REACH, half + 1)
    return _choose_patterns(record, np.unique(np.clip(around, 0, len(time) - 1)), scale, jump)


def _acceleration_jump(time: FloatArray, values: FloatArray, lag: int) -> FloatArray:
    """Return the range of the acceleration around each sample; a spike adds a tenth of itself to what it explains."""
    back, ahead = time[lag:-lag] - time[: -2 * lag], time[2 * lag :] - time[lag:-lag]
    slope = (values[2 * lag :] - values[lag:-lag]) / ahead - (values[lag:-lag] - values[: -2 * lag]) / back
    acceleration = np.pad(2 * slope / (back + ahead), lag, mode="edge")
    return np.asarray(maximum_filter1d(acceleration, 21) - minimum_filter1d(acceleration, 21))


def _choose_patterns(record: _Record, starts: IntArray, scale: FloatArray, jump: FloatArray) -> IntArray:
    """Return the smallest sets of samples that are far off while their neighbours, without them, are quiet."""
    last = len(scale) - 1
    offsets = np.arange(-record.half, REACH + record.half + 1)
    taken = np.zeros(len(scale), dtype=bool)
    for size in (1, 2, 3):
        free = np.array([s for s in starts if not taken[max(s - record.half, 0) : s + REACH + 1].any()], dtype=np.int64)
        window = np.clip(free[:, None] + offsets, 0, last)
        offers: list[tuple[float, int, tuple[int, ...]]] = []
        for pattern in (p for p in PATTERNS if len(p) == size):
            members = free[:, None] + np.array(pattern)
            deviation, gain = record.deviations(free[:, None] + offsets, members)
            score = np.maximum(deviation - gain * jump[window], 0.0) / scale[window]
            member = np.isin(offsets, pattern)
            near = ~member & (offsets <= pattern[-1] + record.half)
            off, rest = score[:, member].min(axis=1), score[:, near].max(axis=1)
            good = (members[:, -1] <= last) & (off > THRESHOLD) & (rest < np.maximum(0.75 * THRESHOLD, 0.5 * off))
            offers += [(float(off[i] / (rest[i] + 1)), int(free[i]), pattern) for i in np.flatnonzero(good)]
        for _, start, pattern in sorted(offers, reverse=True):
            if not taken[max(start - record.half, 0) : start + pattern[-1] + record.half + 1].any():
                taken[start + np.array(pattern)] = True
    return np.flatnonzero(taken)
