"""The camera's own motion, seen on a tag that is fixed to the machine."""

from dataclasses import dataclass

import numpy as np

from tagsway.filters import find_spikes, fit_smoothing_spline
from tagsway.filters.spline import LEAST_SAMPLES
from tagsway.model import FloatArray, TagSightings


@dataclass(frozen=True, slots=True, kw_only=True)
class Shake:
    """How the picture was displaced in each frame; NaN where that is not known.

    Parameters
    ----------
    anchor_px : ndarray, shape (2,)
        Where the reference tag is on the whole, x right and y up.
    shift_px, shift_std_px : ndarray, shape (n, 2)
        The tag's displacement from there, x right and y up, and its standard error.
    turn_rad, turn_std_rad : ndarray, shape (n,)
        The picture's rotation, counter-clockwise, and its standard error.
    """

    anchor_px: FloatArray
    shift_px: FloatArray
    shift_std_px: FloatArray
    turn_rad: FloatArray
    turn_std_rad: FloatArray

    def remove(self, point_px: FloatArray, std_px: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points (x right, y up), shape (n, 2), as a still camera would have seen them, and their errors."""
        arm = point_px - self.anchor_px - self.shift_px
        cosine, sine = np.cos(self.turn_rad), np.sin(self.turn_rad)
        still = np.stack([cosine * arm[:, 0] + sine * arm[:, 1], cosine * arm[:, 1] - sine * arm[:, 0]], axis=1)
        turned = self.turn_std_rad[:, None] * np.abs(still[:, ::-1])
        return self.anchor_px + still, np.sqrt(std_px**2 + self.shift_std_px**2 + turned**2)


def measure_shake(time_s: FloatArray, reference: TagSightings) -> Shake | None:
    """Measure the camera's shake, in the image's plane: position and rotation; None where the tag was hardly seen.

    Notes
    -----
    Each channel is smoothed with the bandwidth that its own likelihood asks for, so that a still camera does not put
    the reference tag's noise into the others. Of what that leaves, the share that is no noise of the tag's is shake
    too: a camera that trembles faster than it takes images seems to jump from each to the next. A camera that is
    displaced sideways moves near tags more than far ones:
    the reference should hang at the depth of the motion.
    """
    if np.count_nonzero(np.isfinite(reference.centre_px[:, 0])) < LEAST_SAMPLES:
        return None
    upright = reference.centre_px * np.array([1.0, -1.0])
    variance = np.diagonal(reference.covariance_px2, axis1=1, axis2=2)
    angle = unwrap(reference.angle_rad)
    anchor, level = np.nanmedian(upright, axis=0), np.nanmedian(angle)
    channels = [
        (upright[:, 0] - anchor[0], np.sqrt(variance[:, 0])),
        (upright[:, 1] - anchor[1], np.sqrt(variance[:, 1])),
        (angle - level, reference.angle_std_rad),
    ]
    smooth, errors = zip(*(_smooth(time_s, values, std) for values, std in channels), strict=True)
    return Shake(
        anchor_px=anchor,
        shift_px=np.stack(smooth[:2], axis=1),
        shift_std_px=np.stack(errors[:2], axis=1),
        turn_rad=smooth[2],
        turn_std_rad=errors[2],
    )


def _smooth(time_s: FloatArray, values: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a channel's shake and its standard error: the posterior of a smooth path with jumps about it."""
    spikes = find_spikes(time_s, values, std=np.nan_to_num(std))
    kept = np.where(spikes, np.nan, values)
    spline = fit_smoothing_spline(time_s, kept, std)
    smooth = spline(time_s)
    noise = np.full(len(time_s), np.nan)
    noise[np.isin(time_s, spline.time_s)] = spline.sample_std
    jumps = np.nanmedian(np.maximum(noise**2 - std**2, 0.0))
    share = np.where(np.isfinite(noise + kept), jumps / (jumps + std**2), 0.0)
    left = np.where(share > 0, kept - smooth, 0.0)
    spread = np.where(share > 0, share * std**2, jumps)
    return smooth + share * left, np.sqrt(((1 - share) * spline.std(time_s)) ** 2 + spread)


def unwrap(angle_rad: FloatArray) -> FloatArray:
    """Return angles without jumps of a turn, shape (n,); NaN stays NaN, and a gap is crossed the short way."""
    result = np.array(angle_rad, dtype=float)
    seen = np.isfinite(result)
    result[seen] = np.unwrap(result[seen])
    return result
