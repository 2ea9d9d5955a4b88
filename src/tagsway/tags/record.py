"""What following leaves behind: a row of numbers for every frame, in memory that grows chunk by chunk."""

import numpy as np

from tagsway.model import FloatArray, Sighting, TagSightings
from tagsway.model.tags import angles_of, corners_of

_CHUNK = 4096
_WIDTH = 14


class SightingRecord:
    """The sightings of one tag, frame after frame: 112 bytes each.

    Parameters
    ----------
    tag_id : int
        Its number in the family.
    missed : int
        Frames that have gone by without it.
    """

    def __init__(self, tag_id: int, *, missed: int = 0) -> None:
        self._tag_id = tag_id
        self._chunks: list[FloatArray] = []
        self._count = 0
        self._shares = 0.0
        self.seen = 0
        for _ in range(missed):
            self.append(None)

    @property
    def count(self) -> int:
        """How many frames there have been."""
        return self._count

    def append(self, sighting: Sighting | None) -> None:
        """Keep one frame's result; None where the tag was not seen."""
        place = self._count % _CHUNK
        if place == 0:
            self._chunks.append(np.full((_CHUNK, _WIDTH), np.nan))
        self._count += 1
        if sighting is None:
            return
        self.seen += 1
        self._shares += sighting.image_share
        row = self._chunks[-1][place]
        row[0], row[13] = sighting.correlation, sighting.angle_std_rad
        row[1:9] = sighting.homography.reshape(9)[:8]
        row[9:13] = sighting.covariance_px2.reshape(4)

    def measure_motion(self) -> tuple[float, float]:
        """Return how far the tag moved (rms about its mean place) and its mean side, in px."""
        joined = self.join()
        corners, centre = joined.corners_px[joined.seen], joined.centre_px[joined.seen]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        return float(np.sqrt(centre.var(axis=0).sum())), float(sides.mean())

    def join(self) -> TagSightings:
        """Return all frames; chunk by chunk, so that a long film needs no more memory than what is returned."""
        count = self._count
        joined = TagSightings(
            tag_id=self._tag_id,
            correlation=np.empty(count),
            centre_px=np.empty((count, 2)),
            covariance_px2=np.empty((count, 2, 2)),
            corners_px=np.empty((count, 4, 2)),
            angle_rad=np.empty(count),
            angle_std_rad=np.empty(count),
            image_share=self._shares / self.seen if self.seen else 1.0,
        )
        for first, chunk in zip(range(0, count, _CHUNK), self._chunks, strict=True):
            part = slice(first, min(first + _CHUNK, count))
            rows = chunk[: part.stop - first]
            homography = np.column_stack([rows[:, 1:9], np.ones(len(rows))]).reshape(-1, 3, 3)
            joined.correlation[part], joined.angle_std_rad[part] = rows[:, 0], rows[:, 13]
            joined.centre_px[part], joined.angle_rad[part] = homography[:, :2, 2], angles_of(homography)
            joined.covariance_px2[part] = rows[:, 9:13].reshape(-1, 2, 2)
            joined.corners_px[part] = corners_of(homography)
        return joined
