"""Images that a file holds twice, each time with a stamp of its own."""

from dataclasses import replace

import numpy as np

from tagsway.model import BoolArray, FloatArray, IntArray, Notice, Sightings, TagSightings

_SURE = 5.0
"""Standard errors beyond which a tag has moved; it stands within half of that."""

_LEAST_PX = 0.25
"""A coder repeats the image of a slower motion too, and that is a measurement."""

_SPEED_SHARE = 0.5
"""Of the speed before and after, that is moved on by over a repeated image; less is a stop that the image shows."""


def drop_repeats(sightings: Sightings, repeated: BoolArray) -> tuple[Sightings, tuple[Notice, ...]]:
    """Return sightings without those in images that a file holds once more where the camera took none.

    Parameters
    ----------
    sightings : Sightings
        Of all frames.
    repeated : ndarray of bool, shape (n,)
        Frames whose image seems to be the one before.

    Returns
    -------
    sightings : Sightings
        NaN in such frames, which are counted in `video.duplicated`.
    notices : tuple of Notice
        `repeated_images` where there are any.

    Notes
    -----
    A coder also repeats the image of a scene at rest, and that is a measurement. An image is no new one where every
    tag stands as in the one before, but in the next new one has moved on at the speed that it has before and after:
    |Δp| > 5 σ and 0.25 px a frame from the last new image to the next, and |Δp| / Δt at least half the lower of the
    speeds beside, all three in one direction: where a swing turns round, a coder repeats what hardly moves.
    """
    new = np.flatnonzero(~repeated)
    if len(new) == len(repeated) or len(new) < 4:
        return sightings, ()
    time = sightings.time_s[new]
    moved = np.zeros(len(new) - 1, dtype=bool)
    for tag in sightings.tags:
        moved |= _moved_on(time, tag.centre_px[new], tag.covariance_px2[new], np.diff(new))
    held = np.repeat(np.append(moved, False), np.diff(np.append(new, len(repeated))))
    lost = np.concatenate([np.zeros(len(repeated) - len(held), dtype=bool), held]) & repeated
    for tag in sightings.tags:
        lost[1:] &= ~_went(tag)
    count = int(np.count_nonzero(lost))
    if count == 0:
        return sightings, ()
    tags = tuple(_blank(tag, lost) for tag in sightings.tags)
    video = replace(sightings.video, duplicated=sightings.video.duplicated + count)
    words = (
        f"{count} of {len(repeated)} frames show the image before them once more, as where a recorder fills up an even "
        "rate: they were left out; the other frames' times may be off by up to a frame: use the file as the camera "
        "wrote it"
    )
    return replace(sightings, tags=tags, video=video), (Notice(code="repeated_images", message=words),)


def _blank(tag: TagSightings, lost: BoolArray) -> TagSightings:
    """Return a tag's sightings without those of some frames."""

    def keep(values: FloatArray) -> FloatArray:
        return np.where(lost.reshape(-1, *(1,) * (values.ndim - 1)), np.nan, values)

    return replace(
        tag,
        centre_px=keep(tag.centre_px),
        covariance_px2=keep(tag.covariance_px2),
        corners_px=keep(tag.corners_px),
        angle_rad=keep(tag.angle_rad),
        angle_std_rad=keep(tag.angle_std_rad),
        correlation=keep(tag.correlation),
    )


def _went(tag: TagSightings) -> BoolArray:
    """Return in which frames, but the first, a tag is seen elsewhere than in the one before, shape (n - 1,)."""
    way = np.hypot(*np.diff(tag.centre_px, axis=0).T)
    variance = np.trace(tag.covariance_px2, axis1=1, axis2=2)
    went: BoolArray = way > _SURE / 2 * np.sqrt(variance[1:] + variance[:-1])
    return went


def _moved_on(time_s: FloatArray, centre_px: FloatArray, covariance_px2: FloatArray, frames: IntArray) -> BoolArray:
    """Return after which of the new images, but the last, the tag is seen to have gone on moving; shape (n - 1,)."""
    step = np.diff(centre_px, axis=0)
    way = np.hypot(*step.T)
    variance = np.trace(covariance_px2, axis1=1, axis2=2)
    speed = way / np.diff(time_s)
    on = np.sum(step[1:] * step[:-1], axis=1) > 0
    before, after = np.append(np.nan, speed[:-1]), np.append(speed[1:], np.nan)
    sure = way / frames > np.maximum(_SURE * np.sqrt(variance[1:] + variance[:-1]), _LEAST_PX)
    sure = sure & np.append(False, sure[:-1] & on) & np.append(sure[1:] & on, False)
    steady: BoolArray = sure & (speed > _SPEED_SHARE * np.fmin(before, after))
    return steady
