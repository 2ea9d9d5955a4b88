"""A rolling shutter: each row of an image has a time of its own."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import InputError
from tagsway.filters import SmoothingSpline, find_spikes, fit_smoothing_spline
from tagsway.filters.spline import LEAST_SAMPLES
from tagsway.model import FloatArray, Sightings, TagSightings

_LONGEST_READOUT = 1.05
"""In periods of the frame: no sensor reads an image for longer than that."""


def correct_shutter(sightings: Sightings, *, readout_s: float, turns: int = 0) -> Sightings:
    """Return where the tags were at the frames' own times, though their rows were exposed earlier or later.

    Parameters
    ----------
    sightings : Sightings
        As the camera saw them: with the lens' distortion, which does not change a pixel's row.
    readout_s : float
        From the first row's exposure to the last one's; 0 for a global shutter.
    turns : int
        Quarter turns, counter-clockwise, that took the sensor's image to the upright one.

    Returns
    -------
    Sightings
        Centres, corners and angles of every frame at the time of the sensor's middle row. A tag with too few sightings
        to tell its speed is left as it is.

    Raises
    ------
    InputError
        Where the readout takes longer than a frame.

    Notes
    -----
    A point in the sensor's row r of H was seen at τ = t + d, d = readout (r / (H - 1) - 1/2). A smoothing spline s
    through the positions at their times τ gives p - (s(τ) - s(t)): the measured noise stays as it is, and only the way
    between the two times comes from the spline. Its error, that of the speed times d, is far below the noise: it is
    not added to the covariance. Corners move as the centre does. That a tag is also sheared and stretched while its
    own rows are read (by speed times readout / H) is not undone in the alignment; the centre does not depend on it.

    References
    ----------
    .. [1] C.-K. Liang, L.-W. Chang and H. H. Chen, IEEE Trans. Image Process. 17 (2008) 1323-1330: the rows' times.
    """
    if readout_s == 0 or len(sightings.time_s) < LEAST_SAMPLES:
        return sightings
    period_s = float(np.median(np.diff(sightings.time_s)))
    if not 0 <= readout_s <= _LONGEST_READOUT * period_s:
        raise InputError(
            f"the camera's readout_s is {readout_s:g}: expected between 0 and the {period_s:.4g} s from frame to frame"
        )
    rows = _Rows(readout_s=readout_s, turns=turns % 4, width=sightings.video.width, height=sightings.video.height)
    tags = tuple(_correct_tag(tag, sightings.time_s, rows) for tag in sightings.tags)
    return replace(sightings, tags=tags)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """When a pixel is exposed."""

    readout_s: float
    turns: int
    width: int
    height: int

    def delay_s(self, point_px: FloatArray) -> FloatArray:
        """Return how long after the middle row points were seen, shape (...)."""
        last = self.height - 1 if self.turns % 2 == 0 else self.width - 1
        along = point_px[..., 1] if self.turns % 2 == 0 else point_px[..., 0]
        share = along / last - 0.5
        return np.asarray(self.readout_s * (share if self.turns < 2 else -share))


def _correct_tag(tag: TagSightings, time_s: FloatArray, rows: _Rows) -> TagSightings:
    delay = rows.delay_s(tag.centre_px)
    seen_s = time_s + delay
    std = np.sqrt(np.diagonal(tag.covariance_px2, axis1=1, axis2=2))
    turn = np.full(len(time_s), np.nan)
    turn[tag.seen] = np.unwrap(tag.angle_rad[tag.seen])
    right, down, angle = (
        _fit(seen_s, values, noise)
        for values, noise in (
            (tag.centre_px[:, 0], std[:, 0]),
            (tag.centre_px[:, 1], std[:, 1]),
            (turn, tag.angle_std_rad),
        )
    )
    if right is None or down is None or angle is None:
        return tag

    def travel(delay_s: FloatArray) -> FloatArray:
        time = time_s.reshape(-1, *(1,) * (delay_s.ndim - 1))
        return np.stack([_travel(spline, time, delay_s) for spline in (right, down)], axis=-1)

    turned = tag.angle_rad - _travel(angle, time_s, delay)
    return replace(
        tag,
        centre_px=tag.centre_px - travel(delay),
        corners_px=tag.corners_px - travel(rows.delay_s(tag.corners_px)),
        angle_rad=np.angle(np.exp(1j * turned)),
    )


def _fit(time_s: FloatArray, values: FloatArray, std: FloatArray) -> SmoothingSpline | None:
    """Return the smooth path, without spikes; None where there are too few samples."""
    # Beside frames that follow each other too closely the order of two rows can turn: the second is left out.
    rising = np.isfinite(values) & np.isfinite(time_s)
    latest = np.maximum.accumulate(np.where(rising, time_s, -np.inf))
    rising[1:] &= time_s[1:] > latest[:-1]
    time, path, noise = time_s[rising], values[rising], std[rising]
    kept = ~find_spikes(time, path, std=noise)
    if np.count_nonzero(kept) < LEAST_SAMPLES:
        return None
    return fit_smoothing_spline(time[kept], path[kept], noise[kept])


def _travel(spline: SmoothingSpline, time_s: FloatArray, delay_s: FloatArray) -> FloatArray:
    """Return how far the path leads in the delay; beyond its ends a parabola continues it."""
    start, end = spline.time_s[0], spline.time_s[-1]

    def place(time: FloatArray) -> FloatArray:
        inside = np.clip(time, start, end)
        ahead = time - inside
        return spline(inside) + ahead * (spline(inside, 1) + ahead / 2 * spline(inside, 2))

    return place(time_s + delay_s) - place(time_s)
