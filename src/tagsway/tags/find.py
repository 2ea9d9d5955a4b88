"""Find tags in an image with nothing known: the AprilTag detector behind a small interface."""

import ctypes
import importlib
from functools import cache
from typing import Any

import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import Detection, FloatArray, GreyArray
from tagsway.tags.families import FAMILIES

MOST_HAMMING = 1  # two corrected bits are within reach of background, and their tables take gigabytes
LEAST_MARGIN = 20.0  # of the detector's decision margin; true tags have 40 and more, clutter below 15 ...
_PLAIN_CONTRAST = 100.0  # ... in grey levels: those of a paler tag are told in shares of its own contrast
_SHARPENED, _SHARPENED_PX = 4.0, 3.0  # how much is added of what lies above a blur, and that blur
_SAMPLES = 16  # to a side of a tag, for its contrast
SMALLEST_SIDE_PX = 8.0
MOST_SIDE_RATIO = 3.0  # of the longest to the shortest side: a tag seen at 70°, or no tag
_SMALLEST_IMAGE_PX = 16  # below, the library has crashed
_SMALLEST_FAMILY = "tag16h5"  # what a detector is made with before it gets its own


class TagFinder:
    """Finds the tags of one family.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.

    Notes
    -----
    The library crashes at exit with more than one thread beside a video decoder, finds nothing with two families in
    one detector, and must not be called from two threads: so one thread, one family. Its tables hold every code with
    every error that it may correct: with the two that the wrappers ask for, tagStandard52h13 takes 6 GB and 36 s, with
    `MOST_HAMMING` 0.12 GB and 0.2 s. `find_tags` keeps one finder for each family of the process.
    """

    def __init__(self, family: str) -> None:
        if family not in FAMILIES:
            raise InputError(f"there is no tag family {family!r}: expected one of {', '.join(FAMILIES)}")
        self._detector = load_detector()(families=_SMALLEST_FAMILY, nthreads=1, quad_decimate=1.0)
        _replace_family(self._detector, family)

    def find(self, grey: GreyArray, *, decimate: float = 1.0) -> tuple[Detection, ...]:
        """Return the tags in an image that pass the gates, surest first.

        Parameters
        ----------
        grey : ndarray of uint8, shape (height, width)
            The image, or a part of it.
        decimate : float
            Pixels are thinned by this factor for the search; 2 is four times as fast, and blind to tags under 20 px.
            With 0.5 the image is enlarged: four times as slow, for tags of 12 to 14 px.

        Returns
        -------
        tuple of Detection
            Corners in the pixels of the image that was given, (0, 0) being the centre of its first pixel.
        """
        if min(grey.shape) < _SMALLEST_IMAGE_PX:
            return ()
        enlarged = max(1 / decimate, 1.0)
        if enlarged > 1:
            larger = cv2.resize(grey, None, fx=enlarged, fy=enlarged, interpolation=cv2.INTER_CUBIC)
            grey = np.asarray(larger, dtype=np.uint8)
        self._detector.tag_detector_ptr.contents.quad_decimate = decimate * enlarged  # read anew for each image
        grey = np.ascontiguousarray(grey)
        found = [_read_detection(seen, grey, enlarged) for seen in self._detector.detect(grey)]
        return tuple(sorted(filter(_is_sound, found), key=lambda tag: -tag.margin))


def find_tags(grey: GreyArray, *, family: str, decimate: float = 1.0) -> tuple[Detection, ...]:
    """Return the tags of a family in an image, surest first.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    family : str
        One of `FAMILIES`.
    decimate : float
        As in `TagFinder.find`.

    Returns
    -------
    tuple of Detection
        Good to 0.03-0.05 px; `Aligner` measures them. Not for use in two threads at once.
    """
    return _finder(family).find(grey, decimate=decimate)


def find_tags_near(
    grey: GreyArray, corners_px: FloatArray, *, family: str, sides: float = 1.0, decimate: float = 1.0
) -> tuple[Detection, ...]:
    """Return the tags in the part of an image around a place.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The whole image.
    corners_px : ndarray, shape (n, 2)
        What the part must hold.
    family : str
        One of `FAMILIES`.
    sides : float
        How far the part goes beyond, in sides of the corners' box.
    decimate : float
        As in `TagFinder.find`.

    Returns
    -------
    tuple of Detection
        Corners in the pixels of the whole image, surest first.
    """
    if not np.all(np.isfinite(corners_px)):
        return ()
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    reach = sides * float((high - low).max()) + 4
    height, width = grey.shape
    left, right = (int(np.clip(edge, 0, width)) for edge in (low[0] - reach, high[0] + reach + 1))
    top, bottom = (int(np.clip(edge, 0, height)) for edge in (low[1] - reach, high[1] + reach + 1))
    found = find_tags(grey[top:bottom, left:right], family=family, decimate=decimate)
    return tuple(
        Detection(
            tag_id=tag.tag_id,
            corners_px=tag.corners_px + np.array([left, top]),
            margin=tag.margin,
            hamming=tag.hamming,
        )
        for tag in found
    )


def sharpen(grey: GreyArray) -> GreyArray:
    """Return an image in which tags out of focus can be read; it is to be found in, never to be measured.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.

    Returns
    -------
    ndarray of uint8, shape (height, width)
        A disc of 4.5 px over a tag of 40 px, whose cells run into each other there, is read as 4.0 px are without.
    """
    wide = cv2.GaussianBlur(grey, (0, 0), _SHARPENED_PX)
    return np.asarray(cv2.addWeighted(grey, 1 + _SHARPENED, wide, -_SHARPENED, 0), dtype=np.uint8)


@cache
def _finder(family: str) -> TagFinder:
    return TagFinder(family)


@cache
def load_detector() -> Any:
    """Return the detector's class: pupil's, else that of the maintained fork, which has the same calls.

    Returns
    -------
    type
        Without its destructor: pupil's frees the families before the detector that still uses them, which crashes now
        and then, at exit above all. A detector lives as long as its process anyway.
    """
    for name in ("pupil_apriltags", "pyapriltags"):
        try:
            module = importlib.import_module(name)
        except (ImportError, OSError):
            continue
        return type("Detector", (module.Detector,), {"__module__": name, "__del__": lambda _: None})
    raise InputError("no AprilTag detector can be loaded: install the package pyapriltags again")


def _replace_family(detector: Any, family: str) -> None:
    """Let a detector look for this family alone, correcting no more bits than `MOST_HAMMING`."""
    library = detector.libc
    create, clear, add = (
        library[name]
        for name in (f"{family}_create", "apriltag_detector_clear_families", "apriltag_detector_add_family_bits")
    )
    create.restype, create.argtypes = ctypes.c_void_p, []
    clear.restype, clear.argtypes = None, [ctypes.c_void_p]
    add.restype, add.argtypes = None, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
    pointer = ctypes.cast(detector.tag_detector_ptr, ctypes.c_void_p)
    clear(pointer)
    add(pointer, create(), MOST_HAMMING)


def _read_detection(seen: Any, grey: GreyArray, enlarged: float) -> Detection:
    # The library puts (0, 0) at the corner of the first pixel; its corners go round as ours do.
    corners = np.asarray(seen.corners, dtype=float) - 0.5
    return Detection(
        tag_id=int(seen.tag_id),
        corners_px=(corners + 0.5) / enlarged - 0.5,
        margin=float(seen.decision_margin) * max(1.0, _PLAIN_CONTRAST / _measure_contrast(grey, corners)),
        hamming=int(seen.hamming),
    )


def _measure_contrast(grey: GreyArray, corners_px: FloatArray) -> float:
    """Return how many grey levels lie between black and white inside a tag's square."""
    last = _SAMPLES - 1.0
    square = np.array([[0, last], [last, last], [last, 0], [0, 0]], dtype=np.float32)
    to_square = cv2.getPerspectiveTransform(corners_px.astype(np.float32), square)
    inside = cv2.warpPerspective(grey, to_square, (_SAMPLES, _SAMPLES), borderMode=cv2.BORDER_REPLICATE)
    black, white = np.percentile(inside, [5, 95])
    return max(float(white - black), 1.0)


def _is_sound(tag: Detection) -> bool:
    """Tell whether a detection can be a tag: sure enough, convex, not from behind, not a sliver."""
    edges = np.roll(tag.corners_px, -1, axis=0) - tag.corners_px
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    return bool(
        tag.hamming <= MOST_HAMMING
        and tag.margin >= LEAST_MARGIN
        and np.all(turns < 0)  # counter-clockwise on the screen, where y is down
        and lengths.min() >= SMALLEST_SIDE_PX
        and lengths.max() <= MOST_SIDE_RATIO * lengths.min()
    )
