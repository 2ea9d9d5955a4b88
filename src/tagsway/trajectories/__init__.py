"""Moves in time: planned from a `Move`, shaped, checked against its limits, and sampled for a controller.

`plan_move` gives a piecewise polynomial, `apply_shaper` lays a shaper over it (`plan_shaped` does both, as the move
says), `slow_down` stretches it for a dry run, `check_limits` compares what came out with what was asked, and
`sample_trajectory` puts it on the controller's grid. `plan_path` tells more of a path: how each `Corner` is passed.
"""

from tagsway.trajectories.corners import Corner, find_corner_error, plan_corner
from tagsway.trajectories.examples import corner_test_move, dual_mode_move
from tagsway.trajectories.feeds import Feed, plan_feed
from tagsway.trajectories.limits import LimitCheck, MotionReport, check_limits
from tagsway.trajectories.paths import PathPlan, plan_path
from tagsway.trajectories.planning import plan_move, plan_shaped
from tagsway.trajectories.ratios import RatioCurves, ShaperRatio, find_ratio_curves, find_shaper_ratio
from tagsway.trajectories.sampling import sample_trajectory
from tagsway.trajectories.shaping import apply_shaper, slow_down

__all__ = [
    "Corner",
    "Feed",
    "LimitCheck",
    "MotionReport",
    "PathPlan",
    "RatioCurves",
    "ShaperRatio",
    "apply_shaper",
    "check_limits",
    "corner_test_move",
    "dual_mode_move",
    "find_corner_error",
    "find_ratio_curves",
    "find_shaper_ratio",
    "plan_corner",
    "plan_feed",
    "plan_move",
    "plan_path",
    "plan_shaped",
    "sample_trajectory",
    "slow_down",
]
