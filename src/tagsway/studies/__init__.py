"""Studies of many simulated moves: over frequencies, over accelerations, and under limits.

A `Shaping` is a shaper and the axes that it is laid over. `study_deviations` lets the payload's frequency stray,
`study_accelerations` runs the move faster and faster and `find_pairs` says where shaping costs nothing,
`study_limits` finds how fast it may be. Each takes the worst over the samples of a payload.
"""

from tagsway.studies.accelerations import find_pairs, study_accelerations
from tagsway.studies.deviations import study_deviations
from tagsway.studies.limits import Limit, study_limits
from tagsway.studies.sweep import UNSHAPED, Shaping, shapings_of, sweep_moves, worst_rows

__all__ = [
    "UNSHAPED",
    "Limit",
    "Shaping",
    "find_pairs",
    "shapings_of",
    "study_accelerations",
    "study_deviations",
    "study_limits",
    "sweep_moves",
    "worst_rows",
]
