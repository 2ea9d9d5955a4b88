"""Sightings as a camera that looks squarely at the plane would have made them."""

from dataclasses import replace
from functools import partial

import numpy as np

from tagsway.camera.lens import carry_tag, undistort
from tagsway.camera.projection import View
from tagsway.model import FloatArray, PlaneView, Sightings


def straighten_sightings(sightings: Sightings, view: PlaneView) -> Sightings:
    """Return sightings without the lens and without the tilt: centres, corners, covariances and angles.

    Parameters
    ----------
    sightings : Sightings
        In the pixels in which the view was found.
    view : PlaneView
        Of the same video.

    Returns
    -------
    Sightings
        A pixel is ``view.tag(id).scale`` units of length everywhere in that tag's plane, counted from the principal
        point. Tags that the view does not know are taken to lie in its plane.
    """
    tags = tuple(carry_tag(tag, partial(_straighten, view=view, tag_id=tag.tag_id)) for tag in sightings.tags)
    return replace(sightings, tags=tags)


def _straighten(points_px: FloatArray, *, view: PlaneView, tag_id: int) -> FloatArray:
    camera = view.camera
    principal = np.array([camera.cx, camera.cy])
    ray = (undistort(points_px, camera) - principal) / camera.fx
    seen = View(
        focal_px=camera.fx,
        radial_k1=0.0,
        pitch_rad=view.pitch_rad.value,
        yaw_rad=view.yaw_rad.value,
        distance=view.distance,
    )
    place = seen.cast(ray, view.depth(tag_id))
    return principal + place / view.scale(tag_id).value
