"""One tag through the images: where it was, where it will be, and how long it has been lost."""

import math
from collections.abc import Callable, Iterable

from tagsway.model import Detection, FloatArray, Frame, GreyArray, Sighting
from tagsway.tags.align import Aligner
from tagsway.tags.hidden import CoverCheck
from tagsway.tags.pose import CORNERS, find_homography, measure_scale, project
from tagsway.tags.predict import Pose, predict_pose
from tagsway.tags.record import SightingRecord

Search = Callable[[GreyArray, FloatArray], tuple[Detection, ...]]
"""Finds the tags of one image around four corners."""

_CHECK_EVERY = 500  # frames between two detections of a tag that is followed without trouble
_NEAR_TRIES = 4  # frames in a row in which a lost tag is looked for around the predicted place ...
_LONGEST_WAIT = 8  # ... then ever more rarely on the whole image, at most this many frames apart ...
_LONGEST_WAIT_UNSEEN = 128  # ... and as many for a tag that perhaps is not in this video
_MOST_SIDES_PER_S = 60.0  # speed of a payload, in sides of its tag: 12 px a frame at 200 fps is 40
_MOST_SIDES_PER_S2 = 2000.0  # what a prediction is wrong by, over the time squared: 6 g for a tag of 30 mm
_SLACK_SIDES = 0.4
_SIZE_RANGE = 1.4  # a tag that is found again has kept its size within this factor
_GIVEN_UP = 300  # frames after which a lost tag may come back anywhere, at any size
_LARGE_PX = 40.0  # a side that is not missed in an image of half the size
_SAME_PLACE = 0.5  # in sides: two detections closer than this are one tag
_DROP = 0.001  # of the correlation, below what is usual, that makes a look at the cells worth its time ...
_DROP_SPREADS = 4.0  # ... and that many times what it varies by
_MEMORY = 16  # frames in the running correlation
_LEARN_EVERY = 64  # frames between two looks at the uncovered tag
_MOST_DOUBTED = 60  # frames after which a tag that was never seen whole is taken as it is


class Follower:
    """Follows one tag.

    Parameters
    ----------
    search : callable
        The detector, for a part of an image.
    family : str
        Of the tag.
    tag_id : int
        Its number.
    missed : int
        Frames that have gone by without it.
    first_check : int
        After how many frames the detector is asked for the first time whether this still is the tag.
    """

    def __init__(self, search: Search, family: str, tag_id: int, *, missed: int = 0, first_check: int = 250) -> None:
        self.tag_id = tag_id
        self.record = SightingRecord(tag_id, missed=missed)
        self.is_due = True
        self._search = search
        self._family = family
        self._aligner = Aligner(family, tag_id)
        self._cover = CoverCheck(family, tag_id)
        self._poses: list[Pose] = []
        self._side_px = math.nan
        self._interval_s = 0.0
        self._lost = 0
        self._wait = 1
        self._until_check = first_check
        self._until_learning = 0
        self._doubted, self._was_whole = 0, False
        self._correlation, self._spread = 0.0, 0.0

    @property
    def is_held(self) -> bool:
        """Whether it is known where the tag is, be it covered in part."""
        return self._lost == 0 and bool(self._poses)

    @property
    def may_be_small(self) -> bool:
        """Whether the tag may be too small for a search that thins the image."""
        return not self._side_px > _LARGE_PX

    @property
    def place_px(self) -> tuple[float, float] | None:
        """Where the tag was last; None where it was never found, or given up."""
        return _centre(self._poses[-1][1]) if self._poses else None

    def is_at(self, tag: Detection) -> bool:
        """Tell whether a detection shows the tag that is followed here."""
        place = self.place_px
        return place is not None and _distance(_middle(tag.corners_px), place) < _SAME_PLACE * self._side_px

    def follow(self, frame: Frame) -> Sighting | None:
        """Return the tag where it is expected, and say in `is_due` whether it is to be looked for everywhere."""
        self.is_due = False
        if not self._poses:
            self._miss()
            return None
        predicted = predict_pose(self._poses, frame.time_s)
        travel = self._travel(frame.time_s, predicted)
        sighting = self._aligner.align(
            frame.grey,
            predicted,
            travel_px=travel,
            time_s=frame.time_s,
            predicted=frame.predicted,
            coding=frame.coding,
        )
        if sighting is not None and self._can_be(sighting.homography, frame.time_s, predicted):
            if self._is_still_read(frame, sighting):
                return self._keep(frame, sighting)
            self._poses.clear()
            self._miss()
            return None
        if self._lost < _NEAR_TRIES:
            found, sighting = self.choose(frame, self._search(frame.grey, project(predicted, CORNERS)))
            if found:
                return sighting
        self._miss()
        return None

    def choose(self, frame: Frame, seen: Iterable[Detection]) -> tuple[bool, Sighting | None]:
        """Take up the nearest of the detections that can be this tag.

        Parameters
        ----------
        frame : Frame
            The image.
        seen : iterable of Detection
            What the detector saw in it.

        Returns
        -------
        bool
            Whether the tag was found.
        Sighting or None
            Its place; None where it is covered in part.
        """
        mine = [tag for tag in seen if tag.tag_id == self.tag_id]
        predicted = predict_pose(self._poses, frame.time_s) if self._poses else None
        if predicted is not None:
            heading = _centre(predicted)
            mine.sort(key=lambda tag: _distance(_middle(tag.corners_px), heading))
        for tag in mine:
            start = find_homography(tag.corners_px)
            if self._can_be(start, frame.time_s, predicted):
                sighting = self._aligner.align(
                    frame.grey,
                    start,
                    time_s=frame.time_s,
                    predicted=frame.predicted,
                    coding=frame.coding,
                )
                if sighting is not None and self._can_be(sighting.homography, frame.time_s, predicted):
                    return True, self._keep(frame, sighting)
        return False, None

    def _travel(self, time_s: float, predicted: FloatArray) -> tuple[float, float] | None:
        """Return how far the tag moves in the time between the first two frames; None where that is not known."""
        last_s, last = self._poses[-1]
        self._interval_s = self._interval_s or time_s - last_s
        if len(self._poses) < 2:
            return None
        share = self._interval_s / (time_s - last_s)
        (x, y), (was_x, was_y) = _centre(predicted), _centre(last)
        return (x - was_x) * share, (y - was_y) * share

    def _can_be(self, homography: FloatArray, time_s: float, predicted: FloatArray | None) -> bool:
        """Tell whether the tag can be here now: of its size, and no farther off than a payload's speed takes it."""
        if predicted is None:
            return True
        past_s = time_s - self._poses[-1][0]
        reach = _MOST_SIDES_PER_S * past_s
        if len(self._poses) == 1:
            reach += 1.0
        else:
            reach = _SLACK_SIDES + min(reach, _MOST_SIDES_PER_S2 * past_s**2)
        change = 2 * measure_scale(homography) / self._side_px
        near = _distance(_centre(homography), _centre(predicted)) < reach * self._side_px
        return near and 1 / _SIZE_RANGE < change < _SIZE_RANGE

    def _is_still_read(self, frame: Frame, sighting: Sighting) -> bool:
        """Tell, now and then, whether the detector reads no other id at this place."""
        self._until_check -= 1
        if self._until_check > 0:
            return True
        self._until_check = _CHECK_EVERY
        place = _centre(sighting.homography)
        there = [
            tag.tag_id
            for tag in self._search(frame.grey, sighting.corners_px)
            if _distance(_middle(tag.corners_px), place) < _SAME_PLACE * self._side_px
        ]
        return not there or self.tag_id in there

    def _keep(self, frame: Frame, sighting: Sighting) -> Sighting | None:
        """Go on from here; return the sighting unless the tag is covered in part."""
        if self._lost > 1:
            self._poses.clear()  # across a gap there is no velocity
        self._poses.append((frame.time_s, sighting.homography))
        if len(self._poses) > 3:
            del self._poses[0]
        self._side_px = 2 * measure_scale(sighting.homography)
        self._lost, self._wait, self.is_due = 0, 1, False
        return sighting if self._is_whole(frame, sighting) else None

    def _is_whole(self, frame: Frame, sighting: Sighting) -> bool:
        """Tell whether nothing covers a part of the tag: the cells are looked at where the correlation has dropped."""
        drop = self._correlation - sighting.correlation
        if not self._cover.knows_tag or drop > _DROP + _DROP_SPREADS * self._spread:
            self._doubted += 1
            always = self._doubted > _MOST_DOUBTED
            if always and self._cover.knows_tag:
                self._cover = CoverCheck(self._family, self.tag_id)  # light or focus may have changed for good
                self._until_learning = 0
            if (self._was_whole or not always) and self._cover.is_covered(frame.grey, sighting.homography):
                return False
        self._doubted, self._was_whole = 0, True
        if self._cover.knows_tag:
            self._correlation -= drop / _MEMORY
            self._spread += (abs(drop) - self._spread) / _MEMORY
        else:
            self._correlation = sighting.correlation
        self._until_learning -= 1
        if self._until_learning < 0:
            self._until_learning = _LEARN_EVERY
            self._cover.learn(frame.grey, sighting.homography)
        return True

    def _miss(self) -> None:
        """Count a frame without the tag; the pauses between two whole searches double."""
        self._lost += 1
        if self._lost > _GIVEN_UP:
            self._poses.clear()
        if self._lost >= self._wait:
            self.is_due = True
            longest = _LONGEST_WAIT if self._poses else _LONGEST_WAIT_UNSEEN
            self._wait = self._lost + min(self._lost, longest)


def _centre(homography: FloatArray) -> tuple[float, float]:
    return float(homography[0, 2]), float(homography[1, 2])


def _middle(corners_px: FloatArray) -> tuple[float, float]:
    x, y = (sum(column) / 4 for column in zip(*corners_px.tolist(), strict=True))
    return x, y


def _distance(one: tuple[float, float], other: tuple[float, float]) -> float:
    return math.hypot(one[0] - other[0], one[1] - other[1])
