"""What a coder leaves of a tag's motion: images that are made from others keep the others' errors."""

import math
from collections.abc import Sequence

from tagsway.tags.scatter import Scatter

_UNEVEN = math.exp(0.1)  # the blocks of raw images stay below, by chance
_PULLED_TOGETHER = (15.0, 15.0, 4.0)  # variance of what all blocks share, over what their differences show
_SLOW_PX = 0.4  # an image: faster motion is coded anew in every image, with other errors each time
_FROZEN = 2.0  # as above, of an image that was coded by itself
_SPEED_MEMORY = 4  # images
_REST_MEMORY = 40  # images: after so many at rest a coder has corrected what it left


class CoderPull:
    """How far a coder may hold a tag back.

    Notes
    -----
    H.264, HEVC and their like make an image from the one before: blocks are moved by a vector and corrected only where
    that is worth the bits. What is not worth them stays as an error of the place, up to some hundredths of a pixel, and
    lasts: a tag that starts lags behind its motion, one that stops is drawn short of its place. Neighbouring blocks
    share their vectors, so most of that error is common to all of a tag, where no residual of the image shows it.

    What does show is how the blocks differ: the variance v of the place from the residual's sums over blocks exceeds
    the one of white noise, w. The common error is as many times larger as blocks are pulled together, c (v - w): c was
    found on rendered films, and is the same within a third for tags of 35 to 90 px, contrasts of 80 to 160 grey levels,
    noise of 1 to 8, quantisers from 20 to 40, H.264 and HEVC. It cannot exceed the way since the last image that was
    coded by itself, and is mended while the tag rests. In fast motion the error is another one every few images, and
    `Scatter` measures it.

    Too small for a coder that moves blocks by whole or half pixels (x264's preset "ultrafast", MPEG-4 Part 2). Where
    each image was coded by itself the blocks show all, unless it was taken from a film that was not: then the scatter
    counts.
    """

    def __init__(self) -> None:
        self._scatter = Scatter()
        self._start_px: tuple[float, float] | None = None
        self._last_px: tuple[float, float] | None = None
        self._way_px2 = 0.0
        self._speed_px = 0.0
        self.is_at_work = False

    def measure(
        self, time_s: float, place: Sequence[float], *, white: Sequence[float], blocks: Sequence[float], predicted: bool
    ) -> list[float]:
        """Return the variances of x, y and angle that a coder adds to those that the image shows.

        Parameters
        ----------
        time_s : float
            When the image was taken; later than the one before.
        place : sequence of 3 float
            Centre (x, y in px) and angle (rad).
        white, blocks : sequence of 3 float
            Variances of these for white noise of the residual's size, and from the residual's sums over blocks.
        predicted : bool
            Whether the image was made from others.
        """
        self.is_at_work = self.is_at_work or predicted
        uneven = [max(shown - _UNEVEN * even, 0.0) for shown, even in zip(blocks, white, strict=True)]
        if not (self.is_at_work or (uneven[0] > 0 and uneven[1] > 0)):
            return [0.0, 0.0, 0.0]
        self._scatter.add(time_s, place, blocks)
        scatter = self._scatter.variance.tolist()
        if not self.is_at_work:
            return [max(one - shown, 0.0) for one, shown in zip(scatter, blocks, strict=True)]
        self._move((float(place[0]), float(place[1])), predicted=predicted)
        fast = 1 + (self._speed_px / _SLOW_PX) ** 2
        shares = _PULLED_TOGETHER[0] / fast, _PULLED_TOGETHER[1] / fast, _PULLED_TOGETHER[2]
        pulled = [max(one, share * least) for one, share, least in zip(scatter, shares, uneven, strict=True)]
        reached = min(self._way_px2 / max(pulled[0], pulled[1], 1e-30), 1.0)
        return [max(reached * one, _FROZEN * least) for one, least in zip(pulled, uneven, strict=True)]

    def interrupt(self) -> None:
        """Forget the last places, after a gap."""
        self._scatter.interrupt()
        self._last_px = None

    def _move(self, centre_px: tuple[float, float], *, predicted: bool) -> None:
        if self._last_px is not None:
            step_px = math.dist(centre_px, self._last_px)
            self._speed_px += (step_px - self._speed_px) / _SPEED_MEMORY
        self._last_px = centre_px
        if self._start_px is None or not predicted:
            self._start_px, self._way_px2 = centre_px, 0.0
        (x, y), (to_x, to_y) = self._start_px, centre_px
        self._start_px = x + (to_x - x) / _REST_MEMORY, y + (to_y - y) / _REST_MEMORY
        self._way_px2 = max(self._way_px2 * (1 - 2 / _REST_MEMORY), math.dist(centre_px, self._start_px) ** 2)
