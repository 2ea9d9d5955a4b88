"""From a move to a motion in time."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from tagsway.errors import InputError
from tagsway.model import Move, Trajectory
from tagsway.trajectories.pick_and_place import plan_pick_and_place
from tagsway.trajectories.profiles import plan_bang_bang, plan_quintic, plan_trapezoid

_PLANNERS: Mapping[str, Callable[[Move], Trajectory]] = MappingProxyType(
    {
        "pick-and-place": plan_pick_and_place,
        "bang-bang": plan_bang_bang,
        "trapezoid": plan_trapezoid,
        "quintic": plan_quintic,
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
        For a profile that is not planned, limits that it cannot keep, or a run time that is too short.
    """
    if move.profile not in _PLANNERS:
        raise InputError(
            f"profile {move.profile!r} is not one that this version plans: expected one of {', '.join(_PLANNERS)}"
        )
    trajectory = _PLANNERS[move.profile](move)
    if move.run_time_s is not None and move.run_time_s < trajectory.duration_s:
        raise InputError(
            f"run_time_s is {move.run_time_s:g} s, but the move takes {trajectory.duration_s:.6g} s: "
            "expected a longer run time, or a higher max_acceleration_m_s2"
        )
    return trajectory
