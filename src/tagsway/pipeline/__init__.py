"""One measurement, from file to result: the only place that knows the order of the stages.

recording    a video, or somebody's table  →  a track of the two tags
measurement  the track  →  window, mode, pendulum, shaper, trajectory: the order of the stages
assembling   what they found  →  the result with its indicators and warnings, and the curves to draw
output       everything of a measurement  →  the files of its folder
"""

from tagsway.pipeline.assembling import Measurement, align_result, aligned_move
from tagsway.pipeline.measurement import identify
from tagsway.pipeline.output import check_outputs, write_measurement
from tagsway.pipeline.recording import TABLES

__all__ = [
    "TABLES",
    "Measurement",
    "align_result",
    "aligned_move",
    "check_outputs",
    "identify",
    "write_measurement",
]
