"""Sway out of the plane, from the tag's apparent size."""

import numpy as np

from tagsway.model import FloatArray, Notice, TagSightings
from tagsway.tracks.scale import side_lengths

LIMIT = 0.1
"""Out-of-plane over in-plane sway above which it is reported."""

SURE = 3.0
"""Standard errors by which the limit must be passed."""

LEAST_SAMPLES = 50
"""Below this many frames a band of frequencies is too few numbers."""

MOST_SAMPLES = 4000
"""Frames of a long record that are looked at: those with the most sway."""

LEAST_SWAY = 5.0
"""In-plane sway over its standard error below which there is no sway to compare with."""


def find_depth_sway(
    time_s: FloatArray,
    sway_px: FloatArray,
    pcp: TagSightings,
    tcp: TagSightings | None,
    *,
    focal_px: float,
    known: bool,
) -> Notice | None:
    """Report a sway towards the camera and away that exceeds a tenth of the one in the plane.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the frames.
    sway_px : ndarray, shape (n, 2)
        PCP minus TCP in the PCP's plane, in its pixels.
    pcp, tcp : TagSightings
        Their apparent sizes; the tool's divides out what the whole picture does (a move that is not square to the
        camera's axis).
    focal_px : float
        Focal length in pixels.
    known : bool
        Whether it comes from a calibration.

    Returns
    -------
    Notice or None
        None where there is none, or none that the noise could not have made (three standard errors).

    Notes
    -----
    Apparent size s is as 1/Z, so δZ = -Z δs/s, and with Z = f × scale, depth in the PCP's pixels is -f δ(ln s). In a
    band around the sway's own frequency the power of depth and of position are compared, each less the power of its
    noise. Of the tag's two directions the less foreshortened one is measured: a payload that swings towards the camera
    also nods, which shortens the other. A sway in the plane seen by a camera that is turned away from it looks alike.
    """
    size = np.log(_longer_side(pcp))
    if tcp is not None:
        size = size - np.log(_longer_side(tcp))
    seen = np.isfinite(size) & np.isfinite(sway_px).all(axis=1)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return None
    channels = np.column_stack([sway_px, -focal_px * size])[seen]
    time, channels = _liveliest_part(time_s[seen], channels)
    band = _sway_band(time, channels[:, :2])
    if band is None:
        return None
    power, error = _band_power(time, channels, band)
    plane, depth = float(power[0] + power[1]), float(power[2])
    if not (plane > 0 and plane > LEAST_SWAY * float(np.hypot(error[0], error[1]))):
        return None
    if not depth - SURE * float(error[2]) > LIMIT**2 * plane:
        return None
    assumed = "" if known else f" (for a focal length of about {focal_px:.0f} px, assumed)"
    return Notice(
        code="out_of_plane",
        message=f"the product sways towards the camera and away, by {100 * np.sqrt(depth / plane):.0f} % of its sway "
        f"in the picture{assumed}: the measured swing is a projection, and its damping may beat; set the camera "
        "square to the motion, or release the product without a sideways push",
    )


def _liveliest_part(time: FloatArray, channels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return that part of a long record in which the sway in the plane is the largest."""
    starts = range(0, max(len(time) - MOST_SAMPLES // 2, 1), MOST_SAMPLES)
    best = max(starts, key=lambda i: float(np.var(channels[i : i + MOST_SAMPLES, :2], axis=0).sum()))
    return time[best : best + MOST_SAMPLES], channels[best : best + MOST_SAMPLES]


def _longer_side(tag: TagSightings) -> FloatArray:
    sides = side_lengths(tag)
    typical = np.nanmedian(sides, axis=0) if np.isfinite(sides).any() else np.zeros(2)
    return sides[:, int(np.argmax(typical))]


def _harmonics(time: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return cosines and sines with so many cycles over the record, shape (n, 2 k)."""
    phase = 2 * np.pi * np.outer((time - time[0]) / (time[-1] - time[0]), cycles)
    return np.hstack([np.cos(phase), np.sin(phase)])


def _drift(time: FloatArray) -> FloatArray:
    """Return the columns of a cubic over the record."""
    return np.polynomial.legendre.legvander(2 * (time - time[0]) / (time[-1] - time[0]) - 1, 3)


def _sway_band(time: FloatArray, sway: FloatArray) -> FloatArray | None:
    """Return the numbers of cycles around the sway's strongest frequency; None for a record too short to tell."""
    drift = _drift(time)
    left = sway - drift @ np.linalg.lstsq(drift, sway, rcond=None)[0]
    cycles = np.arange(3, min(len(time) // 4, 400))
    if not len(cycles):
        return None
    basis = _harmonics(time, cycles.astype(float))
    power = np.sum((basis.T @ left) ** 2, axis=1).reshape(2, -1).sum(axis=0)
    centre = int(cycles[int(np.argmax(power))])
    return np.arange(max(int(0.7 * centre), 1), int(np.ceil(1.4 * centre)) + 1, dtype=float)


def _band_power(time: FloatArray, channels: FloatArray, band: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each channel's mean square in the band, less its noise's, and the standard error of that."""
    drift = _drift(time)
    columns = _harmonics(time, band)
    columns = columns - drift @ np.linalg.lstsq(drift, columns, rcond=None)[0]
    left = channels - drift @ np.linalg.lstsq(drift, channels, rcond=None)[0]
    fitted = columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    count, used = len(time), columns.shape[1]
    noise = np.sum((left - fitted) ** 2, axis=0) / max(count - used - drift.shape[1], 1)
    share = noise * used / count
    signal = np.mean(fitted**2, axis=0) - share
    # A noise power of `used` squared normals has relative variance 2 / used; the cross term with the signal adds to it.
    error = np.sqrt(2 * share**2 / used + 4 * np.maximum(signal, 0.0) * noise / count)
    return signal, error
