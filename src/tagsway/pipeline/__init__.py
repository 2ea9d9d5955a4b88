"""One measurement, from file to result: the only place that knows the order of the stages.

recording    a video, or somebody's table  →  a track of the two tags
measurement  the track  →  window, mode, pendulum, indicators, shaper, trajectory
output       everything of a measurement  →  the files of its folder
"""

from tagsway.pipeline.measurement import Measurement, align_result, aligned_move, identify
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
