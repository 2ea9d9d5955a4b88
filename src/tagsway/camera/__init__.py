"""The camera: a lens that is known, a view that the tags themselves tell, and a calibration from boards."""

from tagsway.camera.lens import undistort, undistort_sightings
from tagsway.camera.straighten import straighten_sightings
from tagsway.camera.view import find_view

__all__ = ["find_view", "straighten_sightings", "undistort", "undistort_sightings"]
