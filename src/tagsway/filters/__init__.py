"""Spikes, medians, gaps and derivatives: a measured path as it can be differentiated.

A base layer beside `tagsway.dynamics`: plain arrays and tracks in, splines and clean tracks out.
"""

from tagsway.filters.spline import SmoothingSpline, fit_smoothing_spline

__all__ = ["SmoothingSpline", "fit_smoothing_spline"]
