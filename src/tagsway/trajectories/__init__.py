"""Moves in time: planned from a `Move`, shaped, checked against its limits, and sampled for a controller.

`plan_move` gives an exact piecewise polynomial, `apply_shaper` lays a shaper over it, `slow_down` stretches it for a
dry run, `check_limits` compares what came out with what was asked, and `sample_trajectory` puts it on the controller's
grid.
"""

from tagsway.trajectories.limits import LimitCheck, MotionReport, check_limits
from tagsway.trajectories.planning import plan_move
from tagsway.trajectories.sampling import sample_trajectory
from tagsway.trajectories.shaping import apply_shaper, slow_down

__all__ = [
    "LimitCheck",
    "MotionReport",
    "apply_shaper",
    "check_limits",
    "plan_move",
    "sample_trajectory",
    "slow_down",
]
