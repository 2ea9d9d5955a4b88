"""Measure a tag by aligning its known pattern with the image."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray, Sighting
from tagsway.tags.refine import Refinement, local_jacobian, refine
from tagsway.tags.template import Float32Array, Template, make_template

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

LEAST_CORRELATION = 0.85  # background reaches .44 over the whole, another id .76 ...
LEAST_INNER_CORRELATION = 0.7  # ... and .56 and .45 over the inner cells; the true tag, blurred and noisy, .95
LEAST_CONTRAST = 6.0  # grey levels from black to white

_MOST_STEPS = 12
_LAST_STEP_PX = 0.1  # the refinement takes what is left ...
_REPEATED_STEP_PX = 0.06  # ... twice where that was much
_SMALLEST_SIDE_PX = 8.0
_PAD_PX = 10  # of the crop around a predicted tag: what the alignment may move
_BLURS_PX = tuple(0.25 * 1.3**k for k in range(10))  # of the optics
_FIRST_BLUR = 3
_SHUTTERS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # exposure over frame interval
_TELLING_TRAVEL_PX = 3.0  # in a frame interval: less blurs too little to tell the shutter
_SHUTTER_LESSONS = 4
_RESTING_TRAVEL_PX = 0.3
_RESIZED = 1.08  # a template serves sizes within this factor
_MEMORY = 32  # frames in the running ratio of the two covariances
_BLOCKS_EVERY = 4  # frames, after that
_ODD_VARIANCE = 1.5


@dataclass(frozen=True, slots=True)
class _Crop:
    """A part of an image in float, less 128 so that sums of squares keep their digits."""

    grey: Float32Array
    left: int
    top: int

    def enter(self, homography: FloatArray) -> FloatArray:
        return self._shift(homography, -self.left, -self.top)

    def leave(self, homography: FloatArray) -> FloatArray:
        moved = self._shift(homography, self.left, self.top)
        moved /= moved[2, 2]
        return moved

    @staticmethod
    def _shift(homography: FloatArray, right: int, down: int) -> FloatArray:
        moved = homography.copy()
        moved[0] += right * homography[2]
        moved[1] += down * homography[2]
        return moved


class Aligner:
    """Aligns one tag's pattern, frame after frame, and learns how sharp and how noisy the images are.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Its number.

    Notes
    -----
    Inverse-compositional Gauss-Newton on a homography, gain and offset takes the pose from the prediction to a
    hundredth of a pixel: its least-squares solver is fixed, so a step costs one resampling and one matrix-vector
    product [1]_. One Gauss-Newton step on the pixels themselves (`refine`) then takes it to the noise: no pixel is
    resampled there, so no grid beats with another, and the noise stays white.

    Not for tags under about 12 px, nor where what is printed is not the family's own pattern.

    References
    ----------
    .. [1] S. Baker and I. Matthews, Int. J. Computer Vision 56 (2004) 221-255.
    """

    def __init__(self, family: str, tag_id: int) -> None:
        self._family = family
        self._tag_id = tag_id
        self._template: Template | None = None
        self._blurred_by_px = math.inf
        self._shutter = 0.0
        self._lessons = 0
        self._log_ratio = np.zeros(3)
        self._variance = 0.0
        self._measured = 0

    def align(
        self, grey: GreyArray, homography: FloatArray, *, travel_px: tuple[float, float] | None = None
    ) -> Sighting | None:
        """Return the tag as it is seen near a predicted pose.

        Parameters
        ----------
        grey : ndarray of uint8, shape (height, width)
            The image.
        homography : ndarray, shape (3, 3)
            Predicted; takes the tag's frame to pixels. Off by not more than about 5 px and half a cell.
        travel_px : tuple of float, optional
            How far the tag moves, right and down, from frame to frame; the share of it that blurs the image is learned.

        Returns
        -------
        Sighting or None
            None where the pattern is not there.
        """
        scale_px = measure_scale(homography) if homography[2, 2] != 0 else math.nan
        if not _SMALLEST_SIDE_PX <= 2 * scale_px <= 2 * max(grey.shape):
            return None
        crop = _cut(grey, homography)
        if crop is None:
            return None
        inside = crop.enter(homography)
        self._learn(crop, inside, travel_px)
        template = self._template
        if template is None:
            return None
        found = _align_grid(crop.grey, inside, template)
        if found is None:
            return None
        motion = _scale(travel_px, self._shutter)
        refined = refine(crop.grey, found, template, motion_px=motion, with_blocks=self._wants_blocks())
        if refined is not None and (refined.step_px > _REPEATED_STEP_PX or self._is_odd(refined)):
            refined = refine(crop.grey, refined.homography, template, motion_px=motion, with_blocks=True)
        return None if refined is None else self._report(crop, refined)

    def _make_template(self, scale_px: float, blur_px: float) -> Template:
        return make_template(self._family, self._tag_id, scale_px=scale_px, blur_px=blur_px)

    def _learn(self, crop: _Crop, homography: FloatArray, travel_px: tuple[float, float] | None) -> None:
        """Have a template for this image: of its size, as sharp as the optics, and know the shutter if it shows.

        At rest the blur is that of the optics; it is measured again whenever the tag is much slower than before. On a
        fast frame the shutter is measured with what is known of the optics, then the optics with the shutter.
        """
        scale_px = measure_scale(homography)
        travel = math.inf if travel_px is None else math.hypot(*travel_px)
        if self._lessons < _SHUTTER_LESSONS and _TELLING_TRAVEL_PX < travel < math.inf:
            blurred = self._template is None or self._blurred_by_px > _RESTING_TRAVEL_PX
            template = self._make_template(scale_px, _BLURS_PX[_FIRST_BLUR]) if blurred else self._template
            assert template is not None
            shutter = _find_shutter(crop.grey, homography, template, travel_px or (0.0, 0.0))
            if shutter is not None:
                self._lessons += 1
                self._shutter += (shutter - self._shutter) / self._lessons
                if self._lessons in (1, _SHUTTER_LESSONS):
                    self._blurred_by_px = math.inf
        sharper = self._blurred_by_px > _RESTING_TRAVEL_PX and travel < 0.5 * self._blurred_by_px
        if self._template is None or sharper:
            motion = _scale(travel_px, self._shutter)
            self._template = self._make_template(scale_px, self._find_blur(crop.grey, homography, scale_px, motion))
            known = travel if self._lessons == 0 else _RESTING_TRAVEL_PX
            self._blurred_by_px = max(known, _RESTING_TRAVEL_PX)
        elif not 1 / _RESIZED < scale_px / self._template.scale_px < _RESIZED:
            self._template = self._make_template(scale_px, self._template.blur_px)

    def _find_blur(
        self, grey: Float32Array, homography: FloatArray, scale_px: float, motion_px: tuple[float, float]
    ) -> float:
        """Return the optics' blur that leaves the least residual, going downhill from the last one known."""
        made: dict[int, float] = {}
        known = _BLURS_PX[_FIRST_BLUR] if self._template is None else self._template.blur_px

        def residual(k: int) -> float:
            if k not in made:
                made[k] = _residual(grey, homography, self._make_template(scale_px, _BLURS_PX[k]), motion_px)
            return made[k]

        last = len(_BLURS_PX) - 1
        best = int(np.argmin(np.abs(np.log(_BLURS_PX) - math.log(known))))
        for direction in (1, -1):
            while 0 <= best + direction <= last and residual(best + direction) < residual(best):
                best += direction
        between = _find_lowest(residual(max(best - 1, 0)), residual(best), residual(min(best + 1, last)))
        return float(_BLURS_PX[best] * (_BLURS_PX[1] / _BLURS_PX[0]) ** between)

    def _report(self, crop: _Crop, refined: Refinement) -> Sighting:
        h = crop.leave(refined.homography)
        along = local_jacobian(h)[:, 0]
        covariance = self._steady(refined)
        return Sighting(
            homography=h,
            corners_px=project(h, CORNERS),
            centre_px=h[:2, 2].copy(),
            covariance_px2=covariance[:2, :2],
            angle_rad=math.atan2(-along[1], along[0]),
            angle_std_rad=math.sqrt(covariance[2, 2]),
            correlation=refined.correlation,
        )

    def _wants_blocks(self) -> bool:
        return self._measured < _MEMORY or self._measured % _BLOCKS_EVERY == 0

    def _is_odd(self, refined: Refinement) -> bool:
        """Tell whether the image differs from the pattern by more than it usually does: its noise is then no one's."""
        return refined.sandwich is None and refined.variance > _ODD_VARIANCE * self._variance

    def _steady(self, refined: Refinement) -> FloatArray:
        """Return the covariance: the plain one, scaled by its running ratio to the one that sees correlated noise.

        One frame's ratio is known to a fifth only; where it jumps (a hand over the tag) it counts at once.
        """
        self._measured += 1
        weight = 1 / min(self._measured, _MEMORY)
        self._variance += (refined.variance - self._variance) * weight
        log_factor = self._log_ratio
        if refined.sandwich is not None:
            ratio = np.log(np.maximum(np.diag(refined.sandwich), 1e-30) / np.diag(refined.plain))
            self._log_ratio = self._log_ratio + (ratio - self._log_ratio) * weight
            log_factor = np.maximum(self._log_ratio, ratio - 1.0)
        factor = np.exp(log_factor / 2)
        covariance: FloatArray = refined.plain * np.outer(factor, factor)
        return covariance


def project(homography: FloatArray, points: FloatArray) -> FloatArray:
    """Return where a homography takes points.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the tag's frame to pixels.
    points : ndarray, shape (n, 2)
        In the tag's frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Pixels.
    """
    image = points @ homography[:, :2].T + homography[:, 2]
    pixels: FloatArray = image[:, :2] / image[:, 2:]
    return pixels


def find_homography(corners_px: FloatArray) -> FloatArray:
    """Return the homography that takes the tag's frame to four corners.

    Parameters
    ----------
    corners_px : ndarray, shape (4, 2)
        Corners of the border square, in the order of `model.tags`.

    Returns
    -------
    ndarray, shape (3, 3)
        Its last element is 1.
    """
    found = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), corners_px.astype(np.float32))
    return np.asarray(found, dtype=float)


def measure_scale(homography: FloatArray) -> float:
    """Return the pixels to a unit of the tag's frame, half a side; NaN where the tag is seen from behind.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the tag's frame to pixels.

    Returns
    -------
    float
        Root of the area that a unit square at the centre takes.
    """
    (a, b), (c, d) = local_jacobian(homography)
    area = b * c - a * d  # y is up in the tag's frame and down in the image
    return math.sqrt(area) if area > 0 else math.nan


def _cut(grey: GreyArray, homography: FloatArray) -> _Crop | None:
    """Return the part of the image around a tag; None where the tag does not lie in the image."""
    height, width = grey.shape
    square = project(homography, CORNERS)
    least, most = square.min(axis=0), square.max(axis=0)
    if not (least.min() >= -0.5 and most[0] <= width - 0.5 and most[1] <= height - 0.5):
        return None
    reach = 0.15 * float((most - least).max()) + _PAD_PX
    left, top = max(int(least[0] - reach), 0), max(int(least[1] - reach), 0)
    part = grey[top : int(most[1] + reach) + 2, left : int(most[0] + reach) + 2].astype(np.float32)
    part -= 128
    return _Crop(grey=part, left=left, top=top)


def _scale(travel_px: tuple[float, float] | None, share: float) -> tuple[float, float]:
    return (0.0, 0.0) if travel_px is None else (share * travel_px[0], share * travel_px[1])


def _find_shutter(
    grey: Float32Array, homography: FloatArray, template: Template, travel_px: tuple[float, float]
) -> float | None:
    """Return the share of the motion between two frames that blurs the image, if the pattern is seen."""
    found = _align_grid(grey, homography, template)
    if found is None:
        return None
    left = [_residual(grey, found, template, _scale(travel_px, shutter)) for shutter in _SHUTTERS]
    best = int(np.argmin(left))
    if not 0 < best < len(left) - 1:
        return _SHUTTERS[best] if math.isfinite(left[best]) else None
    return _SHUTTERS[best] + _find_lowest(*left[best - 1 : best + 2]) * (_SHUTTERS[1] - _SHUTTERS[0])


def _residual(grey: Float32Array, homography: FloatArray, template: Template, motion_px: tuple[float, float]) -> float:
    """Return the variance that a template leaves; infinite where it does not fit at all."""
    found = _align_grid(grey, homography, template)
    refined = None if found is None else refine(grey, found, template, motion_px=motion_px)
    return math.inf if refined is None else refined.variance


def _find_lowest(before: float, here: float, after: float) -> float:
    """Return where the parabola through three values has its lowest point, in steps from the middle one."""
    curvature = before - 2 * here + after
    return (before - after) / (2 * curvature) if math.isfinite(curvature) and curvature > 0 else 0.0


def _align_grid(crop: Float32Array, homography: FloatArray, template: Template) -> FloatArray | None:
    """Return the pose after inverse-compositional steps; None where they do not end at the pattern."""
    here = homography
    for _ in range(_MOST_STEPS):
        patch = _sample(crop, here, template)
        solution = (template.solver @ patch).astype(float)
        gain = solution[8]
        if not gain > LEAST_CONTRAST:
            return None
        step = solution[:8] / gain
        longest_px = float(np.abs(step).max()) * template.scale_px
        if not longest_px < 0.5 * template.scale_px:
            return None
        here = _compose(here, step)
        if longest_px < _LAST_STEP_PX:
            return here if _is_pattern(patch, solution, template) else None
    return None


def _sample(crop: Float32Array, homography: FloatArray, template: Template) -> Float32Array:
    size = (template.samples, template.samples)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = cv2.warpPerspective(crop, homography @ template.grid, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(patch, dtype=np.float32).reshape(-1) * template.used


def _compose(homography: FloatArray, step: FloatArray) -> FloatArray:
    """Return the homography after the inverse of a step, to third order in it."""
    move = np.array([[step[0], step[1], step[2]], [step[3], step[4], step[5]], [step[6], step[7], 0.0]])
    back = homography @ move
    composed: FloatArray = homography - back + back @ move
    return composed


def _is_pattern(patch: Float32Array, solution: FloatArray, template: Template) -> bool:
    """Tell whether the image shows the pattern: over the whole, and in the cells that make the id."""
    normal = template.normal
    sums, count = normal @ solution, normal[9, 9]
    spread = (float(patch @ patch) - sums[9] ** 2 / count) * (normal[8, 8] - normal[8, 9] ** 2 / count)
    if not spread > 0:
        return False
    correlation = (sums[8] - sums[9] * normal[8, 9] / count) / math.sqrt(spread)
    cells = patch.reshape(template.samples, -1)[template.inner, template.inner]
    deviation = cells - cells.mean()
    length = math.sqrt(float(np.vdot(deviation, deviation)))
    inner = float(np.vdot(deviation, template.inner_pattern)) / length if length > 0 else 0.0
    return bool(correlation >= LEAST_CORRELATION and inner >= LEAST_INNER_CORRELATION)
