"""What a coder leaves of a tag's motion: images that are made from others keep the others' errors."""

import math
from collections.abc import Sequence

from tagsway.tags.scatter import Scatter

_UNEVEN = math.exp(0.1)  # the blocks of raw images stay below, by chance
_PULLED_TOGETHER = (11.0, 11.0, 2.5)  # variance of what all blocks share, over what their differences show
_SLOW_PX = 0.4  # an image: faster motion is coded anew in every image, with other errors each time ...
_SLOW_ALONG_PX = 1.5  # ... but along its way with like ones: the vectors of a steady motion are as wrong in each
_BEHIND = 0.13  # to a pixel of the tag's side: variance, along its way, of a lag that all of a tag has in common ...
_MOST_HELD = 3.0  # standard deviations: beyond it noise helps no more
_APART = (3.7, 3.7, 3.0)  # ... and of what its blocks have each for itself, x, y and angle
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

    What does show is how the blocks differ: the variance of the place from the residual's sums over blocks exceeds the
    one of white noise, w, by u. The common error is as many times larger as blocks are pulled together, and more so
    where noise hides how they differ, on small tags and at fine quantisers: c (u + √(u w)). c was found on rendered
    films in H.264, HEVC and VP9, tags of 20 to 90 px, crf 12 to 30, and held against others. The error cannot exceed
    the way since the last image that was coded by itself, and is mended while the tag rests. In fast motion it is
    another one every few images, and `Scatter` measures it; least so along the way, where vectors err alike.

    A coder that moves blocks by whole or half pixels (x264's preset "ultrafast", MPEG-4 Part 2) leaves the rest of each
    motion to the corrections, and none is made that is smaller than its quantiser's step: a slow tag lags behind by as
    much as changes the image by that, all of its blocks alike, so that nothing shows it, and a fast one in each of its
    blocks by another bit of it. Hence the step itself counts, h times the residual's deviation. The fast tag's error is
    that of noise of twice the step. The slow one's does not shrink as tags grow, as noise's does; and noise helps
    coefficients over the step, so the lag grows faster than h. A tag that is held so does not seem to move: its way of
    late counts, also from before an image that was coded by itself. Found on tags of 40 to 90 px, noise of 2 and 3,
    three to six quantisers, and held against others: the variance is rather too large, on a slow line at most three
    times too small.

    Not for x265 at crf 28: with its large blocks and bursts of error the variance is 1.3 to 2 times too small. Nor for
    a small tag at a fine quantiser whose blocks differ by no more than noise does. The angle of a tag that does not
    turn is stated up to four times too large where quantisers are coarse.

    Where each image was coded by itself the blocks show all, unless it was taken from a film that was not: then the
    scatter counts.
    """

    def __init__(self) -> None:
        self._scatter = Scatter()
        self._last_px: tuple[float, float] | None = None
        self._since_image, self._lately = _Way(), _Way()
        self._speed_px = 0.0
        self._heading_px2 = [0.0, 0.0]
        self.is_at_work = False

    def measure(
        self,
        time_s: float,
        place: Sequence[float],
        *,
        white: Sequence[float],
        blocks: Sequence[float],
        predicted: bool,
        held: float = 0.0,
        side_px: float = 0.0,
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
        held : float
            Step of a coarse coder's quantiser, in standard deviations of the residual.
        side_px : float
            Of the tag.
        """
        self.is_at_work = self.is_at_work or predicted
        uneven = [max(one - _UNEVEN * even, 0.0) for one, even in zip(blocks, white, strict=True)]
        if not (self.is_at_work or (uneven[0] > 0 and uneven[1] > 0)):
            return [0.0, 0.0, 0.0]
        self._scatter.add(time_s, place, blocks)
        shown = white if self.is_at_work else blocks
        scatter = [max(one - even, 0.0) for one, even in zip(self._scatter.variance.tolist(), shown, strict=True)]
        if not self.is_at_work:
            return scatter
        self._move((float(place[0]), float(place[1])), predicted=predicted)
        fast, steady = (1 + (self._speed_px / slow) ** 2 for slow in (_SLOW_PX, _SLOW_ALONG_PX))
        right, down = (one / max(sum(self._heading_px2), 1e-30) for one in self._heading_px2)
        shares = (*(along / steady + (1 - along) / fast for along in (right, down)), 1.0)
        common = [
            share * together * (least + math.sqrt(least * even))
            for share, together, least, even in zip(shares, _PULLED_TOGETHER, uneven, white, strict=True)
        ]
        pulled = _limit([max(one, more) for one, more in zip(scatter, common, strict=True)], self._since_image)
        if held > 0:
            behind = _BEHIND * held**2 * min(held, _MOST_HELD) * side_px / fast
            steps = [apart * held**2 + behind * along for apart, along in zip(_APART, (right, down, 0.0), strict=True)]
            lags = _limit([step * even for step, even in zip(steps, white, strict=True)], self._lately)
            pulled = [max(one, lag) for one, lag in zip(pulled, lags, strict=True)]
        return [max(one, _FROZEN * least) for one, least in zip(pulled, uneven, strict=True)]

    def interrupt(self) -> None:
        """Forget the last places, after a gap."""
        self._scatter.interrupt()
        self._last_px = None

    def _move(self, centre_px: tuple[float, float], *, predicted: bool) -> None:
        if self._last_px is not None:
            step_px = math.dist(centre_px, self._last_px)
            self._speed_px += (step_px - self._speed_px) / _SPEED_MEMORY
            for axis, (was, there) in enumerate(zip(self._last_px, centre_px, strict=True)):
                self._heading_px2[axis] += ((there - was) ** 2 - self._heading_px2[axis]) / _REST_MEMORY
        self._last_px = centre_px
        if not predicted:
            self._since_image = _Way()
        self._since_image.go_on(centre_px)
        self._lately.go_on(centre_px)


class _Way:
    """How far a tag has come, forgotten as it rests."""

    def __init__(self) -> None:
        self._start_px: tuple[float, float] | None = None
        self.square_px2 = 0.0

    def go_on(self, centre_px: tuple[float, float]) -> None:
        (x, y), (to_x, to_y) = self._start_px or centre_px, centre_px
        self._start_px = x + (to_x - x) / _REST_MEMORY, y + (to_y - y) / _REST_MEMORY
        self.square_px2 = max(self.square_px2 * (1 - 2 / _REST_MEMORY), math.dist(centre_px, self._start_px) ** 2)


def _limit(variances: list[float], way: _Way) -> list[float]:
    """Return variances of x, y and angle of which those of the place are no larger than a way."""
    reached = min(way.square_px2 / max(variances[0], variances[1], 1e-30), 1.0)
    return [reached * one for one in variances]
