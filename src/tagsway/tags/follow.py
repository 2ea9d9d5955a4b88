"""Follow tags through the images of a video: align, and detect again only where that fails."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import Detection, FloatArray, Frame, GreyArray, IntArray, Notice, Sighting, TagSightings
from tagsway.tags.find import find_tags, find_tags_near, sharpen
from tagsway.tags.follower import Follower
from tagsway.tags.record import SightingRecord

_FIRST_CHECKS = 500  # frames within which each tag is checked for the first time, one after the other
_FIRST_LOOK = 512  # frame of the first look at the whole image for a second tag of the same id; then twice as late
_THOROUGH_EVERY = 3  # of the searches of a whole image that miss a tag, one looks at all its pixels ...
_ENLARGED_EVERY = 12  # ... and one at an enlarged image, and one at a sharpened one
_SMALL_PX = 20.0  # the side of a tag that is looked for in an enlarged part
_MOST_ALIKE = 4  # tags of one id that are followed
_FEWEST_SEEN = 0.1  # of what the longest of them was seen: less is no rival
_AT_REST = 0.1  # sides that a tag moves, rms: less may be the camera


@dataclass(frozen=True, slots=True, kw_only=True)
class TagTracks:
    """What following gave; with a `VideoInfo` it makes a `Sightings`.

    Parameters
    ----------
    frame : ndarray of int, shape (n,)
        Index of each frame.
    time_s : ndarray, shape (n,)
        Time of each frame.
    tags : tuple of TagSightings
        One for each wanted tag that was seen at all, in the order in which they were asked for.
    detector_calls : int
        How often the detector ran, on whole images and on parts.
    notices : tuple of Notice
        `ambiguous_tag` where an id was in the video more than once.
    """

    frame: IntArray
    time_s: FloatArray
    tags: tuple[TagSightings, ...]
    detector_calls: int
    notices: tuple[Notice, ...]


def follow_tags(frames: Iterable[Frame], *, family: str, tag_ids: Sequence[int]) -> TagTracks:
    """Return where the wanted tags are in every frame.

    Parameters
    ----------
    frames : iterable of Frame
        In the order of time; each is looked at once and let go.
    family : str
        Of all tags.
    tag_ids : sequence of int
        The wanted ones, all different.

    Returns
    -------
    TagTracks
        NaN where a tag was not seen whole: nothing is interpolated. 136 bytes a frame and tag.

    Notes
    -----
    A tag is detected once; from then on its pose is extrapolated over the last three frames (their true times) and
    its pattern aligned from there, which tells place, identity and error at once. Where that fails, the detector
    looks around the predicted place, then on the whole image with growing pauses. What it finds must have kept its
    size and cannot have outrun a payload. A tag that is covered in part is followed, but its place is not believed.

    Where an id is in the image more than once, each is followed, and the one that moved is the tag.
    """
    search = _Search(family)
    wanted = [
        _Wanted(search, tag_id, first_check=_FIRST_CHECKS * (k + 1) // (len(tag_ids) + 1))
        for k, tag_id in enumerate(tag_ids)
    ]
    index, time = array("q"), array("d")
    next_look = _FIRST_LOOK
    with _one_cv2_thread():
        for frame in frames:
            index.append(frame.index)
            time.append(frame.time_s)
            missing = [tag for tag in wanted if tag.follow(frame)]
            if missing or len(index) == next_look:
                seen = search.whole(frame.grey, {tag.tag_id for tag in missing if tag.may_be_small})
                for tag in wanted:
                    tag.look(frame, seen)
            if len(index) == next_look:
                next_look *= 2
            for tag in wanted:
                tag.record()
            del frame
    picked = [tag.pick() for tag in wanted]
    return TagTracks(
        frame=np.array(index, dtype=np.int64),
        time_s=np.array(time, dtype=np.float64),
        tags=tuple(record.join() for record, _ in picked if record.seen),
        detector_calls=search.calls,
        notices=tuple(notice for _, notice in picked if notice is not None),
    )


class _Search:
    """The detector, with its calls counted."""

    def __init__(self, family: str) -> None:
        self.family = family
        self.calls = 0
        self._misses = 0

    def whole(self, grey: GreyArray, small: set[int]) -> tuple[Detection, ...]:
        """Return the tags in the image, seen thinned; now and then in all its pixels where a small one is missed."""
        self.calls += 1
        seen = find_tags(grey, family=self.family, decimate=2.0)
        if small <= {tag.tag_id for tag in seen}:
            return seen
        if self._misses % _THOROUGH_EVERY == 0:
            self.calls += 1
            seen = find_tags(grey, family=self.family)
        elif self._misses % _ENLARGED_EVERY == 1:
            self.calls += 1
            seen = find_tags(grey, family=self.family, decimate=0.5)
        elif self._misses % _ENLARGED_EVERY == 2:
            self.calls += 1
            sharp = find_tags(sharpen(grey), family=self.family)
            # but for a bit, clutter that is sharpened is a tag of a small family
            seen = tuple(tag for tag in sharp if tag.hamming == 0)
        self._misses += 1
        return seen

    def near(self, grey: GreyArray, corners_px: FloatArray) -> tuple[Detection, ...]:
        """Return the tags around a place."""
        self.calls += 1
        decimate = 0.5 if np.ptp(corners_px, axis=0).max() < _SMALL_PX else 1.0
        return find_tags_near(grey, corners_px, family=self.family, decimate=decimate)


class _Wanted:
    """One of the wanted ids: a follower, and as many again as there are other tags of the same id."""

    def __init__(self, search: _Search, tag_id: int, *, first_check: int) -> None:
        self.tag_id = tag_id
        self._search = search
        self._followers = [Follower(search.near, search.family, tag_id, first_check=first_check)]
        self._now: list[Sighting | None] = [None]

    def follow(self, frame: Frame) -> bool:
        """Follow the id's tags, and tell whether one is to be looked for on the whole image."""
        self._now = [follower.follow(frame) for follower in self._followers]
        return any(follower.is_due for follower in self._followers)

    @property
    def may_be_small(self) -> bool:
        """Whether one that is missed may be too small for a search that thins the image."""
        return any(follower.may_be_small and not follower.is_held for follower in self._followers)

    def look(self, frame: Frame, seen: Iterable[Detection]) -> None:
        """Take up what was seen of this id: lost tags first, then tags that nobody follows yet."""
        mine = sorted((tag for tag in seen if tag.tag_id == self.tag_id), key=_negative_area)
        for k, follower in enumerate(self._followers):
            if not follower.is_held:
                _, self._now[k] = follower.choose(frame, self._unfollowed(mine, besides=follower))
        for tag in self._unfollowed(mine):
            if len(self._followers) < _MOST_ALIKE:
                missed = self._followers[0].record.count
                rival = Follower(self._search.near, self._search.family, self.tag_id, missed=missed)
                found, sighting = rival.choose(frame, [tag])
                if found:
                    self._followers.append(rival)
                    self._now.append(sighting)

    def record(self) -> None:
        """Keep this frame's results."""
        for follower, sighting in zip(self._followers, self._now, strict=True):
            follower.record.append(sighting)

    def pick(self) -> tuple[SightingRecord, Notice | None]:
        """Return the tag that moved most, else the largest; and say where there was a choice."""
        records = [follower.record for follower in self._followers]
        most = max(record.seen for record in records)
        records = [record for record in records if record.seen > _FEWEST_SEEN * most]
        if len(records) < 2:
            return (records or [self._followers[0].record])[0], None
        motions = [record.measure_motion() for record in records]
        moved = max(range(len(records)), key=lambda k: motions[k][0])
        largest = max(range(len(records)), key=lambda k: motions[k][1])
        moves = motions[moved][0] > _AT_REST * motions[moved][1]
        words = f"tag {self.tag_id} is in the video {len(records)} times: the one that moved most was followed"
        if not moves:
            words = f"tag {self.tag_id} is in the video {len(records)} times, none moving: the largest was followed"
        return records[moved if moves else largest], Notice(code="ambiguous_tag", message=words)

    def _unfollowed(self, mine: Sequence[Detection], *, besides: Follower | None = None) -> list[Detection]:
        others = [follower for follower in self._followers if follower is not besides]
        return [tag for tag in mine if not any(follower.is_at(tag) for follower in others)]


def _negative_area(tag: Detection) -> float:
    (right, down), (left, up) = tag.corners_px[2] - tag.corners_px[0], tag.corners_px[3] - tag.corners_px[1]
    return -abs(float(right * up - down * left))


@contextmanager
def _one_cv2_thread() -> Iterator[None]:
    """Keep OpenCV to one thread: its images here are small, and the decoder needs the other cores."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
