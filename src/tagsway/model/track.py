"""Tags over time in the plane of the motion: x right, z up.

Positions are in metres where a tag's size is known, else in pixels (z still up): `Track.length_unit` says which. What
was not seen is NaN, never left out, never filled in.
"""

from dataclasses import dataclass
from typing import Literal

from tagsway.model.arrays import FloatArray, IntArray
from tagsway.model.estimate import Estimate

SCALE_STD = 0.003
"""Error of a track's scale: what a print, a ruler and a camera set up by eye leave; 0.1 mm on a tag of 30 mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagTrack:
    """One tag's motion as it was measured.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        x and z, in the track's length unit.
    position_std : ndarray, shape (n, 2)
        Their standard errors (noise only; scale is a systematic error of its own).
    angle_rad : ndarray, shape (n,)
        The tag's rotation in the plane, counter-clockwise with x right and z up, unwrapped; a payload that swings to
        +x turns by a positive angle. NaN throughout where the source has no angle.
    angle_std_rad : ndarray, shape (n,)
        Its standard error.
    scale_mm_per_px : Estimate or None
        Millimetres in the tag's plane to a pixel; None where the source has no pixels or the size is not known.
    image_share : float
        Part of the variances that the images' own noise makes. The rest a coder left, which lasts for many samples.
    """

    position: FloatArray
    position_std: FloatArray
    angle_rad: FloatArray
    angle_std_rad: FloatArray
    scale_mm_per_px: Estimate | None = None
    image_share: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """The motion of the tool (TCP), the product (PCP) and, where there is one, a machine-fixed reference.

    Parameters
    ----------
    frame : ndarray of int, shape (n,)
        Number of each sample in its source.
    time_s : ndarray, shape (n,)
        Strictly increasing.
    length_unit : {"m", "px", "m/s2", "rad"}
        Of all positions; a record of accelerations or of an angle has no positions but these in their place.
    pcp : TagTrack
        The product.
    tcp : TagTrack or None
        The tool; None where it was never seen: then positions are those of the PCP alone.
    reference : TagTrack or None
        The machine-fixed tag; where there is one, its shake was taken off the other two already.
    """

    frame: IntArray
    time_s: FloatArray
    length_unit: Literal["m", "px", "m/s2", "rad"]
    pcp: TagTrack
    tcp: TagTrack | None = None
    reference: TagTrack | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CleanTagTrack:
    """One tag's motion without spikes, with derivatives; NaN only where a gap is too long to bridge.

    Parameters
    ----------
    position, velocity, acceleration : ndarray, shape (n, 2)
        x and z, in the track's length unit, per second and per second squared.
    bandwidth_hz : float
        Where the smoothing has halved an oscillation's amplitude.
    sample_std : ndarray, shape (n, 2)
        Noise of the raw samples that were smoothed, as it shows; NaN at a spike and where the tag was not seen.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    bandwidth_hz: float
    sample_std: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class CleanTrack:
    """A track cleaned of spikes, at the same times as its `Track`.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        As in the track.
    pcp : CleanTagTrack
        The product.
    tcp : CleanTagTrack or None
        The tool.
    method : {"spline", "median"}
        A smoothing spline, or medians as in the thesis.
    spikes : int
        How many samples were taken for spikes.
    """

    time_s: FloatArray
    pcp: CleanTagTrack
    tcp: CleanTagTrack | None
    method: Literal["spline", "median"]
    spikes: int
