"""The tilt of the motion's plane against the image, from how large the tags look across it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, TagSightings
from tagsway.tracks.scale import side_lengths

USUAL_TILT_RAD = math.radians(5)
"""Standard deviation of the tilt of a camera that somebody set up by eye: holds where the tags hardly move."""

FRAMES_PER_SAMPLE = 10
"""Neighbouring frames share their error (a codec predicts each from the last): so many count as one."""


LEAST_NEARNESS = 0.1
"""A point ten times as far as the principal point is behind the horizon of any camera that somebody set up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt:
    """A plane's depth over the image: Z = Z₀ / w, w = 1 - g · (p - c), c the principal point.

    Parameters
    ----------
    gradient_per_px : ndarray, shape (2,)
        g, for x right and y down; the tangent of the tilt over the focal length in pixels.
    std_per_px : ndarray, shape (2,)
        Its standard errors.
    """

    gradient_per_px: FloatArray
    std_per_px: FloatArray

    def nearness(self, offset_px: FloatArray) -> FloatArray:
        """Return w at points given from the principal point, shape (..., 2) → (...)."""
        return 1 - offset_px @ self.gradient_per_px

    def enlargement(self, offset_px: FloatArray) -> FloatArray:
        """Return how much larger a tag looks there than at the principal point: w^(3/2), the root of its area."""
        return np.maximum(self.nearness(offset_px), LEAST_NEARNESS) ** 1.5


LEVEL = Tilt(gradient_per_px=np.zeros(2), std_per_px=np.zeros(2))
"""No tilt at all: the picture was straightened."""


def measure_tilt(tags: Sequence[TagSightings], principal_px: FloatArray, *, focal_px: float) -> Tilt:
    """Return the plane's tilt that makes every tag equally large all along its way.

    Parameters
    ----------
    tags : sequence of TagSightings
        Of one plane, or of parallel ones: each has its own size.
    principal_px : ndarray, shape (2,)
        Where the optical axis meets the image.
    focal_px : float
        Focal length; a guess does, it only turns the usual tilt into a prior.

    Returns
    -------
    Tilt
        Without a tag, or with tags that hardly move, near zero with the prior's error.

    Notes
    -----
    ln(apparent side) = const - 3/2 g · (p - c) to first order, by least squares with the prior g = 0 ± 5° / focal
    length; outliers are weighted down. A sway out of the plane changes the size too, but with time, not with place.
    """
    offsets, sizes, owner = [], [], []
    for number, tag in enumerate(tags):
        size = np.sqrt(np.prod(side_lengths(tag), axis=1))
        seen = np.isfinite(size)
        offsets.append(tag.centre_px[seen] - principal_px)
        sizes.append(np.log(size[seen]))
        owner.append(np.full(int(seen.sum()), number))
    prior = math.tan(USUAL_TILT_RAD) / focal_px
    offset, size, tag_number = np.concatenate(offsets), np.concatenate(sizes), np.concatenate(owner)
    design = np.column_stack([-1.5 * offset, tag_number[:, None] == np.arange(len(tags))])
    weight = np.ones(len(size))
    for _ in range(5):
        solution, covariance, residual = _solve(design, size, weight, prior)
        spread = 1.4826 * float(np.median(np.abs(residual)))
        weight = 1 / np.maximum(1.0, np.abs(residual) / max(2 * spread, 1e-12))
    return Tilt(gradient_per_px=solution[:2], std_per_px=np.sqrt(np.diag(covariance)[:2]))


def _solve(
    design: FloatArray, values: FloatArray, weight: FloatArray, prior: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weighted least squares with a prior on the first two unknowns, its covariance and residuals."""
    free = np.linalg.lstsq(design * np.sqrt(weight)[:, None], values * np.sqrt(weight), rcond=None)[0]
    variance = float(np.average((values - design @ free) ** 2, weights=weight)) * FRAMES_PER_SAMPLE
    information = (design.T * weight) @ design / max(variance, 1e-16)
    information[[0, 1], [0, 1]] += 1 / prior**2
    covariance = np.asarray(np.linalg.pinv(information), dtype=float)
    solution: FloatArray = covariance @ (design.T @ (weight * values)) / max(variance, 1e-16)
    residual: FloatArray = values - design @ solution
    return solution, covariance, residual
