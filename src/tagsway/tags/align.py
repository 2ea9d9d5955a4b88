"""Measure a tag by aligning its known pattern with the image."""

import math

import numpy as np

from tagsway.model import UNKNOWN_CODING, Coding, FloatArray, GreyArray, Sighting
from tagsway.tags.coder import CoderPull
from tagsway.tags.grid import LEAST_CONTRAST, LEAST_CORRELATION, Grid, align_grid, make_grid, shows_pattern
from tagsway.tags.pose import lies_in, local_jacobian, measure_scale
from tagsway.tags.refine import Refinement, refine
from tagsway.tags.template import Template, make_template

_SURE_CORRELATION = 0.93  # no other id and no covered cells reach it: the cells need not be looked at apart
_MOST_STEPS = 6
_LAST_STEP = 4.0  # times √(σ px): what a step leaves is of its square; a longer one is followed by another, ...
_LONGEST_LAST_PX = 0.4
_TILTED = 125.0  # ... and is as many times longer as the perspective says: the derivatives are of the tag's middle
_SMALLEST_SIDE_PX = 8.0
_BLURS_PX = tuple(0.25 * 1.3**k for k in range(10))  # of the optics
_FIRST_BLUR = 3
_GRID_BLURS_PX = (0.6, 2.0)  # a grid is not particular
_SHUTTERS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # exposure over frame interval
_TELLING_TRAVEL_PX = 3.0  # in a frame interval: less blurs too little to tell the shutter
_SHUTTER_LESSONS = 4
_RESTING_TRAVEL_PX = 0.3
_RESIZED = 1.08  # a template serves sizes within this factor
_MEMORY = 32  # frames in the running ratio of the two covariances
_BLOCKS_EVERY = 8  # frames, after that
_ODD_VARIANCE = 1.5
_CODED_MEMORY = 12  # looks at blocks, where a coder's share in them changes with the motion


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
    Gauss-Newton steps on the image's own pixels (`refine`) take a good prediction to the noise: one is enough from a
    quarter of a pixel, and no pixel is resampled there, so no grid beats with another, and the noise stays white.
    From farther off, inverse-compositional steps on a grid of the pattern come first [1]_.

    Not for tags under about 12 px, nor where what is printed is not the family's own pattern.

    References
    ----------
    .. [1] S. Baker and I. Matthews, Int. J. Computer Vision 56 (2004) 221-255.
    """

    def __init__(self, family: str, tag_id: int) -> None:
        self._family = family
        self._tag_id = tag_id
        self._template: Template | None = None
        self._grids: dict[float, Grid] = {}
        self._blurred_by_px = math.inf
        self._shutter = 0.0
        self._lessons = 0
        self._log_ratio = [0.0, 0.0, 0.0]
        self._looks = 0
        self._coder = CoderPull()
        self._pull_px2 = 0.0
        self._angle_rad = 0.0
        self._variance = 0.0
        self._measured = 0

    def align(
        self,
        grey: GreyArray,
        homography: FloatArray,
        *,
        travel_px: tuple[float, float] | None = None,
        time_s: float = 0.0,
        predicted: bool = False,
        coding: Coding = UNKNOWN_CODING,
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
        time_s : float
            When the image was taken; needed where a coder made some of the images from others.
        predicted : bool
            Whether it made this one so.
        coding : Coding
            How it did that.

        Returns
        -------
        Sighting or None
            None where the pattern is not there.
        """
        scale_px = measure_scale(homography) if homography[2, 2] != 0 else math.nan
        if not _SMALLEST_SIDE_PX <= 2 * scale_px <= 2 * max(grey.shape) or not lies_in(grey, homography):
            return None
        self._learn(grey, homography, scale_px, travel_px)
        if self._template is None:
            return None
        motion = _scale(travel_px, self._shutter)
        refined = self._approach(grey, homography, self._template, motion)
        if refined is None:
            found = self._locate(grey, homography, scale_px)
            refined = None if found is None else self._approach(grey, found, self._template, motion)
        if refined is not None and self._is_odd(refined):
            refined = refine(grey, refined.homography, self._template, motion_px=motion, with_blocks=True)
        if refined is None:
            return None
        if travel_px is None:
            self._coder.interrupt()
        return self._report(refined, time_s, predicted=predicted, coding=coding)

    def _approach(
        self, grey: GreyArray, homography: FloatArray, template: Template, motion_px: tuple[float, float]
    ) -> Refinement | None:
        """Return the pose that refining ends at; None where that is not the pattern, or too far off."""
        here = homography
        for _ in range(_MOST_STEPS):
            refined = refine(grey, here, template, motion_px=motion_px, with_blocks=self._wants_blocks())
            if refined is None or not refined.gain > LEAST_CONTRAST:
                return None
            here = refined.homography
            if self._is_last(refined):
                return refined if self._is_pattern(grey, refined) else None
        return None

    def _is_last(self, refined: Refinement) -> bool:
        """Tell whether a step was so short that another one would change less than the error."""
        tilt = math.hypot(refined.homography[2, 0], refined.homography[2, 1])
        usual = min(1.0, self._variance / refined.variance) if self._measured else 1.0  # far off all of it is larger
        sigma_px = math.sqrt(max(usual * refined.plain[0], self._pull_px2))
        return refined.step_px * max(1.0, _TILTED * tilt) < min(_LAST_STEP * math.sqrt(sigma_px), _LONGEST_LAST_PX)

    def _is_pattern(self, grey: GreyArray, refined: Refinement) -> bool:
        if refined.correlation > _SURE_CORRELATION:
            return True
        grid = self._grid(measure_scale(refined.homography), _GRID_BLURS_PX[0])
        return refined.correlation > LEAST_CORRELATION and shows_pattern(grey, refined.homography, grid)

    def _locate(self, grey: GreyArray, homography: FloatArray, scale_px: float) -> FloatArray | None:
        """Return the pose to a tenth of a pixel, from a grid as sharp as pictures are, else from a blurred one."""
        for blur_px in _GRID_BLURS_PX:
            found = align_grid(grey, homography, self._grid(scale_px, blur_px))
            if found is not None:
                return found
        return None

    def _grid(self, scale_px: float, blur_px: float) -> Grid:
        grid = self._grids.get(blur_px)
        if grid is None or not 1 / _RESIZED < scale_px / grid.scale_px < _RESIZED:
            grid = make_grid(self._family, self._tag_id, scale_px=scale_px, blur_px=blur_px)
            self._grids[blur_px] = grid
        return grid

    def _make_template(self, scale_px: float, blur_px: float) -> Template:
        return make_template(self._family, self._tag_id, scale_px=scale_px, blur_px=blur_px)

    def _learn(
        self, grey: GreyArray, homography: FloatArray, scale_px: float, travel_px: tuple[float, float] | None
    ) -> None:
        """Have a template for this image: of its size, as sharp as the optics, and know the shutter if it shows.

        At rest the blur is that of the optics; it is measured again whenever the tag is much slower than before. On a
        fast frame the shutter is measured with what is known of the optics, then the optics with the shutter.
        """
        travel = math.inf if travel_px is None else math.hypot(*travel_px)
        telling = self._lessons < _SHUTTER_LESSONS and _TELLING_TRAVEL_PX < travel < math.inf
        sharper = self._blurred_by_px > _RESTING_TRAVEL_PX and travel < 0.5 * self._blurred_by_px
        found = None
        if telling or sharper or self._template is None:
            found = self._locate(grey, homography, scale_px)
        if found is not None and telling:
            blurred = self._template is None or self._blurred_by_px > _RESTING_TRAVEL_PX
            template = self._make_template(scale_px, _BLURS_PX[_FIRST_BLUR]) if blurred else self._template
            assert template is not None
            shutter = _find_shutter(grey, found, template, travel_px or (0.0, 0.0))
            if shutter is not None:
                self._lessons += 1
                self._shutter += (shutter - self._shutter) / self._lessons
                sharper = sharper or self._lessons in (1, _SHUTTER_LESSONS)
        if found is not None and (self._template is None or sharper):
            motion = _scale(travel_px, self._shutter)
            self._template = self._make_template(scale_px, self._find_blur(grey, found, scale_px, motion))
            known = travel if self._lessons == 0 else _RESTING_TRAVEL_PX
            self._blurred_by_px = max(known, _RESTING_TRAVEL_PX)
        elif self._template is not None and not 1 / _RESIZED < scale_px / self._template.scale_px < _RESIZED:
            self._template = self._make_template(scale_px, self._template.blur_px)

    def _find_blur(
        self, grey: GreyArray, homography: FloatArray, scale_px: float, motion_px: tuple[float, float]
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

    def _report(self, refined: Refinement, time_s: float, *, predicted: bool, coding: Coding) -> Sighting:
        h = refined.homography
        *white, cross = refined.plain
        blocks = [even * factor for even, factor in zip(white, self._steady(refined), strict=True)]
        place = float(h[0, 2]), float(h[1, 2]), self._unwrap(_measure_angle(h))
        pull = self._coder.measure(
            time_s,
            place,
            white=white,
            blocks=blocks,
            predicted=predicted,
            coding=coding,
            gain=refined.gain,
            side_px=2 * measure_scale(h),
        )
        self._pull_px2 = min(pull[0], pull[1])
        xx, yy, turned = (shown + hidden for shown, hidden in zip(blocks, pull, strict=True))
        cross *= math.sqrt(xx * yy / (white[0] * white[1]))
        return Sighting(
            homography=h,
            covariance_px2=np.array([[xx, cross], [cross, yy]]),
            angle_std_rad=math.sqrt(turned),
            correlation=refined.correlation,
            image_share=(blocks[0] + blocks[1]) / (xx + yy),
        )

    def _unwrap(self, angle_rad: float) -> float:
        self._angle_rad += math.remainder(angle_rad - self._angle_rad, 2 * math.pi)
        return self._angle_rad

    def _wants_blocks(self) -> bool:
        return self._measured < _MEMORY or self._measured % _BLOCKS_EVERY == 0

    def _is_odd(self, refined: Refinement) -> bool:
        """Tell whether the image differs from the pattern by more than it usually does: its noise is then no one's."""
        return refined.sandwich is None and refined.variance > _ODD_VARIANCE * self._variance

    def _steady(self, refined: Refinement) -> list[float]:
        """Return the running ratios of the variances that see correlated noise to the plain ones: of x, y and angle.

        One frame's is known to a fifth only; where it jumps (a hand over the tag) it counts at once.
        """
        self._measured += 1
        self._variance += (refined.variance - self._variance) / min(self._measured, _MEMORY)
        if refined.sandwich is None:
            return [math.exp(part) for part in self._log_ratio]
        self._looks += 1
        memory = min(self._looks, _CODED_MEMORY if self._coder.is_at_work else _MEMORY)
        pairs = zip(refined.sandwich.tolist(), refined.plain[:3], strict=True)
        ratio = [math.log(max(seen, 1e-30) / plain) for seen, plain in pairs]
        self._log_ratio = [old + (new - old) / memory for old, new in zip(self._log_ratio, ratio, strict=True)]
        return [math.exp(max(old, new - 1.0)) for old, new in zip(self._log_ratio, ratio, strict=True)]


def _measure_angle(homography: FloatArray) -> float:
    (right, _), (down, _) = local_jacobian(homography)
    return math.atan2(-down, right)


def _scale(travel_px: tuple[float, float] | None, share: float) -> tuple[float, float]:
    return (0.0, 0.0) if travel_px is None else (share * travel_px[0], share * travel_px[1])


def _find_shutter(
    grey: GreyArray, homography: FloatArray, template: Template, travel_px: tuple[float, float]
) -> float | None:
    """Return the share of the motion between two frames that blurs the image, if the pattern is seen."""
    left = [_residual(grey, homography, template, _scale(travel_px, shutter)) for shutter in _SHUTTERS]
    best = int(np.argmin(left))
    if not 0 < best < len(left) - 1:
        return _SHUTTERS[best] if math.isfinite(left[best]) else None
    # What a blur that is too long or too short leaves goes with the difference of the squares of their lengths.
    squares = np.square(_SHUTTERS[best - 1 : best + 2])
    before, after = ((left[best] - left[k]) / (squares[1] - squares[k - best + 1]) for k in (best - 1, best + 1))
    curvature = (after - before) / (squares[2] - squares[0])
    if not (math.isfinite(curvature) and curvature > 0):
        return _SHUTTERS[best]
    lowest = (squares[0] + squares[1] - before / curvature) / 2
    return math.sqrt(min(max(lowest, squares[0]), squares[2]))


def _residual(grey: GreyArray, homography: FloatArray, template: Template, motion_px: tuple[float, float]) -> float:
    """Return the variance that a template leaves; infinite where it does not fit at all."""
    refined = refine(grey, homography, template, motion_px=motion_px)
    return math.inf if refined is None else refined.variance


def _find_lowest(before: float, here: float, after: float) -> float:
    """Return where the parabola through three values has its lowest point, in steps from the middle one."""
    curvature = before - 2 * here + after
    return (before - after) / (2 * curvature) if math.isfinite(curvature) and curvature > 0 else 0.0
