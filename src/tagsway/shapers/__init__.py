"""Input shapers: designed for a mode, judged by the residual vibration they leave.

`design_shaper` makes one; `residual_vibration` says what it leaves on any mode, `residual_curve` over many
frequencies, `insensitivity` how wide the band is in which that is little, `residual_percentile` what repeats with a
known spread see.
"""

from tagsway.shapers.design import SHAPER_TYPES, design_shaper
from tagsway.shapers.residual import insensitivity, residual_curve, residual_percentile, residual_vibration

__all__ = [
    "SHAPER_TYPES",
    "design_shaper",
    "insensitivity",
    "residual_curve",
    "residual_percentile",
    "residual_vibration",
]
