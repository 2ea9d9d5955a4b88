"""Samples that no motion explains: Hampel's rule on what a local cubic leaves."""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from tagsway.filters.medians import median_filter
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
    """The samples that are left, and how they are judged."""

    time: FloatArray
    values: FloatArray
    half: int
    longest: float
    jump: FloatArray

    def residuals(self, index: IntArray, without: IntArray) -> FloatArray:
        """Return how far samples lie from a cubic through their neighbours, beyond what a motion explains.

        Parameters
        ----------
        index : ndarray, shape (s, w)
            Samples to judge; outside the record the answer is 0.
        without : ndarray, shape (s, 3)
            Samples that may not serve as neighbours, row by row; -1 for none.

        Returns
        -------
        ndarray, shape (s, w)
            |x - prediction| / √(1 + Σ weights²), less what one jump of the acceleration can make of it. 0 where the
            nearest neighbours are too far away to tell.
        """
        offsets = np.arange(-2 * self.half - 3, 2 * self.half + 4)
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
        span = np.where(judged, span, 1.0)
        near = np.take_along_axis(near, chosen, axis=-1)
        weights = _cubic_weights((self.time[near] - self.time[own][..., None]) / span[..., None], judged)
        left = self.values[own] - np.sum(weights * self.values[near], axis=-1)
        beyond = np.abs(left) / np.sqrt(1 + np.sum(weights**2, axis=-1)) - JUMP_GAIN * self.jump[own] * span**2
        return np.where(judged, np.maximum(beyond, 0.0), 0.0)


def _cubic_weights(offset: FloatArray, judged: BoolArray) -> FloatArray:
    """Return the weights with which a least-squares cubic predicts its value at offset 0."""
    powers = offset[..., None] ** np.arange(4)
    normal = np.swapaxes(powers, -1, -2) @ powers
    normal[~judged] = np.eye(4)
    first = np.linalg.solve(normal, np.broadcast_to(np.eye(4)[:, :1], (*normal.shape[:-1], 1)))
    return np.asarray((powers @ first)[..., 0])


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
    record = _Record(time=time, values=values, half=half, longest=longest, jump=np.zeros(len(time)))
    index = np.arange(len(time))[:, None]
    noise = record.residuals(index, np.full_like(index, -1))[:, 0]
    whole = np.clip(index[:, 0], min(SCALE_WIDTH, len(time)) // 2, len(time) - 1 - min(SCALE_WIDTH, len(time) - 1) // 2)
    noise = np.maximum(median_filter(noise, width=SCALE_WIDTH)[whole], np.median(noise))
    scale = np.maximum(MEDIAN_TO_STD * noise + 1e-12 * float(np.max(np.abs(values))), floor)
    record = replace(record, jump=_acceleration_jump(time, values, half))
    alone = record.residuals(index, np.full_like(index, -1))[:, 0]
    suspect = np.flatnonzero(alone > 3.0 * scale)
    around = suspect[:, None] + np.arange(-record.half - REACH, record.half + 1)
    return _choose_patterns(record, np.unique(np.clip(around, 0, len(time) - 1)), scale)


def _acceleration_jump(time: FloatArray, values: FloatArray, lag: int) -> FloatArray:
    """Return the range of the acceleration around each sample; a spike adds a tenth of itself to what it explains."""
    back, ahead = time[lag:-lag] - time[: -2 * lag], time[2 * lag :] - time[lag:-lag]
    slope = (values[2 * lag :] - values[lag:-lag]) / ahead - (values[lag:-lag] - values[: -2 * lag]) / back
    acceleration = np.pad(2 * slope / (back + ahead), lag, mode="edge")
    return np.asarray(maximum_filter1d(acceleration, 21) - minimum_filter1d(acceleration, 21))


def _choose_patterns(record: _Record, starts: IntArray, scale: FloatArray) -> IntArray:
    """Return the smallest sets of samples that are far off while their neighbours, without them, are quiet."""
    last = len(scale) - 1
    offsets = np.arange(-record.half, REACH + record.half + 1)
    taken = np.zeros(len(scale), dtype=bool)
    for size in (1, 2, 3):
        free = np.array([s for s in starts if not taken[max(s - record.half, 0) : s + REACH + 1].any()], dtype=np.int64)
        window_scale = scale[np.clip(free[:, None] + offsets, 0, last)]
        offers: list[tuple[float, int, tuple[int, ...]]] = []
        for pattern in (p for p in PATTERNS if len(p) == size):
            members = free[:, None] + np.array(pattern)
            score = record.residuals(free[:, None] + offsets, members) / window_scale
            member = np.isin(offsets, pattern)
            near = ~member & (offsets <= pattern[-1] + record.half)
            off, rest = score[:, member].min(axis=1), score[:, near].max(axis=1)
            good = (members[:, -1] <= last) & (off > THRESHOLD) & (rest < np.maximum(0.75 * THRESHOLD, 0.5 * off))
            offers += [(float(off[i] / (rest[i] + 1)), int(free[i]), pattern) for i in np.flatnonzero(good)]
        for _, start, pattern in sorted(offers, reverse=True):
            if not taken[max(start - record.half, 0) : start + pattern[-1] + record.half + 1].any():
                taken[start + np.array(pattern)] = True
    return np.flatnonzero(taken)
