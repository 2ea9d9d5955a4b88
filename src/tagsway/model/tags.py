"""A tag in one image, and in all of them; in pixels.

Pixel coordinates are (x right, y down), and (0, 0) is the *centre* of the first pixel. A tag's own frame is x right,
y up, the outer edge of its black square at ±1 (for families with a reversed border the inner edge of the black ring);
corners run (-1, -1), (1, -1), (1, 1), (-1, 1): lower left first, then counter-clockwise as one looks at the upright
artwork.
"""

from dataclasses import dataclass

import numpy as np

from tagsway.model.arrays import BoolArray, FloatArray, IntArray
from tagsway.model.video import VideoInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """A tag that a detector found.

    Parameters
    ----------
    tag_id : int
        Its number in the family.
    corners_px : ndarray, shape (4, 2)
        Corners of the black square, in the order of this module.
    margin : float
        The detector's decision margin; more is surer.
    hamming : int
        Bits that had to be corrected.
    """

    tag_id: int
    corners_px: FloatArray
    margin: float
    hamming: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """A tag in one image, measured by aligning its known pattern.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        Takes the tag's own frame to pixels; its last element is 1.
    covariance_px2 : ndarray, shape (2, 2)
        Covariance of the centre.
    angle_std_rad : float
        Standard error of the angle.
    correlation : float
        Of the pattern with the image, -1..1.
    image_share : float
        Part of the centre's variance that the image shows itself; the rest is a coder's, and lasts for many images.
    """

    homography: FloatArray
    covariance_px2: FloatArray
    angle_std_rad: float
    correlation: float
    image_share: float = 1.0

    @property
    def centre_px(self) -> FloatArray:
        """Image of the tag's centre, shape (2,)."""
        return self.homography[:2, 2]

    @property
    def corners_px(self) -> FloatArray:
        """Corners of the black square, in the order of this module, shape (4, 2)."""
        return corners_of(self.homography)

    @property
    def angle_rad(self) -> float:
        """Direction of the tag's x axis at its centre, counter-clockwise from the image's as one looks at it."""
        return float(angles_of(self.homography))


@dataclass(frozen=True, slots=True, kw_only=True)
class TagSightings:
    """One tag over all frames of a video; NaN where it was not seen.

    Parameters
    ----------
    tag_id : int
        Its number in the family.
    centre_px : ndarray, shape (n, 2)
        Image of the tag's centre.
    covariance_px2 : ndarray, shape (n, 2, 2)
        Covariance of the centre.
    corners_px : ndarray, shape (n, 4, 2)
        Corners of the black square.
    angle_rad, angle_std_rad : ndarray, shape (n,)
        Direction in the image as in `Sighting`, in (-π, π], and its standard error.
    correlation : ndarray, shape (n,)
        Of the pattern with the image.
    image_share : float
        Part of the variances that the images show themselves, as a mean; the rest is a coder's.
    """

    tag_id: int
    centre_px: FloatArray
    covariance_px2: FloatArray
    corners_px: FloatArray
    angle_rad: FloatArray
    angle_std_rad: FloatArray
    correlation: FloatArray
    image_share: float = 1.0

    @property
    def seen(self) -> BoolArray:
        """In which frames the tag was measured, shape (n,)."""
        seen: BoolArray = self.correlation == self.correlation
        return seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Every wanted tag over all frames of one video.

    Parameters
    ----------
    video : VideoInfo
        The video they were seen in.
    frame : ndarray of int, shape (n,)
        Place of each frame in the file.
    time_s : ndarray, shape (n,)
        Time of each frame.
    tags : tuple of TagSightings
        One for each tag that was seen at all.
    detector_calls : int
        How often the detector ran, on whole frames and on crops.
    """

    video: VideoInfo
    frame: IntArray
    time_s: FloatArray
    tags: tuple[TagSightings, ...]
    detector_calls: int

    def tag(self, tag_id: int) -> TagSightings | None:
        """Return the sightings of one tag, None where it was never seen."""
        return next((tag for tag in self.tags if tag.tag_id == tag_id), None)


def corners_of(homography: FloatArray) -> FloatArray:
    """Return the corners of the black square.

    Parameters
    ----------
    homography : ndarray, shape (..., 3, 3)
        Takes the tag's own frame to pixels.

    Returns
    -------
    ndarray, shape (..., 4, 2)
        In the order of this module, px.
    """
    square = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])
    image = homography @ square
    corners: FloatArray = np.swapaxes(image[..., :2, :] / image[..., 2:, :], -1, -2)
    return corners


def angles_of(homography: FloatArray) -> FloatArray:
    """Return the direction of the tag's x axis at its centre, counter-clockwise as one looks at the image.

    Parameters
    ----------
    homography : ndarray, shape (..., 3, 3)
        Takes the tag's own frame to pixels; its last element is 1.

    Returns
    -------
    ndarray, shape (...)
        In rad.
    """
    right, down = (homography[..., k, 0] - homography[..., k, 2] * homography[..., 2, 0] for k in (0, 1))
    angle: FloatArray = np.arctan2(-down, right)
    return angle
