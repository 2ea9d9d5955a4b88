"""A tag's motion out of the picture's plane: its distance, its yaw and its pitch, from the shape of its image.

With A the affine part of the tag's image about its centre, A Aᵀ does not depend on the tag's rotation in the plane. Its
two diagonal elements say how large the tag looks across and along the picture, the third how it is sheared, and how
much larger one side looks than the opposite one gives the slope of its plane. For a motion in one plane all five are
smooth functions of the place in the image alone, whatever the camera's tilt and lens: the tool's tag, which moves in a
parallel plane and does not sway, shows them.
"""

import math
from dataclasses import dataclass

import numpy as np

from tagsway.model import BoolArray, FloatArray, TagSightings

CHANNELS = 5
"""Size across and along, shear, slope across and along."""

LEAST_SAMPLES = 50
"""Frames below which a tag's looks are not compared with its place."""

MOST_SAMPLES = 4000
"""Frames of the tool's tag that are looked at, spread evenly."""

LEAST_TURN_RAD = 0.002
"""Yaw and nod that any product is granted."""

FRAMES_PER_SAMPLE = 10
"""Neighbouring frames share their error (a codec predicts each from the last): so many count as one."""

LEAST_WAY_PX = 3.0
"""Way of the tool's tag below which it shows nothing of what a place does: a codec makes it wander by as little."""

LEAST_SPREAD = 1e-4
"""Misfit that any tag's looks are granted: a codec repeats a tag at rest, which is no proof of having no noise."""

PLACE_STD = np.array([[0.2, 0.2, 0.3, 0.3, 0.3]] * 3 + [[0.6] * 5] * 2)
"""How each channel may depend on x, y, x², x y and y², in units of the focal length: 5° of tilt, k1 of ±0.1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """The motion out of the plane, frame by frame; NaN where the tag was not seen.

    Parameters
    ----------
    depth_px : ndarray, shape (n,)
        Distance from the camera about its mean, in the tag's own pixels (× its scale: a length).
    yaw_rad, pitch_rad : ndarray, shape (n,)
        Slope of the tag's plane across and along the picture, positive where its right side, or its upper side, is the
        farther one.
    place : ndarray, shape (n, 5)
        Functions of the place in the image by which a lens or a tilt would change all three.
    place_covariance : ndarray, shape (3, 5, 5)
        Of what is left of that dependence, for depth (in px), yaw and pitch.
    noise : ndarray, shape (3,)
        White noise of a sample, of depth in px, and of yaw and pitch in rad.
    """

    depth_px: FloatArray
    yaw_rad: FloatArray
    pitch_rad: FloatArray
    place: FloatArray
    place_covariance: FloatArray
    noise: FloatArray


def measure_attitude(
    pcp: TagSightings, tcp: TagSightings | None, *, focal_px: float, principal_px: FloatArray
) -> Attitude | None:
    """Measure the product's distance, yaw and pitch in each frame.

    Parameters
    ----------
    pcp, tcp : TagSightings
        The product's tag, and the tool's, which shows what the camera makes of a place; without it, or where it rests,
        the usual tilts and lenses are reckoned with.
    focal_px : float
        Focal length. Depth and angles are in proportion to it.
    principal_px : ndarray, shape (2,)
        Where the optical axis meets the image: how a tag leans from the line of sight hangs on it.

    Returns
    -------
    Attitude or None
        None where the tag was seen in fewer than 50 frames.

    Notes
    -----
    Yaw and pitch are the slopes themselves: noisy in one frame (0.5° for a tag of 60 px), but signed and unbiased,
    where foreshortening is even, and a single frame's pose of a nearly frontal tag may flip over. Depth is the change
    of size in which all five channels are joined by weighted least squares, linear about the mean attitude: a nod
    shortens a tag that leans already, which must not be taken for distance. What yaw and nod do in the second order, at
    twice their frequency, counts as noise of the size across and along.
    """
    looks = _channels(pcp, focal_px)
    seen: BoolArray = np.asarray(np.isfinite(looks).all(axis=1))
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return None
    place = _place(pcp, principal_px, focal_px)
    slope, covariance = _dependence_on_place(tcp, principal_px, focal_px)
    looks = looks - place @ slope.T
    looks = looks - np.mean(looks[seen], axis=0)
    white = np.array([_white_noise(column[seen]) for column in looks.T])
    joined = np.zeros((3, CHANNELS))
    # ln(size) falls as ln(distance) rises, and the distance in a tag's own pixels is the focal length.
    joined[0] = -focal_px * _weights_of_size(_lean(pcp, place, seen, focal_px), white, looks[seen, 3:])
    joined[1, 3] = joined[2, 4] = 1.0
    depth, yaw, pitch = joined @ looks.T
    return Attitude(
        depth_px=depth,
        yaw_rad=yaw,
        pitch_rad=pitch,
        place=place,
        place_covariance=np.einsum("jk,kab->jab", joined**2, covariance),
        noise=np.sqrt(joined**2 @ white**2),
    )


def _channels(tag: TagSightings, focal_px: float) -> FloatArray:
    """Return half the logarithms of A Aᵀ's diagonal, its shear, and the slopes of the tag's plane, shape (n, 5)."""
    corners = tag.corners_px * np.array([1.0, -1.0])
    lower_left, lower_right, upper_right, upper_left = np.moveaxis(corners, 1, 0)
    along_x = (lower_right + upper_right - lower_left - upper_left) / 4
    along_y = (upper_left + upper_right - lower_left - lower_right) / 4
    warp = (lower_left + upper_right - lower_right - upper_left) / 4
    with np.errstate(invalid="ignore", divide="ignore"):
        xx, yy = along_x[:, 0] ** 2 + along_y[:, 0] ** 2, along_x[:, 1] ** 2 + along_y[:, 1] ** 2
        xy = along_x[:, 0] * along_x[:, 1] + along_y[:, 0] * along_y[:, 1]
        area = along_x[:, 0] * along_y[:, 1] - along_x[:, 1] * along_y[:, 0]
        # Of the image A x / (1 + h·x) the term in x y is -(h₁ A₂ + h₂ A₁); h A⁻¹ is the slope over the focal length.
        first = -(warp[:, 0] * along_x[:, 1] - warp[:, 1] * along_x[:, 0]) / -area
        second = -(warp[:, 1] * along_y[:, 0] - warp[:, 0] * along_y[:, 1]) / -area
        slope_x = (first * along_y[:, 1] - second * along_x[:, 1]) / area
        slope_y = (second * along_x[:, 0] - first * along_y[:, 0]) / area
        columns = [np.log(xx) / 2, np.log(yy) / 2, xy / np.sqrt(xx * yy), focal_px * slope_x, focal_px * slope_y]
    return np.column_stack(columns)


def _place(tag: TagSightings, origin_px: FloatArray, focal_px: float) -> FloatArray:
    """Return x, y, x², x y, y² of the tag's place, from the origin and over the focal length, y up, shape (n, 5)."""
    x, y = ((tag.centre_px - origin_px) * np.array([1.0, -1.0]) / focal_px).T
    return np.column_stack([x, y, x**2, x * y, y**2])


def _dependence_on_place(
    tool: TagSightings | None, origin_px: FloatArray, focal_px: float
) -> tuple[FloatArray, FloatArray]:
    """Return the slopes of all channels over the place, shape (5, 5), and their covariances, shape (5, 5, 5)."""
    slopes, covariances = np.zeros((CHANNELS, 5)), np.stack([np.diag(std**2) for std in PLACE_STD])
    if tool is None:
        return slopes, covariances
    looks, place = _channels(tool, focal_px), _place(tool, origin_px, focal_px)
    seen = np.flatnonzero(np.isfinite(looks).all(axis=1))
    seen = seen[:: max(1, len(seen) // MOST_SAMPLES)]
    if len(seen) < LEAST_SAMPLES or not np.max(np.ptp(tool.centre_px[seen], axis=0)) > LEAST_WAY_PX:
        return slopes, covariances
    design = np.column_stack([place[seen], np.ones(len(seen))])
    for channel in range(CHANNELS):
        values, weight = looks[seen, channel], np.ones(len(seen))
        prior = np.diag(PLACE_STD[channel] ** -2.0)
        for _ in range(4):
            free = np.linalg.lstsq(design * weight[:, None] ** 0.5, values * weight**0.5, rcond=None)[0]
            left = values - design @ free
            spread = max(1.4826 * float(np.median(np.abs(left))), LEAST_SPREAD)
            weight = 1 / np.maximum(1.0, np.abs(left) / (2 * spread))
        step = max(1, len(looks) // MOST_SAMPLES)
        variance = spread**2 * max(FRAMES_PER_SAMPLE / step, 1.0)
        # About the mean, lest the constant's digits drown the rest.
        about = design[:, :5] - np.average(design[:, :5], axis=0, weights=weight)
        covariances[channel] = np.linalg.inv((about.T * weight) @ about / variance + prior)
        slopes[channel] = covariances[channel] @ (about.T @ (weight * (values - np.average(values, weights=weight))))
        slopes[channel] /= variance
    return slopes, covariances


def _lean(pcp: TagSightings, place: FloatArray, seen: BoolArray, focal_px: float) -> FloatArray:
    """Return how far the tag leans from the line of sight on the whole, across and along."""
    slope = np.median(_channels(pcp, focal_px)[seen, 3:], axis=0)
    return np.asarray(slope + np.median(place[seen, :2], axis=0))


def _weights_of_size(lean: FloatArray, white: FloatArray, turns: FloatArray) -> FloatArray:
    """Return the weights, shape (5,), by which the channels tell the change of ln(size) whatever the tag's attitude."""
    x, y = lean
    moves = np.maximum(np.var(turns, axis=0) - white[3:] ** 2, LEAST_TURN_RAD**2)
    noise = np.array(
        [*np.hypot(white[:2], moves / 2), math.hypot(white[2], math.sqrt(moves[0] * moves[1])), *white[3:]]
    )
    slopes = np.array([[1.0, -x, 0.0], [1.0, 0.0, -y], [0.0, -y, -x], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    weighted = slopes.T / noise**2
    return np.asarray(np.linalg.solve(weighted @ slopes, weighted)[0])


def _white_noise(values: FloatArray) -> float:
    """Return the noise that third differences show: a motion hardly enters them."""
    # The weights 1, 3, 3, 1 of a third difference have the squared sum 20.
    return max(1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / math.sqrt(20), 1e-9)
