"""A trajectory on the controller's grid."""

import math

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, SampledTrajectory, Trajectory

MOST_SAMPLES = 1_000_000
"""A quarter of an hour at 1 kHz; more is a mistyped sample time."""

FEWEST_CYCLES = 10
"""In a motion; a robot that follows fewer set-points does not follow the move."""


def sample_trajectory(
    trajectory: Trajectory, sample_time_s: float, *, run_time_s: float | None = None
) -> SampledTrajectory:
    """Sample a trajectory so that the last sample is its end, at rest.

    Parameters
    ----------
    trajectory : Trajectory
        The move as it will run.
    sample_time_s : float
        The controller's cycle.
    run_time_s : float, optional
        Up to which it rests after the end; by default the samples end with the first one at rest.

    Returns
    -------
    SampledTrajectory
        n samples at 0, T, 2T … of the exact position, velocity and acceleration (where the acceleration steps, of the
        part that begins there).

    Raises
    ------
    InputError
        For a sample time that gives fewer than 10 cycles or more than 10⁶ samples, or a run time that ends before the
        move.

    Notes
    -----
    The position itself is sampled, so that neither the end nor the rest depends on the grid. Its second difference is
    the acceleration averaged over two cycles: it equals the sampled one except around a step.
    """
    duration = trajectory.duration_s
    if not (sample_time_s > 0 and math.isfinite(sample_time_s)):
        raise InputError(f"the sample time must be positive, not {sample_time_s:g} s")
    total = duration if run_time_s is None else run_time_s
    # A duration that is a whole number of cycles but for rounding needs no cycle more.
    if not total >= duration - 1e-9 * sample_time_s:
        raise InputError(
            f"run_time_s is {total:g} s, but the motion takes {duration:.6g} s with its shaper: expected a longer one"
        )
    cycles = total / sample_time_s
    if not cycles + 1 <= MOST_SAMPLES:
        raise InputError(
            f"a sample time of {sample_time_s:g} s makes {cycles:.4g} samples of {total:.4g} s: expected at most "
            f"{MOST_SAMPLES}; sample_time_ms is in milliseconds, usually 1 to 10"
        )
    if not sample_time_s * FEWEST_CYCLES <= duration:
        raise InputError(
            f"a sample time of {sample_time_s:g} s is too coarse for a motion of {duration:.6g} s: expected at least "
            f"{FEWEST_CYCLES} cycles; sample_time_ms is in milliseconds, usually 1 to 10"
        )
    time: FloatArray = np.arange(math.ceil(cycles - 1e-9) + 1, dtype=np.float64) * sample_time_s
    time[time > duration - 1e-9 * sample_time_s] = duration
    return SampledTrajectory(
        sample_time_s=sample_time_s,
        position_m=trajectory(time),
        velocity_m_s=trajectory(time, 1),
        acceleration_m_s2=trajectory(time, 2),
        moving_s=duration,
    )
