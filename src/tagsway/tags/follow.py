"""Follow tags through the images of a video: align, and detect again only where that fails."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import Detection, FloatArray, Frame, GreyArray, IntArray, Notice, Sighting, TagSightings
from tagsway.tags.align import CORNERS, Aligner, find_homography, measure_scale, project
from tagsway.tags.find import find_tags, find_tags_near

_CHECK_EVERY = 500  # frames between two detections of a tag that is followed without trouble
_NEAR_TRIES = 4  # frames in a row in which a lost tag is looked for around the predicted place ...
_LONGEST_WAIT = 16  # ... then ever more rarely on the whole image, at most this many frames apart ...
_LONGEST_WAIT_UNSEEN = 64  # ... and as many for a tag that perhaps is not in this video
_MOST_SIDES_PER_S = 60.0  # speed of a payload, in sides of its tag: 12 px a frame at 200 fps is 40
_SIZE_RANGE = 1.4  # a tag that is found again has kept its size within this factor
_FORGET_SHAPE_S = 0.5  # after so long a tag is looked for at its last place, not where it was heading
_GIVEN_UP = 300  # frames after which a lost tag may come back anywhere, at any size
_SAME_PLACE = 0.5  # in sides: two detections closer than this are one tag
_CHUNK = 4096
_ROW = 17


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
        `ambiguous_tag` where an id was in the image more than once.
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
        NaN where a tag was not seen: nothing is interpolated. 136 bytes a frame and tag.

    Notes
    -----
    A tag is detected once; from then on its pose is extrapolated over the last three frames (their true times) and
    its pattern aligned from there, which tells place, identity and error at once. Where that fails, the detector
    looks around the predicted place, then on the whole image with growing pauses. What it finds must have kept its
    size and cannot have outrun a payload.
    """
    search = _Search(family)
    followers = [_Follower(search, tag_id, delay=k) for k, tag_id in enumerate(tag_ids)]
    index, time = _Rows(1), _Rows(1)
    with _one_cv2_thread():
        for frame in frames:
            index.append(np.array([frame.index]))
            time.append(np.array([frame.time_s]))
            found = [follower.follow(frame) for follower in followers]
            if any(follower.is_due for follower in followers):
                seen = search.whole(frame.grey, {follower.tag_id for follower in followers if not follower.is_held})
                found = [
                    follower.adopt(frame, seen) if sighting is None else sighting
                    for follower, sighting in zip(followers, found, strict=True)
                ]
            for follower, sighting in zip(followers, found, strict=True):
                follower.record(sighting)
    return TagTracks(
        frame=index.join()[:, 0].astype(np.int64),
        time_s=time.join()[:, 0],
        tags=tuple(follower.sightings() for follower in followers if follower.was_seen),
        detector_calls=search.calls,
        notices=tuple(notice for follower in followers for notice in follower.notices),
    )


class _Search:
    """The detector, with its calls counted."""

    def __init__(self, family: str) -> None:
        self.family = family
        self.calls = 0
        self._thorough = True

    def whole(self, grey: GreyArray, wanted: set[int]) -> tuple[Detection, ...]:
        """Return the tags in the whole image, seen thinned; in all its pixels every other time one is missing."""
        self.calls += 1
        seen = find_tags(grey, family=self.family, decimate=2.0)
        if wanted <= {tag.tag_id for tag in seen}:
            return seen
        if self._thorough:
            self.calls += 1
            seen = find_tags(grey, family=self.family)
        self._thorough = not self._thorough
        return seen

    def near(self, grey: GreyArray, corners_px: FloatArray) -> tuple[Detection, ...]:
        self.calls += 1
        return find_tags_near(grey, corners_px, family=self.family)


class _Follower:
    """One tag: where it was, where it will be, and how long it has been lost."""

    def __init__(self, search: _Search, tag_id: int, *, delay: int) -> None:
        self._search = search
        self.tag_id = tag_id
        self._aligner = Aligner(search.family, tag_id)
        self._poses: list[tuple[float, FloatArray]] = []
        self._interval_s = 0.0
        self._lost = 0
        self._wait = 1
        self._until_check = _CHECK_EVERY * (delay + 1) // (delay + 2)
        self._decoys: list[FloatArray] = []
        self._rows = _Rows(_ROW)
        self.notices: list[Notice] = []
        self.was_seen = False
        self.is_due = True

    @property
    def is_held(self) -> bool:
        """Whether the tag was seen in this frame."""
        return self._lost == 0 and self.was_seen

    def follow(self, frame: Frame) -> Sighting | None:
        """Return the tag where it is expected, and say in `is_due` whether it is to be looked for everywhere."""
        self.is_due = False
        if not self._poses:
            return self._miss()
        predicted = predict_pose(self._poses, frame.time_s)
        sighting = self._aligner.align(frame.grey, predicted, travel_px=self._travel(frame.time_s, predicted))
        if sighting is not None and self._is_plausible(sighting.corners_px, frame.time_s):
            return self._confirm(frame, sighting)
        if self._lost < _NEAR_TRIES:
            sighting = self._choose(frame, self._search.near(frame.grey, project(predicted, CORNERS)))
            if sighting is not None:
                return sighting
        return self._miss()

    def adopt(self, frame: Frame, seen: tuple[Detection, ...]) -> Sighting | None:
        """Return the tag where the detector saw it."""
        mine = [tag for tag in seen if tag.tag_id == self.tag_id]
        if not self._poses and len(mine) > 1:
            mine.sort(key=lambda tag: -_side_px(tag.corners_px))
            self._decoys = [tag.corners_px.mean(axis=0) for tag in mine[1:]]
            words = f"tag {self.tag_id} is in the image {len(mine)} times: the largest was followed"
            self.notices.append(Notice(code="ambiguous_tag", message=words))
            mine = mine[:1]
        return self._choose(frame, mine)

    def record(self, sighting: Sighting | None) -> None:
        """Keep this frame's result."""
        row = np.full(_ROW, np.nan)
        if sighting is not None:
            row[0], row[1:3], row[3:7] = sighting.correlation, sighting.centre_px, sighting.covariance_px2.ravel()
            row[7:15], row[15], row[16] = sighting.corners_px.ravel(), sighting.angle_rad, sighting.angle_std_rad
        self._rows.append(row)

    def sightings(self) -> TagSightings:
        """Return all results."""
        rows = self._rows.join()
        return TagSightings(
            tag_id=self.tag_id,
            correlation=rows[:, 0].copy(),
            centre_px=rows[:, 1:3].copy(),
            covariance_px2=rows[:, 3:7].reshape(-1, 2, 2),
            corners_px=rows[:, 7:15].reshape(-1, 4, 2),
            angle_rad=rows[:, 15].copy(),
            angle_std_rad=rows[:, 16].copy(),
        )

    def _travel(self, time_s: float, predicted: FloatArray) -> tuple[float, float] | None:
        """Return how far the tag moves in the time between the first two frames; None where that is not known."""
        last_s, last = self._poses[-1]
        self._interval_s = self._interval_s or time_s - last_s
        if len(self._poses) < 2:
            return None
        right, down = (predicted[:2, 2] - last[:2, 2]) * self._interval_s / (time_s - last_s)
        return float(right), float(down)

    def _confirm(self, frame: Frame, sighting: Sighting) -> Sighting | None:
        """Return a sighting; now and then only after the detector has read the same id at this place."""
        self._until_check -= 1
        if self._until_check <= 0:
            self._until_check = _CHECK_EVERY
            place, side = sighting.centre_px, _side_px(sighting.corners_px)
            there = [
                tag.tag_id
                for tag in self._search.near(frame.grey, sighting.corners_px)
                if np.hypot(*(tag.corners_px.mean(axis=0) - place)) < _SAME_PLACE * side
            ]
            if there and self.tag_id not in there:
                self._poses.clear()
                return self._miss()
        return self._keep(frame, sighting)

    def _choose(self, frame: Frame, seen: Iterable[Detection]) -> Sighting | None:
        """Return the nearest of the detections that can be this tag, measured."""
        mine = [
            tag
            for tag in seen
            if tag.tag_id == self.tag_id and self._is_plausible(tag.corners_px, frame.time_s) and self._is_mine(tag)
        ]
        if self._poses:
            last = self._poses[-1][1][:2, 2]
            mine.sort(key=lambda tag: float(np.hypot(*(tag.corners_px.mean(axis=0) - last))))
        for tag in mine:
            sighting = self._aligner.align(frame.grey, find_homography(tag.corners_px))
            if sighting is not None and self._is_plausible(sighting.corners_px, frame.time_s):
                return self._keep(frame, sighting)
        return None

    def _is_plausible(self, corners_px: FloatArray, time_s: float) -> bool:
        """Tell whether the tag can be here now: of its size, and no faster than a payload."""
        if not self._poses:
            return True
        last_s, pose = self._poses[-1]
        side, was = _side_px(corners_px), 2 * measure_scale(pose)
        reach = was * (1 + _MOST_SIDES_PER_S * (time_s - last_s))
        travelled = float(np.hypot(*(corners_px.mean(axis=0) - pose[:2, 2])))
        return 1 / _SIZE_RANGE < side / was < _SIZE_RANGE and travelled < reach

    def _is_mine(self, tag: Detection) -> bool:
        """Tell whether a detection is not one of the same id that stood elsewhere from the start."""
        place, side = tag.corners_px.mean(axis=0), _side_px(tag.corners_px)
        near_last = bool(self._poses) and bool(np.hypot(*(place - self._poses[-1][1][:2, 2])) < side)
        return near_last or all(np.hypot(*(place - decoy)) > _SAME_PLACE * side for decoy in self._decoys)

    def _keep(self, frame: Frame, sighting: Sighting) -> Sighting:
        if self._lost > 1:
            self._poses.clear()  # across a gap there is no velocity
        self._poses.append((frame.time_s, sighting.homography))
        del self._poses[:-3]
        self._lost, self._wait, self.is_due, self.was_seen = 0, 1, False, True
        return sighting

    def _miss(self) -> Sighting | None:
        """Return nothing, and count a frame without the tag; the pauses between two whole searches double."""
        self._lost += 1
        if self._lost > _GIVEN_UP:
            self._poses.clear()
        if self._lost >= self._wait:
            self.is_due = True
            self._wait = self._lost + min(self._lost, _LONGEST_WAIT if self.was_seen else _LONGEST_WAIT_UNSEEN)
        return None


class _Rows:
    """Rows of numbers that grow chunk by chunk."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._chunks: list[FloatArray] = []
        self._count = 0

    def append(self, row: FloatArray) -> None:
        place = self._count % _CHUNK
        if place == 0:
            self._chunks.append(np.empty((_CHUNK, self._width)))
        self._chunks[-1][place] = row
        self._count += 1

    def join(self) -> FloatArray:
        """Return all rows, shape (n, width)."""
        if not self._chunks:
            return np.empty((0, self._width))
        return np.concatenate(self._chunks)[: self._count]


def predict_pose(poses: Sequence[tuple[float, FloatArray]], time_s: float) -> FloatArray:
    """Return the pose at a time, extrapolated through the last ones.

    Parameters
    ----------
    poses : sequence of (time in s, homography of shape (3, 3))
        Up to three, of rising times, each homography with last element 1.
    time_s : float
        After the last of them.

    Returns
    -------
    ndarray, shape (3, 3)
        Of the polynomial through them (Lagrange); of a line where the time is farther off than they span, and the last
        one where it is much farther.
    """
    last_s, last = poses[-1]
    ahead = time_s - last_s
    if len(poses) == 1 or ahead > _FORGET_SHAPE_S or ahead > 8 * (last_s - poses[0][0]):
        return last
    used = poses if ahead <= last_s - poses[0][0] else poses[-2:]
    times = [pose[0] for pose in used]
    predicted = np.zeros((3, 3))
    for k, (own, pose) in enumerate(used):
        weight = 1.0
        for j, other in enumerate(times):
            if j != k:
                weight *= (time_s - other) / (own - other)
        predicted += weight * pose
    return predicted


def _side_px(corners_px: FloatArray) -> float:
    """Return the side of a square of the same area."""
    x, y = corners_px[:, 0], corners_px[:, 1]
    return float(np.sqrt(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2))


@contextmanager
def _one_cv2_thread() -> Iterator[None]:
    """Keep OpenCV to one thread: its images here are small, and the decoder needs the other cores."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
