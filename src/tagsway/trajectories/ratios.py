"""τ, the shaper's length over the acceleration's, and what it makes of a move."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import polynomial

from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Shaper, Trajectory
from tagsway.trajectories.pieces import slopes
from tagsway.trajectories.planning import plan_move
from tagsway.trajectories.shaping import apply_shaper

STILL_M = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaperRatio:
    """τ = t_shaper / t_acc of a shaped move.

    Parameters
    ----------
    shaper_s : float
        What the shaper adds to the move.
    acceleration_s : float
        t_acc with the blend: from the first motion across to the first time at which it no longer gains speed.
    level_acceleration_s : float
        t_acc without the blend: the part of it in which z is at rest.
    ratio, level_ratio : float
        τ with the one and with the other; below 1 the full acceleration is still reached. inf where t_acc is 0.
    """

    shaper_s: float
    acceleration_s: float
    level_acceleration_s: float

    @property
    def ratio(self) -> float:
        """τ with the blend."""
        return self.shaper_s / self.acceleration_s if self.acceleration_s > 0 else math.inf

    @property
    def level_ratio(self) -> float:
        """τ without the blend."""
        return self.shaper_s / self.level_acceleration_s if self.level_acceleration_s > 0 else math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class RatioCurves:
    """One move, unshaped and shaped, for one τ (Figures 6.3 and 6.4 of the thesis).

    Parameters
    ----------
    ratio : ShaperRatio
        Which τ.
    max_acceleration_m_s2 : float
        With which the move was planned.
    time_s : ndarray, shape (n,)
        From 0 to the end of the shaped move.
    unshaped, shaped_x, shaped_xz : ndarray, shape (3, n, 3)
        Position in m, velocity in m/s and acceleration in m/s² of x, y and z: the move, with x shaped and z held, and
        with both shaped.
    """

    ratio: ShaperRatio
    max_acceleration_m_s2: float
    time_s: FloatArray
    unshaped: FloatArray
    shaped_x: FloatArray
    shaped_xz: FloatArray


def find_shaper_ratio(trajectory: Trajectory, shaper: Shaper) -> ShaperRatio:
    """Return τ of a move before it is shaped.

    Parameters
    ----------
    trajectory : Trajectory
        The unshaped move, with a way across.
    shaper : Shaper
        Its duration is t_shaper.

    Returns
    -------
    ShaperRatio
        With both definitions of t_acc: the thesis does not say which it means. Its reference move at 5 m/s² has
        0.4215 s with the blend and 0.2215 s without.
    """
    start, end = trajectory(0.0), trajectory(trajectory.duration_s)
    way = (end - start)[:2]
    length = float(np.hypot(*way))
    if not length > STILL_M:
        raise InputError("a move without a way across has no acceleration time there: expected from_m beside to_m")
    push = slopes(trajectory, 2)[..., :2] @ (way / length)
    heights = slopes(trajectory, 1)[..., 2]
    total, level = 0.0, 0.0
    for index, duration in enumerate(np.diff(trajectory.breaks_s)):
        gaining = _gaining_s(push[index], float(duration))
        total += gaining
        if np.max(np.abs(heights[index]) * duration ** np.arange(1, heights.shape[1] + 1)) <= STILL_M:
            level += gaining
        if total > 0 and gaining < duration:
            break
    return ShaperRatio(shaper_s=shaper.duration_s, acceleration_s=total, level_acceleration_s=level)


def find_ratio_curves(
    move: Move, shaper: Shaper, *, ratios: tuple[float, ...] = (0.5, 1.0, 2.0), samples: int = 1001
) -> tuple[RatioCurves, ...]:
    """Return what Figures 6.3 and 6.4 show: a move whose acceleration is chosen so that τ is below, at and above 1.

    Parameters
    ----------
    move : Move
        Without limits on velocity or jerk: then t_acc goes with 1/√a.
    shaper : Shaper
        The same for all of them.
    ratios : tuple of float
        Values of τ with the blend.
    samples : int
        Of each curve.

    Returns
    -------
    tuple of RatioCurves
        One for each.
    """
    if move.max_velocity_m_s is not None or move.max_jerk_m_s3 is not None:
        raise InputError("τ is varied by the acceleration alone: leave max_velocity_m_s and max_jerk_m_s3 out")
    if not all(ratio > 0 and math.isfinite(ratio) for ratio in ratios):
        raise InputError(f"values of τ must be positive, not {list(ratios)}")
    given = find_shaper_ratio(plan_move(replace(move, run_time_s=None)), shaper).ratio
    curves = []
    for ratio in ratios:
        acceleration = move.max_acceleration_m_s2 * (ratio / given) ** 2
        trajectory = plan_move(replace(move, max_acceleration_m_s2=acceleration, run_time_s=None))
        shaped = [apply_shaper(trajectory, shaper, axes) for axes in (("x",), ("x", "z"))]
        time = np.linspace(0, max(each.duration_s for each in shaped), samples)
        values = [np.stack([each(time, order) for order in range(3)]) for each in (trajectory, *shaped)]
        curves.append(
            RatioCurves(
                ratio=find_shaper_ratio(trajectory, shaper),
                max_acceleration_m_s2=acceleration,
                time_s=time,
                unshaped=values[0],
                shaped_x=values[1],
                shaped_xz=values[2],
            )
        )
    return tuple(curves)


def _gaining_s(push: FloatArray, duration_s: float) -> float:
    """Return how long from the start of a piece its acceleration stays positive."""
    scaled = push * duration_s ** np.arange(len(push))
    largest = float(np.max(np.abs(scaled)))
    if not largest > 0:
        return 0.0
    trimmed = polynomial.polytrim(scaled, tol=1e-13 * largest)
    roots = polynomial.polyroots(trimmed) if len(trimmed) > 1 else np.array([])
    turns = sorted(float(root.real) for root in roots if abs(root.imag) < 1e-9 and 1e-9 < root.real < 1)
    first = turns[0] if turns else 1.0
    return first * duration_s if polynomial.polyval(first / 2, trimmed) > 0 else 0.0
