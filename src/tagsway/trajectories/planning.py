"""From a move to a motion in time."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from tagsway.errors import InputError
from tagsway.model import Move, Shaper, Trajectory
from tagsway.trajectories.paths import plan_path
from tagsway.trajectories.pick_and_place import plan_pick_and_place
from tagsway.trajectories.profiles import plan_bang_bang, plan_quintic, plan_s_curve, plan_trapezoid
from tagsway.trajectories.shaping import apply_shaper
from tagsway.trajectories.splines import plan_b_spline


def _plan_path(move: Move) -> Trajectory:
    return plan_path(move).trajectory


_PLANNERS: Mapping[str, Callable[[Move], Trajectory]] = MappingProxyType(
    {
        "pick-and-place": plan_pick_and_place,
        "bang-bang": plan_bang_bang,
        "trapezoid": plan_trapezoid,
        "s-curve": plan_s_curve,
        "quintic": plan_quintic,
        "b-spline": plan_b_spline,
        "path": _plan_path,
    }
)


def plan_move(move: Move) -> Trajectory:
    """Plan a move from rest to rest, without a shaper.

    Parameters
    ----------
    move : Move
        Points, profile and what the tool may do; velocity and acceleration limits are those of the vector.

    Returns
    -------
    Trajectory
        As quick as its profile and the limits allow. It ends with the motion: the rest up to `run_time_s` is added by
        `sample_trajectory`, after the shaper.

    Raises
    ------
    InputError
        For limits that the profile cannot keep, or a run time that is too short.
    """
    trajectory = _PLANNERS[move.profile](move)
    if move.run_time_s is not None and move.run_time_s < trajectory.duration_s:
        raise InputError(
            f"run_time_s is {move.run_time_s:g} s, but the move takes {trajectory.duration_s:.6g} s: "
            "expected a longer run time, or a higher max_acceleration_m_s2"
        )
    return trajectory


def plan_shaped(move: Move, shaper: Shaper) -> Trajectory:
    """Plan a move with its shaper, on the axes that it names.

    Parameters
    ----------
    move : Move
        Its `shaped_axes` say what is shaped.
    shaper : Shaper
        What is laid over it.

    Returns
    -------
    Trajectory
        From rest to rest, as `apply_shaper` makes it of `plan_move`; but a path's feed rate is shaped before its
        corners are planned, so that the cornering error is that of the shaped motion.
    """
    if move.profile == "path" and move.along_path == "feed-rate" and move.shaped_axes == ("path",):
        return plan_path(move, shaper=shaper).trajectory
    return apply_shaper(plan_move(move), shaper, move.shaped_axes)
