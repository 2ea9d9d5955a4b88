"""What a shaped move does, against what it may do."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from scipy.spatial import cKDTree

from tagsway.model import FloatArray, IntArray, Move, Notice, Trajectory
from tagsway.trajectories.pieces import slopes

ROUNDING = 1e-9
"""Share of a limit by which a value may pass it: the planner itself runs at the limit."""

STILL_M = 1e-9
"""A piece that moves the tool by less leaves it where it is."""

STEP_SHARE = 1e-6
"""Of the peak acceleration; a smaller jump at a break is rounding, a larger one is an infinite jerk."""

Axes = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCheck:
    """One limit and what became of it.

    Parameters
    ----------
    name : str
        The limit's key in a move file.
    limit : float or tuple
        As it was stated there.
    value : float, tuple or None
        What the move reaches, in the same unit; None for an infinite jerk.
    kept : bool
        Whether it stays within.
    message : str
        Both, in words.
    """

    name: str
    limit: float | tuple[Axes, Axes]
    value: float | tuple[Axes, Axes] | None
    kept: bool
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionReport:
    """What a trajectory asks of the robot.

    Parameters
    ----------
    duration_s : float
        From rest to rest.
    peak_velocity_m_s, peak_acceleration_m_s2 : tuple of float
        Largest magnitude on x, y and z.
    peak_jerk_m_s3 : tuple of (float or None)
        The same of the jerk; None where the acceleration steps and the jerk has no bound.
    path_deviation_m : float
        Largest distance of the shaped path from the unshaped one, whatever the time.
    lost_vertical_m : tuple of float
        How much of the strictly vertical height at pick and at place the shaper took.
    checks : tuple of LimitCheck
        One for each limit that was stated.
    """

    duration_s: float
    peak_velocity_m_s: Axes
    peak_acceleration_m_s2: Axes
    peak_jerk_m_s3: tuple[float | None, float | None, float | None]
    path_deviation_m: float
    lost_vertical_m: tuple[float, float]
    checks: tuple[LimitCheck, ...]

    @property
    def notices(self) -> tuple[Notice, ...]:
        """A warning for each limit that is not kept."""
        return tuple(Notice(code=f"limit_{c.name}", message=c.message) for c in self.checks if not c.kept)


def check_limits(shaped: Trajectory, unshaped: Trajectory, move: Move) -> MotionReport:
    """Compare a shaped move with its limits.

    Parameters
    ----------
    shaped, unshaped : Trajectory
        The move after and before shaping.
    move : Move
        Its `limits`; where velocity, acceleration or jerk have none there, the move's own maximum counts. They hold for
        the magnitude of the vector. `vertical_mm` is the height that must stay strictly
        vertical at both ends.

    Returns
    -------
    MotionReport
        Its `notices` name each limit that is broken. Peaks are those of the polynomials, not of samples.
    """
    velocity, acceleration, jerk = (find_peaks(shaped, order) for order in (1, 2, 3))
    steps = _acceleration_steps(shaped) > STEP_SHARE * max(acceleration[3], 1e-300)
    lost = _lost_vertical(shaped, move)
    deviation = _path_deviation(shaped, unshaped)
    limits = move.limits
    checks = [
        _check("velocity_m_s", limits.velocity_m_s or move.max_velocity_m_s, velocity[3], "m/s"),
        _check("acceleration_m_s2", limits.acceleration_m_s2 or move.max_acceleration_m_s2, acceleration[3], "m/s²"),
        _check("jerk_m_s3", limits.jerk_m_s3 or move.max_jerk_m_s3, math.inf if np.any(steps) else jerk[3], "m/s³"),
        _check_box(shaped, limits.box_m),
        _check("path_deviation_mm", limits.path_deviation_mm, deviation * 1e3, "mm off the unshaped path"),
        _check_vertical(limits.vertical_mm, move, lost),
    ]
    return MotionReport(
        duration_s=shaped.duration_s,
        peak_velocity_m_s=velocity[:3],
        peak_acceleration_m_s2=acceleration[:3],
        peak_jerk_m_s3=(
            None if steps[0] else jerk[0],
            None if steps[1] else jerk[1],
            None if steps[2] else jerk[2],
        ),
        path_deviation_m=deviation,
        lost_vertical_m=lost,
        checks=tuple(check for check in checks if check is not None),
    )


def _check(name: str, limit: float | None, value: float, unit: str) -> LimitCheck | None:
    if limit is None:
        return None
    kept = value <= limit * (1 + ROUNDING)
    reached = "without bound" if math.isinf(value) else f"{value:.6g} {unit}"
    words = "keeps" if kept else "breaks"
    return LimitCheck(
        name=name,
        limit=limit,
        value=value if math.isfinite(value) else None,
        kept=kept,
        message=f"the move {words} the limit {name} = {limit:g}: {reached}"
        + ("" if kept else "; slow the move down, choose another shaper or other shaped axes, or raise the limit"),
    )


def _check_vertical(limit_mm: float | None, move: Move, lost_m: tuple[float, float]) -> LimitCheck | None:
    if limit_mm is None:
        return None
    kept_mm = 1e3 * min(move.pick_height_m - lost_m[0], move.place_height_m - lost_m[1])
    kept = kept_mm >= limit_mm * (1 - ROUNDING)
    words = "keeps" if kept else "breaks"
    return LimitCheck(
        name="vertical_mm",
        limit=limit_mm,
        value=kept_mm,
        kept=kept,
        message=f"the move {words} the limit vertical_mm = {limit_mm:g}: {kept_mm:.6g} mm stay strictly vertical"
        + ("" if kept else "; raise pick_height_m and place_height_m, or shape x alone"),
    )


def _check_box(trajectory: Trajectory, box_m: tuple[Axes, Axes] | None) -> LimitCheck | None:
    if box_m is None:
        return None
    low, high = np.array(box_m)
    values = [find_extremes(trajectory.coefficients[..., [i]], trajectory) for i in range(3)]
    reached = np.array([[value.min(), value.max()] for value in values]).T
    slack = ROUNDING * np.maximum(1.0, np.abs(high - low))
    outside = (reached[0] < low - slack) | (reached[1] > high + slack)
    names = [f"{'xyz'[i]} runs from {reached[0, i]:.6g} to {reached[1, i]:.6g} m" for i in np.flatnonzero(outside)]
    return LimitCheck(
        name="box_m",
        limit=box_m,
        value=(_axes(reached[0]), _axes(reached[1])),
        kept=not names,
        message="the move keeps the limit box_m"
        if not names
        else f"the move leaves the workspace box_m = {[list(corner) for corner in box_m]}: {', '.join(names)}",
    )


def find_peaks(trajectory: Trajectory, order: int) -> tuple[float, float, float, float]:
    """Return the largest magnitude of a derivative on x, on y, on z, and of the vector."""
    coefficients = slopes(trajectory, order)
    x, y, z = (float(np.max(np.abs(find_extremes(coefficients[..., [i]], trajectory)))) for i in range(3))
    vector = float(np.max(np.linalg.norm(find_extremes(coefficients, trajectory), axis=1)))
    return x, y, z, vector


def find_extremes(coefficients: FloatArray, trajectory: Trajectory) -> FloatArray:
    """Return the values of all pieces at their ends and where their squared norm is stationary, shape (m, axes)."""
    lengths = np.diff(trajectory.breaks_s)
    scaled = coefficients * (lengths[:, None] ** np.arange(coefficients.shape[1]))[..., None]
    return np.concatenate(
        [polynomial.polyval(np.fromiter(stationary_points(piece), float), piece).T for piece in scaled]
    )


def stationary_points(piece: FloatArray) -> Iterator[float]:
    """Yield 0, 1 and the stationary points between them of the squared norm of one piece, shape (n, axes)."""
    yield from (0.0, 1.0)
    if len(piece) <= 1:
        return
    slope = polynomial.polyder(np.sum([np.convolve(axis, axis) for axis in piece.T], axis=0))
    trimmed = polynomial.polytrim(slope, tol=1e-13 * float(np.max(np.abs(slope), initial=0.0)))
    for candidate in polynomial.polyroots(trimmed) if len(trimmed) > 1 else ():
        if abs(candidate.imag) < 1e-7 and 0 < candidate.real < 1:
            yield float(candidate.real)


def _acceleration_steps(trajectory: Trajectory) -> FloatArray:
    """Return the largest jump of the acceleration at a break, at the start or at the end, on x, y and z."""
    coefficients = slopes(trajectory, 2)
    lengths = np.diff(trajectory.breaks_s)
    ends = np.sum(coefficients * (lengths[:, None] ** np.arange(coefficients.shape[1]))[..., None], axis=1)
    rest = np.zeros((1, 3))
    jumps: FloatArray = np.abs(np.concatenate([coefficients[:, 0], rest]) - np.concatenate([rest, ends])).max(axis=0)
    return jumps


def _lost_vertical(trajectory: Trajectory, move: Move) -> tuple[float, float]:
    """Return how much of the vertical height at pick and at place is gone, exact at the breaks."""
    lengths = np.diff(trajectory.breaks_s)
    sizes = (
        np.abs(trajectory.coefficients[:, 1:, :2]) * (lengths[:, None] ** np.arange(1, _order(trajectory)))[..., None]
    )
    moving = np.flatnonzero(sizes.max(axis=(1, 2)) > STILL_M)
    if len(moving) == 0:
        return 0.0, 0.0
    start, end = trajectory(0.0)[2], trajectory(trajectory.duration_s)[2]
    pick = float(trajectory(trajectory.breaks_s[moving[0]])[2] - start)
    place = float(trajectory(trajectory.breaks_s[moving[-1] + 1])[2] - end)
    return _shortfall(move.pick_height_m, pick), _shortfall(move.place_height_m, place)


def _order(trajectory: Trajectory) -> int:
    return int(trajectory.coefficients.shape[1])


def _shortfall(wanted_m: float, reached_m: float) -> float:
    missing = wanted_m - reached_m
    return missing if missing > STILL_M else 0.0


def _path_deviation(shaped: Trajectory, unshaped: Trajectory, *, nodes: int = 4000) -> float:
    """Return the largest distance of one path from the other, as from a polyline of many nodes."""
    line = unshaped(np.union1d(np.linspace(0, unshaped.duration_s, nodes), unshaped.breaks_s))
    points = shaped(np.union1d(np.linspace(0, shaped.duration_s, nodes), shaped.breaks_s))
    nearest = np.asarray(cKDTree(line).query(points)[1], dtype=np.int64)
    before, after = (_segment_distance(points, line, nearest + side) for side in (-1, 0))
    return float(np.max(np.minimum(before, after)))


def _segment_distance(points: FloatArray, line: FloatArray, segment: IntArray) -> FloatArray:
    """Return each point's distance from the segment that begins at a node of the line."""
    first = np.clip(segment, 0, len(line) - 2)
    start, way = line[first], line[first + 1] - line[first]
    square = np.maximum(np.sum(way**2, axis=1), 1e-300)
    share = np.clip(np.sum((points - start) * way, axis=1) / square, 0, 1)
    distance: FloatArray = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    return distance


def _axes(values: FloatArray) -> Axes:
    return float(values[0]), float(values[1]), float(values[2])
