"""A track without spikes, and its velocity and acceleration."""

from typing import Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.filters.medians import median_filter
from tagsway.filters.noise import measure_noise
from tagsway.filters.spikes import find_spikes
from tagsway.filters.spline import LEAST_SAMPLES, SmoothingSpline, fit_smoothing_spline
from tagsway.model import BoolArray, CleanTagTrack, CleanTrack, FloatArray, TagTrack, Track

BRIDGE_S = 0.1
"""A longer gap stays empty in a clean track: a fast payload may have turned round in it."""

POSITION_MEDIAN = 3
"""Samples in the median of the positions."""

DERIVATIVE_MEDIAN = 10
"""Samples in the medians of velocity and acceleration: the thesis' "10th-order median"."""


def clean_track(track: Track, *, method: Literal["spline", "median"] = "spline") -> CleanTrack:
    """Take the spikes off a track, and differentiate it.

    Parameters
    ----------
    track : Track
        Raw, NaN where a tag was not seen.
    method : {"spline", "median"}
        "spline": a smoothing spline on each axis, derivatives from it. "median": as in the thesis, medians of three
        positions, central differences, and medians of ten on velocity and acceleration.

    Returns
    -------
    CleanTrack
        At the times of the track. Gaps up to 0.1 s (or two frames) are bridged, longer ones stay NaN, as do the ends
        where a tag was not seen; a tag seen less than nine times is all NaN, with a bandwidth of 0.

    Notes
    -----
    For looking at a motion, its velocity and its peaks. A fit of a model takes the raw samples: whatever is smoothed
    here is correlated there.
    """
    if method not in ("spline", "median"):
        raise InputError(f"a track is cleaned by 'spline' or 'median', not by {method!r}")
    spikes = find_track_spikes(track.time_s, track.pcp)
    pcp = _clean_tag(track.time_s, track.pcp, spikes, method)
    count = np.count_nonzero(spikes)
    tcp = None
    if track.tcp is not None:
        spikes = find_track_spikes(track.time_s, track.tcp)
        tcp = _clean_tag(track.time_s, track.tcp, spikes, method)
        count += np.count_nonzero(spikes)
    return CleanTrack(time_s=track.time_s, pcp=pcp, tcp=tcp, method=method, spikes=int(count))


def find_track_spikes(time_s: FloatArray, tag: TagTrack) -> BoolArray:
    """Find the samples of a tag, shape (n,), that are a spike in x or in z: a bad sighting is bad in both."""
    noise = np.where(np.isfinite(tag.position_std), tag.position_std, 0.0)
    found = [find_spikes(time_s, tag.position[:, axis], std=noise[:, axis]) for axis in (0, 1)]
    return np.asarray(found[0] | found[1])


def fit_tag_splines(
    time_s: FloatArray, tag: TagTrack, spikes: BoolArray, *, moving: BoolArray | None = None
) -> tuple[SmoothingSpline, SmoothingSpline]:
    """Fit a smoothing spline to x and one to z, without the spikes; `InputError` where there are too few samples.

    Both have the larger of the bandwidths that the two axes ask for: it is one body, and what it does along the quieter
    axis is as quick. `moving`, shape (n,), says where the tag moves: then how rough its path is comes from there, and
    not from the rest before and after, which would make it look smoother and surer than it is.
    """
    return _fit_splines(time_s, tag, measure_tag_noise(time_s, tag, spikes), moving)


def _fit_splines(
    time_s: FloatArray, tag: TagTrack, noise: FloatArray, moving: BoolArray | None = None
) -> tuple[SmoothingSpline, SmoothingSpline]:
    position = np.where(np.isfinite(noise), tag.position, np.nan)
    channels = [(position[:, axis], noise[:, axis]) for axis in (0, 1)]
    if moving is None:
        x, z = (fit_smoothing_spline(time_s, *channel) for channel in channels)
        if x.bandwidth_hz > z.bandwidth_hz:
            return x, fit_smoothing_spline(time_s, *channels[1], bandwidth_hz=x.bandwidth_hz)
        return fit_smoothing_spline(time_s, *channels[0], bandwidth_hz=z.bandwidth_hz), z
    rough = [fit_smoothing_spline(time_s[moving], values[moving], std[moving]) for values, std in channels]
    intensity = max(spline.intensity for spline in rough)
    x, z = (fit_smoothing_spline(time_s, *channel, intensity=intensity) for channel in channels)
    return x, z


def measure_tag_noise(time_s: FloatArray, tag: TagTrack, spikes: BoolArray) -> FloatArray:
    """Return the noise of a tag's x and z at each sample, shape (n, 2), NaN at spikes and where it was not seen."""
    position = np.where(spikes[:, None], np.nan, tag.position)
    return np.column_stack([measure_noise(time_s, position[:, axis], tag.position_std[:, axis]) for axis in (0, 1)])


def _clean_tag(time_s: FloatArray, tag: TagTrack, spikes: BoolArray, method: str) -> CleanTagTrack:
    used = np.isfinite(tag.position).all(axis=1) & ~spikes
    motion = np.full((3, len(time_s), 2), np.nan)
    noise = np.full((len(time_s), 2), np.nan)
    bandwidth = 0.0
    if np.count_nonzero(used) >= LEAST_SAMPLES:
        known = _bridged(time_s, used)
        noise = measure_tag_noise(time_s, tag, ~used)
        if method == "spline":
            splines = _fit_splines(time_s, tag, noise)
            bandwidth = splines[0].bandwidth_hz
            motion = np.stack([[spline(time_s, order) for spline in splines] for order in range(3)]).swapaxes(1, 2)
        else:
            bandwidth = 1 / (2 * DERIVATIVE_MEDIAN * float(np.median(np.diff(time_s[used]))))
            motion = _differentiate_medians(time_s, tag.position, used)
        motion[:, ~known] = np.nan
    position, velocity, acceleration = motion
    return CleanTagTrack(
        position=position, velocity=velocity, acceleration=acceleration, bandwidth_hz=bandwidth, sample_std=noise
    )


def _bridged(time_s: FloatArray, used: BoolArray) -> BoolArray:
    """Return where there is a sample, or a short gap between two."""
    index = np.flatnonzero(used)
    longest = max(BRIDGE_S, 2.5 * float(np.median(np.diff(time_s[index]))))
    after = np.searchsorted(index, np.arange(len(used)))
    inside = (after > 0) & (after < len(index))
    right = index[np.clip(after, 1, len(index) - 1)]
    left = index[np.clip(after, 1, len(index) - 1) - 1]
    return np.asarray(used | (inside & (time_s[right] - time_s[left] <= longest)))


def _differentiate_medians(time_s: FloatArray, position: FloatArray, used: BoolArray) -> FloatArray:
    """Return positions, velocities and accelerations, shape (3, n, 2), by medians and central differences."""
    time = time_s[used]
    smooth = median_filter(position[used], width=POSITION_MEDIAN)
    velocity = median_filter(np.gradient(smooth, time, axis=0), width=DERIVATIVE_MEDIAN)
    acceleration = median_filter(np.gradient(velocity, time, axis=0), width=DERIVATIVE_MEDIAN)
    motion = np.stack([smooth, velocity, acceleration])
    columns = [[np.interp(time_s, time, motion[order, :, axis]) for axis in (0, 1)] for order in range(3)]
    return np.asarray(columns).swapaxes(1, 2)
