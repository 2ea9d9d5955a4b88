"""Sightings of tags → tracks of tool and product, x right and z up."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tagsway.model import (
    Camera,
    CoordinateFrame,
    Estimate,
    FloatArray,
    Notice,
    PlaneView,
    Settings,
    Sightings,
    TagSightings,
    TagTrack,
    Track,
)
from tagsway.tracks.arrangement import judge_arrangement
from tagsway.tracks.depth import find_depth_sway
from tagsway.tracks.scale import measure_scale
from tagsway.tracks.shake import Shake, measure_shake, unwrap
from tagsway.tracks.tilt import LEVEL, Tilt, measure_tilt

FEW = 0.9
"""Share of frames below which a tag counts as badly seen."""

KNOWN_FOCAL = 0.1
"""Relative error up to which a focal length that was found counts as known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Picture:
    """How pixels become the track's coordinates."""

    principal_px: FloatArray
    tilt: Tilt
    up_rad: float
    shake: Shake | None

    def enlargement(self, tag: TagSightings) -> FloatArray:
        """Return how much larger a tag looks in each frame than at the principal point, shape (n,)."""
        return self.tilt.enlargement(tag.centre_px - self.principal_px)

    def place(self, tag: TagSightings, scale: float) -> tuple[FloatArray, FloatArray]:
        """Return positions from the principal point, and their standard errors, shape (n, 2), times the scale."""
        point = tag.centre_px * np.array([1.0, -1.0])
        std = np.sqrt(np.diagonal(tag.covariance_px2, axis1=1, axis2=2))
        if self.shake is not None:
            point, std = self.shake.remove(point, std)
        cosine, sine = math.cos(self.up_rad), math.sin(self.up_rad)
        turn = np.array([[cosine, sine], [-sine, cosine]])
        offset = point - self.principal_px * np.array([1.0, -1.0])
        nearness = self.tilt.nearness(offset * np.array([1.0, -1.0]))[:, None]
        return (offset / nearness) @ turn.T * scale, np.sqrt(std**2 @ (turn**2).T) * scale

    def direct(self, tag: TagSightings) -> tuple[FloatArray, FloatArray]:
        """Return the tag's unwrapped angle in the track's axes, and its standard error, shape (n,)."""
        if self.shake is None:
            return unwrap(tag.angle_rad - self.up_rad), tag.angle_std_rad
        angle = unwrap(tag.angle_rad - self.shake.turn_rad - self.up_rad)
        return angle, np.hypot(tag.angle_std_rad, self.shake.turn_std_rad)


def join_tags(
    sightings: Sightings, settings: Settings, camera: Camera | None = None, *, view: PlaneView | None = None
) -> tuple[Track, CoordinateFrame, tuple[Notice, ...]]:
    """Join the sightings of the tags to tracks of the tool and the product.

    Parameters
    ----------
    sightings : Sightings
        In pixels; where a lens is known, without its distortion (`tagsway.camera.undistort_sightings`).
    settings : Settings
        Which tag is which, how large they are, and which way is up.
    camera : Camera, optional
        Its principal point and focal length are used; without it the image's centre, and a focal length of the
        image's width where one must be assumed.
    view : PlaneView, optional
        As it was found; the sightings are then those of a camera that looks squarely at the plane
        (`tagsway.camera.straighten_sightings`), and its scales are used.

    Returns
    -------
    track : Track
        In metres from where the tool (without it: the product) was first seen; in pixels where no tag's size is known.
        The product is all NaN where it was never seen, the tool None.
    frame : CoordinateFrame
        What its axes mean.
    notices : tuple of Notice
        What to know about it.

    Notes
    -----
    A point of the plane at depth Z is at X = (u - c) Z / f, and Z / f is that plane's scale: so each tag's pixels,
    counted from the principal point, times its own scale, and the two may be subtracted. A plane that is tilted
    against the image has another depth at each point; the tags' sizes along their way tell the tilt. Where only one
    tag's size is given, its scale serves for both. An error of a scale is the same in every frame: it is not in
    `position_std`. Without a `view` the tilt's foreshortening is left: 0.4 % of the lengths
    along it at 5°.

    `--up DEG` is the angle, counter-clockwise as one looks at the image, from the image's up to the true one;
    "reference" takes the mean direction of the reference tag's own up.
    """
    pcp, tcp = _seen(sightings, settings.pcp_id), _seen(sightings, settings.tcp_id)
    reference = _seen(sightings, settings.reference_id)
    shake = None if reference is None else measure_shake(sightings.time_s, reference)
    up, up_source, notices = _find_up(settings, reference)
    width, height = sightings.video.width, sightings.video.height
    camera = camera if view is None else view.camera
    centre = ((width - 1) / 2, (height - 1) / 2) if camera is None else (camera.cx, camera.cy)
    focal = float(width) if camera is None else camera.fx
    tags = {name: tag for name, tag in (("tcp", tcp), ("pcp", pcp)) if tag is not None}
    tilt = LEVEL if view else measure_tilt(tuple(tags.values()), np.array(centre), focal_px=focal)
    picture = _Picture(principal_px=np.array(centre), tilt=tilt, up_rad=up, shake=shake)
    scales, unit, scale_notices = _find_scales(tcp, pcp, settings, picture, view)

    tracks = {name: _track_tag(tag, picture, scales[name], unit) for name, tag in tags.items()}
    origin = next((_first(track.position) for track in tracks.values()), np.zeros(2))
    tracks = {name: replace(track, position=track.position - origin) for name, track in tracks.items()}
    fixed = None
    if reference is not None:
        # Its own size is not asked for: it should hang at the depth of the motion, and is shown in the product's scale.
        fixed = _track_tag(reference, replace(picture, shake=None), scales["pcp"], unit)
        fixed = replace(fixed, position=fixed.position - origin)
    count = len(sightings.time_s)
    track = Track(
        frame=sightings.frame,
        time_s=sightings.time_s,
        length_unit=unit,
        pcp=tracks.get("pcp", _unseen(count)),
        tcp=tracks.get("tcp"),
        reference=fixed,
    )
    frame = CoordinateFrame(
        origin=f"where the {'tool' if 'tcp' in tracks else 'product'}'s tag was first seen",
        axes="x right, z up, y away from the camera",
        up_source=up_source,
    )
    notices += scale_notices + _judge_sightings(sightings, settings, shake) + judge_arrangement(track, settings)
    if pcp is not None:
        known = camera is not None and (view is None or view.focal_px.std <= KNOWN_FOCAL * view.focal_px.value)
        notices += _judge_depth(sightings, pcp, tcp, track, camera, known=known)
    return track, frame, notices


def _seen(sightings: Sightings, tag_id: int | None) -> TagSightings | None:
    """Return the sightings of a tag that was seen in some frame."""
    tag = None if tag_id is None else sightings.tag(tag_id)
    return tag if tag is not None and np.isfinite(tag.centre_px).all(axis=1).any() else None


def _find_up(settings: Settings, reference: TagSightings | None) -> tuple[float, str, tuple[Notice, ...]]:
    """Return the angle from the image's up to the true one, and where it is known from."""
    if settings.up == "image":
        return 0.0, "image", ()
    if settings.up != "reference":
        return math.radians(float(settings.up)), f"option ({float(settings.up):g} degrees)", ()
    if reference is None:
        message = f"the reference tag {settings.reference_id} was never seen: up is taken from the image instead"
        return 0.0, "image", (Notice(code="up_from_image", message=message),)
    angle = reference.angle_rad[np.isfinite(reference.angle_rad)]
    return float(np.angle(np.mean(np.exp(1j * angle)))), "reference tag", ()


def _find_scales(
    tcp: TagSightings | None,
    pcp: TagSightings | None,
    settings: Settings,
    picture: _Picture,
    view: PlaneView | None,
) -> tuple[dict[str, Estimate | None], Literal["m", "px"], tuple[Notice, ...]]:
    """Return each tag's scale in mm per pixel; one that is not known is taken from the other."""
    sizes = {"tcp": (tcp, settings.tcp_tag_size_m), "pcp": (pcp, settings.pcp_tag_size_m)}
    found: dict[str, Estimate | None] = {"tcp": None, "pcp": None}
    for name, (tag, size) in sizes.items():
        if tag is not None and size is not None:
            found[name] = (
                measure_scale(tag, size, enlargement=picture.enlargement(tag))
                if view is None
                else _in_mm(view.scale(tag.tag_id))
            )
    known = [name for name in found if found[name] is not None]
    if not known:
        message = "without --tag-size nothing is known in mm: frequency and damping are found, lengths are not"
        return found, "px", (Notice(code="no_tag_size", message=message),)
    if len(known) == 1 and tcp is not None and pcp is not None:
        message = (
            f"only the {known[0].upper()} tag's size is given: its scale is used for both tags, and what they differ "
            "in depth is an error of every length; give both sizes"
        )
        return dict.fromkeys(found, found[known[0]]), "m", (Notice(code="one_tag_size", message=message),)
    return {name: found[name] or found[known[0]] for name in found}, "m", ()


def _in_mm(scale: Estimate) -> Estimate:
    return Estimate.normal(1000 * scale.value, 1000 * scale.std, low=0.0)


def _track_tag(tag: TagSightings, picture: _Picture, scale: Estimate | None, unit: Literal["m", "px"]) -> TagTrack:
    factor = 1.0 if unit == "px" or scale is None else scale.value / 1000
    position, std = picture.place(tag, factor)
    angle, angle_std = picture.direct(tag)
    return TagTrack(
        position=position,
        position_std=std,
        angle_rad=angle,
        angle_std_rad=angle_std,
        scale_mm_per_px=scale,
        image_share=tag.image_share,
    )


def _first(position: FloatArray) -> FloatArray:
    """Return the first position that there is."""
    seen = np.flatnonzero(np.isfinite(position).all(axis=1))
    return np.asarray(position[seen[0]]) if len(seen) else np.zeros(2)


def _unseen(count: int) -> TagTrack:
    """Return the track of a tag that was never seen."""
    pair, single = np.full((count, 2), np.nan), np.full(count, np.nan)
    return TagTrack(position=pair, position_std=pair, angle_rad=single, angle_std_rad=single)


def _judge_sightings(sightings: Sightings, settings: Settings, shake: Shake | None) -> tuple[Notice, ...]:
    """Say which tags were not seen, or not often."""
    notices = []
    wanted = {"tcp": ("tool", settings.tcp_id), "pcp": ("product", settings.pcp_id)}
    for name, (what, tag_id) in wanted.items():
        tag = _seen(sightings, tag_id)
        share = 0.0 if tag is None else float(np.mean(np.isfinite(tag.centre_px).all(axis=1)))
        if share == 0:
            message = f"the {what}'s tag {tag_id} was never seen"
            if name == "tcp":
                message += ": the product's own motion is used, and the pendulum is not determined"
            notices.append(Notice(code=f"{name}_not_seen", message=message))
        elif share < FEW:
            message = f"the {what}'s tag {tag_id} was seen in {100 * share:.0f} % of the frames only"
            notices.append(Notice(code=f"{name}_often_lost", message=message))
    if settings.reference_id is not None and shake is None:
        message = f"the reference tag {settings.reference_id} was not seen: the camera's shake stays in the track"
        notices.append(Notice(code="reference_not_seen", message=message))
    return tuple(notices)


def _judge_depth(
    sightings: Sightings,
    pcp: TagSightings,
    tcp: TagSightings | None,
    track: Track,
    camera: Camera | None,
    *,
    known: bool,
) -> tuple[Notice, ...]:
    """Say where the product sways out of the plane."""
    scale = track.pcp.scale_mm_per_px
    unit = 1.0 if track.length_unit == "px" or scale is None else scale.value / 1000
    sway = track.pcp.position if track.tcp is None else track.pcp.position - track.tcp.position
    focal = float(sightings.video.width) if camera is None else camera.fx
    width, height = sightings.video.width, sightings.video.height
    centre = ((width - 1) / 2, (height - 1) / 2) if camera is None else (camera.cx, camera.cy)
    notice = find_depth_sway(
        sightings.time_s,
        sway / unit,
        pcp,
        tcp,
        focal_px=focal,
        principal_px=np.array(centre),
        known=known,
        mm_per_px=None if track.length_unit == "px" or scale is None else scale.value,
    )
    return () if notice is None else (notice,)
