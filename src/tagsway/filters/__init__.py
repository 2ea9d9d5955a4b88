"""Spikes, medians, gaps and derivatives: a measured path as it can be differentiated.

A base layer beside `tagsway.dynamics`: plain arrays and tracks in, splines and clean tracks out.
"""

from tagsway.filters.clean import clean_track, find_track_spikes, fit_tag_splines, measure_tag_noise
from tagsway.filters.medians import median_filter
from tagsway.filters.moves import find_moves
from tagsway.filters.noise import find_image_noise, measure_noise
from tagsway.filters.spikes import find_spikes
from tagsway.filters.spline import SmoothingSpline, fit_smoothing_spline

__all__ = [
    "SmoothingSpline",
    "clean_track",
    "find_image_noise",
    "find_moves",
    "find_spikes",
    "find_track_spikes",
    "fit_smoothing_spline",
    "fit_tag_splines",
    "measure_noise",
    "measure_tag_noise",
    "median_filter",
]
