"""The last step of an alignment, on the image's own pixels, and what it is worth."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.streak import find_streak
from tagsway.tags.template import Template

_SHORTEST_MOTION_PX = 0.5  # a shorter one blurs by less than a seventh of a pixel
_POINT = np.ones((1, 1), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """A pose at the noise's limit.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to the pixels of the image that was given.
    plain : tuple of float
        Variances of (centre x, centre y in px, angle in rad), then the covariance of x and y, for white noise of the
        residual's size.
    sandwich : ndarray, shape (3,), or None
        The variances from the residual's sums over blocks: whatever the noise's correlation, but uncertain themselves.
    variance : float
        Of the residual, in grey levels squared.
    gain : float
        Grey levels from black to white.
    correlation : float
        Of pattern and image.
    step_px : float
        How far the centre or a corner was moved, about.
    """

    homography: FloatArray
    plain: tuple[float, float, float, float]
    sandwich: FloatArray | None
    variance: float
    gain: float
    correlation: float
    step_px: float


def refine(
    grey: GreyArray,
    homography: FloatArray,
    template: Template,
    *,
    motion_px: tuple[float, float] = (0.0, 0.0),
    with_blocks: bool = False,
) -> Refinement | None:
    """Return the pose after one Gauss-Newton step in the image's frame.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; right to about 0.3 px.
    template : Template
        Of this size and sharpness.
    motion_px : tuple of float
        How far the tag moves, right and down, while the image is exposed.
    with_blocks : bool
        Also the sandwich, for more than half as much time again.

    Returns
    -------
    Refinement or None
        None where the step is none, or the tag leaves the image.

    Notes
    -----
    Grey I, pattern T: I(x) = a T(H⁻¹ V(x)) + b with V = id + δ(p) a homography of the image, so that each pixel is
    compared with the pattern at its own place; linear in (a p, a, b). The pixels' noise is independent, hence the
    covariance of p is σ² (JᵀJ)⁻¹ / a². Not for a first alignment: one step reaches only as far as a blur.
    """
    step = load_compiled()
    moves = math.hypot(*motion_px) >= _SHORTEST_MOTION_PX
    known, streak = (template.texture_half_width, find_streak(motion_px)) if moves else (template.half_width, _POINT)
    h, scale = homography / homography[2, 2], template.scale_px
    half_width = template.texture_half_width
    found = step(grey, h, template.texture, template.printed, half_width, known, scale, streak, with_blocks)
    if not math.isfinite(found[0]):
        return None
    x, y, turn, cross, *sandwich, variance, gain, step_px, correlation = found[9:].tolist()
    return Refinement(
        homography=found[:9].reshape(3, 3),
        plain=(x, y, turn, cross),
        sandwich=np.array(sandwich) if with_blocks else None,
        variance=variance,
        gain=gain,
        correlation=correlation,
        step_px=step_px,
    )


@cache
def load_compiled() -> Callable[..., FloatArray]:
    """Return the compiled step: half a second, and the first time on a machine some seconds; then at once."""
    from tagsway.tags.step import load_step

    return load_step()
