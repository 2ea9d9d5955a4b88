"""One measurement, from file to result: the only place that knows the order of the stages.

recording    a video, or somebody's table  →  a track of the two tags
measurement  the track  →  window, mode, pendulum, indicators, shaper, trajectory
output       everything of a measurement  →  the files of its folder
"""

from tagsway.pipeline.measurement import Measurement, identify
from tagsway.pipeline.output import write_measurement

__all__ = ["Measurement", "identify", "write_measurement"]
