"""Which tags a video shows, before anything is known of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, GreyArray
from tagsway.pipeline.recording import TABLES
from tagsway.tags.find import find_tags
from tagsway.tags.others import find_other_tags
from tagsway.video.reading import read_clock, read_frames

LOOK_IMAGES, LOOK_FRAMES = 24, 1200
"""So many images are looked at, spread over the film's first frames."""

FAMILY_IMAGES = 6
"""Of them, so many are searched for every family there is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedTag:
    """One tag of a video.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Number in the family.
    share : float
        Of the images that were looked at, in which the detector saw it.
    side_px : float
        Mean side of its square.
    centre_px : tuple of float
        Its median place, x right and y down.
    travel_px : float
        How far its places are apart.
    """

    family: str
    tag_id: int
    share: float
    side_px: float
    centre_px: tuple[float, float]
    travel_px: float


def survey_tags(file: Path) -> tuple[ListedTag, ...]:
    """Return the tags that the beginning of a video shows, of whatever family, the most frequent first.

    Parameters
    ----------
    file : Path
        The video.

    Returns
    -------
    tuple of ListedTag
        At least one.

    Raises
    ------
    InputError
        Where the file is no video, or shows no tag.
    """
    if file.suffix.lower() in TABLES:
        raise InputError(f"{file} is a table: expected a video, whose tags can be looked for")
    greys = _look(file)
    families = {family for family, _ in find_other_tags(greys[:: max(1, len(greys) // FAMILY_IMAGES)])}
    seen = [tag for family in sorted(families) for tag in _survey_family(greys, family)]
    if not seen:
        raise InputError(
            f"{file} shows no tag of any known family in {len(greys)} images of its beginning: is one in the picture, "
            "sharp, with its white border, and at least 15 px wide?"
        )
    return tuple(sorted(seen, key=lambda tag: (-tag.share, tag.family, tag.tag_id)))


def _look(file: Path) -> list[GreyArray]:
    clock = read_clock(file, fps_hz=1.0)  # images do not say; times do not matter here
    frames = min(len(clock.stamps), LOOK_FRAMES)
    with read_frames(file, clock) as reader:
        return [frame.grey.copy() for frame in islice(reader, 0, frames, max(1, frames // LOOK_IMAGES))]


def _survey_family(greys: Sequence[GreyArray], family: str) -> list[ListedTag]:
    corners: dict[int, list[FloatArray]] = {}
    for grey in greys:
        for tag_id, tag in {tag.tag_id: tag for tag in reversed(find_tags(grey, family=family))}.items():
            corners.setdefault(tag_id, []).append(tag.corners_px)
    return [_describe(family, tag_id, np.stack(found), len(greys)) for tag_id, found in corners.items()]


def _describe(family: str, tag_id: int, corners_px: FloatArray, images: int) -> ListedTag:
    sides = np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=1), axis=2)
    centres = corners_px.mean(axis=1)
    middle = np.median(centres, axis=0)
    return ListedTag(
        family=family,
        tag_id=tag_id,
        share=len(corners_px) / images,
        side_px=float(sides.mean()),
        centre_px=(float(middle[0]), float(middle[1])),
        travel_px=float(np.linalg.norm(np.ptp(centres, axis=0))),
    )
