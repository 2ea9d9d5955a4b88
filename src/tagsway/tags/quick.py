"""A step of refinement on a lattice of the pattern, its least squares solved beforehand."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.grid import compose
from tagsway.tags.pose import Jacobian, find_region, local_jacobian
from tagsway.tags.refine import KNOWN_WEIGHT, LONGEST_STEP, MIDDLE_GREY, ROUNDING, SHORTEST_MOTION_PX, Refinement
from tagsway.tags.streak import find_streak
from tagsway.tags.template import PARAMETERS, Float32Array, Template, draw_pattern

_SAMPLES_PER_PX = 1.5  # fewer lose: 5 % of the standard error at 1.25, 10 % at 1
_SMALLEST_SCALE_PX = 20.0  # a smaller tag loses more, and has few pixels
_MOST_SAMPLES = 150  # to a side; beyond, the pixels themselves are as quick
_BILINEAR = 1 / 6  # px², variance of the triangle that interpolates between pixels, along each axis
_SHARPEST = 0.4  # of the optics' variance, that taking the triangle away may leave
_STREAKS_PER_PX = 3  # a sixth of a pixel more or less of motion leaves 10 % of the noise's variance
_MOST_STREAKS, _MOST_MET = 48, 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Samples of a tag, and what makes a step of them.

    Parameters
    ----------
    samples : int
        To a side.
    half_width : float
        As far as they reach, in the tag's own frame.
    place : ndarray, shape (3, 3)
        Takes (column, row) of a sample to the tag's own frame.
    solver : ndarray of float32, shape (10, samples²)
        Takes grey values to (gain × step of the homography (8), gain, offset).
    normal : ndarray, shape (10, 10)
        Gram matrix of the pattern's columns.
    used : ndarray of float32, shape (samples²,), or None
        1 where the pattern is known, 0 elsewhere; None where it is known everywhere.

    Notes
    -----
    What the samples show is the image blurred by the triangle k of bilinear interpolation, of 1/6 px²: the columns D
    are drawn so. Their noise is coloured by k, and ordinary least squares would lose by it. With instruments Z that
    are sharper than the image by k, (ZᵀD)⁻¹Zᵀ on the samples is (Z * k)ᵀ on the pixels, whose noise is white: what
    `tagsway.tags.refine` does, but for the lattice's own grain.
    """

    samples: int
    half_width: float
    place: FloatArray
    solver: Float32Array
    normal: FloatArray
    used: Float32Array | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What a refinement on the pixels leaves for the quick ones after it.

    Parameters
    ----------
    covariance : tuple of float
        Variances of the centre along the tag's own axes and their covariance, in units of the template's scale, for
        noise of one grey level and a gain of one: that does not change while the tag moves and turns.
    turning : float
        Variance of the angle in rad², for the same.
    variance_ratio : float
        Variance of the pixels over that of the samples.
    contrast : float
        Variance of the pattern over the pixels, for a gain of one.
    """

    covariance: tuple[float, float, float]
    turning: float
    variance_ratio: float
    contrast: float

    @classmethod
    def learn(cls, grey: GreyArray, refined: Refinement, template: Template, lattice: Lattice) -> Self | None:
        """Keep what a refinement knows; None where the samples do not show the pattern."""
        measured = _measure(grey, refined.homography, lattice)
        if measured is None:
            return None
        unit = refined.variance / refined.gain**2
        (a, b), (c, d) = _turn_back(local_jacobian(refined.homography))
        xx, yy, turning, xy = (part / unit for part in refined.plain)
        explained = min(refined.correlation**2, 1 - 1e-9)
        return cls(
            covariance=_carry((xx, xy, yy), ((a, b), (c, d))),
            turning=turning,
            variance_ratio=refined.variance / measured[1],
            contrast=unit * explained / (1 - explained),
        )


class Lattices:
    """The lattices of one template, one for each motion that blurs it.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Its number.
    template : Template
        Whose size and sharpness they have.
    """

    def __init__(self, family: str, tag_id: int, template: Template) -> None:
        self.template = template
        self._drawn = _draw(family, tag_id, template)
        self._made: dict[tuple[int, int], Lattice | None] = {}
        self._count = 0

    def find(self, homography: FloatArray, motion_px: tuple[float, float]) -> Lattice | None:
        """Return the lattice for a motion; None for one that is met the first time, and where there are too many."""
        (a, b), (c, d) = _turn_back(local_jacobian(homography))
        right, down = motion_px
        scale = self.template.scale_px
        along, across = scale * (a * right + b * down), scale * (c * right + d * down)
        x, y = round(_STREAKS_PER_PX * along), round(_STREAKS_PER_PX * across)
        motion = (-x, -y) if (x, y) < (0, 0) else (x, y)
        if motion not in self._made:
            if len(self._made) >= _MOST_MET:
                return None
            self._made[motion] = None
        elif self._made[motion] is None and self._count < _MOST_STREAKS and self._drawn is not None:
            streak = motion[0] / _STREAKS_PER_PX, motion[1] / _STREAKS_PER_PX
            self._made[motion] = make_lattice(self._drawn, self.template, streak)
            self._count += 1
        return self._made[motion]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """The pattern on the samples, at rest.

    Parameters
    ----------
    at : ndarray of float32, shape (samples,)
        Where the columns lie, in the tag's own frame.
    seen, sharp : sequence of ndarray of float32, shape (samples, samples)
        The pattern and its derivatives by x and y, as samples of the image show it, and as sharp as instruments are.
    used : ndarray of float32, shape (samples, samples)
        1 where the family prints something.
    """

    at: Float32Array
    seen: Sequence[Float32Array]
    sharp: Sequence[Float32Array]
    used: Float32Array


def _draw(family: str, tag_id: int, template: Template) -> Drawing | None:
    """Return the pattern on the samples; None for a tag of a size at which the pixels are better asked."""
    scale, reach = template.scale_px, template.texture_half_width
    samples = math.ceil(2 * reach * scale * _SAMPLES_PER_PX)
    if not (scale >= _SMALLEST_SCALE_PX and samples <= _MOST_SAMPLES):
        return None
    optics = template.blur_px**2

    def draw(variance: float) -> tuple[Float32Array, ...]:
        return draw_pattern(family, tag_id, reach, samples, math.sqrt(variance) / scale, 1 / scale)

    pattern, by_x, by_y, used, at = draw(optics + _BILINEAR)
    sharp = draw(max(optics - _BILINEAR, _SHARPEST * optics))
    return Drawing(at=at, seen=(pattern, by_x, by_y), sharp=sharp[:3], used=used)


def make_lattice(drawing: Drawing, template: Template, motion_px: tuple[float, float]) -> Lattice:
    """Return the lattice of a tag that is blurred by a motion.

    Parameters
    ----------
    drawing : Drawing
        Of the tag.
    template : Template
        Of its size and sharpness.
    motion_px : tuple of float
        Along the tag's own axes, while an image is exposed.

    Returns
    -------
    Lattice
        Half a millisecond for a tag of 60 px.
    """
    at, step = drawing.at, float(drawing.at[1] - drawing.at[0])
    seen: Sequence[Float32Array] = drawing.seen
    sharp: Sequence[Float32Array] = drawing.sharp
    used = drawing.used
    if math.hypot(*motion_px) < SHORTEST_MOTION_PX:
        inside = np.flatnonzero(np.abs(at) <= template.half_width)
    else:
        per_px = 1 / (template.scale_px * step)
        streak = find_streak((motion_px[0] * per_px, -motion_px[1] * per_px))
        seen, sharp = ([_blur(plane, streak) for plane in planes] for planes in (seen, sharp))
        used = (_blur(used, streak) > KNOWN_WEIGHT).astype(np.float32)
        inside = np.flatnonzero(used.any(axis=0) | used.any(axis=1))
    part = slice(int(inside[0]), int(inside[-1]) + 1)
    at, used = at[part], used[part, part]
    design, instruments = (_columns([plane[part, part] for plane in planes], at, used) for planes in (seen, sharp))
    first = float(at[0])
    return Lattice(
        samples=len(at),
        half_width=-first + step / 2,
        place=np.array([[step, 0, first], [0, -step, -first], [0, 0, 1.0]]),
        solver=np.linalg.inv((instruments @ design.T).astype(float)).astype(np.float32) @ instruments,
        normal=(design @ design.T).astype(float),
        used=None if used.all() else used.reshape(-1),
    )


def refine_quickly(
    grey: GreyArray, homography: FloatArray, template: Template, lattice: Lattice, known: Known
) -> Refinement | None:
    """Return the pose after one inverse-compositional step, in a third of the time of `tagsway.tags.refine.refine`.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; right to about 0.3 px.
    template : Template
        Of its size and sharpness.
    lattice : Lattice
        Made for it, and for the motion.
    known : Known
        From a frame shortly before.

    Returns
    -------
    Refinement or None
        Without sandwich. None where the step is none, or where the tag leaves the image.

    Notes
    -----
    To 3 % of the standard error as good as the pixels themselves. How much noise there is and what it does to the pose
    is scaled from a frame in which the pixels were asked. Not for a first alignment, nor for a tag under a hand.
    """
    measured = _measure(grey, homography, lattice)
    if measured is None:
        return None
    solution, variance = measured
    gain = float(solution[8])
    step = solution[:8] / gain
    longest = float(np.abs(step).max())
    if not longest < LONGEST_STEP:
        return None
    here = compose(homography, step)
    here /= here[2, 2]
    variance = max(variance * known.variance_ratio, ROUNDING)
    unit = variance / gain**2
    xx, xy, yy = _carry(known.covariance, local_jacobian(here))
    return Refinement(
        homography=here,
        plain=(unit * xx, unit * yy, unit * known.turning, unit * xy),
        sandwich=None,
        variance=variance,
        gain=gain,
        step_px=template.scale_px * longest,
        correlation=math.sqrt(known.contrast / (known.contrast + unit)),
    )


def _measure(grey: GreyArray, homography: FloatArray, lattice: Lattice) -> tuple[FloatArray, float] | None:
    """Return the solution and the variance that it leaves of the samples; None where the pattern is not all there."""
    view = homography @ lattice.place
    region = find_region(grey.shape, homography, lattice.half_width)
    if region is None:
        return None
    left, top, width, height = region
    if not (left > 0 and top > 0 and left + width < grey.shape[1] and top + height < grey.shape[0]):
        return None
    crop = np.subtract(grey[top : top + height, left : left + width], np.float32(MIDDLE_GREY))
    view[:2] -= np.array([[left], [top]]) * view[2]
    size, flags = (lattice.samples, lattice.samples), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = np.asarray(cv2.warpPerspective(crop, view, size, flags=flags), dtype=np.float32).reshape(-1)
    if lattice.used is not None:
        patch *= lattice.used
    solution = (lattice.solver @ patch).astype(float)
    left_over = float(patch @ patch) - float(solution @ lattice.normal @ solution)
    count = float(lattice.normal[9, 9])
    if not (solution[8] > 0 and left_over > 0):
        return None
    return solution, left_over / (count - PARAMETERS)


def _columns(planes: Sequence[Float32Array], at: Float32Array, used: Float32Array) -> Float32Array:
    """Return what the samples change by with each parameter, shape (10, samples²)."""
    pattern, by_x, by_y = planes
    x, y = at, -at[:, None]
    inward = by_x * x + by_y * y
    columns = [by_x * x, by_x * y, by_x, by_y * x, by_y * y, by_y, -inward * x, -inward * y, pattern]
    return (np.stack([*columns, np.ones_like(pattern)]) * used).reshape(PARAMETERS, -1)


def _blur(image: Float32Array, streak: Float32Array) -> Float32Array:
    return np.asarray(cv2.filter2D(image, -1, streak, borderType=cv2.BORDER_CONSTANT), dtype=np.float32)


def _turn_back(local: Jacobian) -> Jacobian:
    (a, b), (c, d) = local
    area = a * d - b * c
    return (d / area, -b / area), (-c / area, a / area)


def _carry(covariance: tuple[float, float, float], local: Jacobian) -> tuple[float, float, float]:
    """Return variance, covariance, variance of two coordinates after a linear map."""
    xx, xy, yy = covariance
    (a, b), (c, d) = local
    across, down = a * a * xx + 2 * a * b * xy + b * b * yy, c * c * xx + 2 * c * d * xy + d * d * yy
    return across, a * c * xx + (a * d + b * c) * xy + b * d * yy, down
