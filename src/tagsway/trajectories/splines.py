"""The B-spline of degree 5: at rest up to its fourth derivative at both ends."""

import math

import numpy as np
from scipy.interpolate import BSpline

from tagsway.model import Move, Trajectory
from tagsway.trajectories.limits import find_peaks
from tagsway.trajectories.pieces import stretch
from tagsway.trajectories.profiles import refuse_heights

DEGREE = 5


def plan_b_spline(move: Move) -> Trajectory:
    """Plan a move as a uniform B-spline of degree 5, through waypoints or straight, as quick as the limits allow.

    Parameters
    ----------
    move : Move
        Its `waypoints_m` are passed through one interval after another: points at even distances make an even speed.
        Velocity, acceleration and jerk limits hold for the vector.

    Returns
    -------
    Trajectory
        n + 5 pieces for n waypoints; continuous up to the fourth derivative, which is 0 at both ends.

    Notes
    -----
    x(t) = Σ d_i B_i(t) with five control points at each end. The basis function of a waypoint is 66/120 at its own time
    and 26/120 and 1/120 at its neighbours', so the points between are well determined. Without waypoints it is a step
    averaged five times over a fifth of the duration: smoother than the quintic, and slower. Between waypoints the
    curve may swing out beyond the polygon: give the box as a limit.
    """
    refuse_heights(move)
    points = np.array([move.from_m, *move.waypoints_m, move.to_m])
    inner = len(points) - 2
    control = np.concatenate([np.repeat(points[:1], DEGREE, 0), points[1:-1], np.repeat(points[-1:], DEGREE, 0)])
    knots = np.arange(-DEGREE, inner + 2 * DEGREE + 1, dtype=float)
    if inner:
        # The basis function of control point i is centred (DEGREE + 1)/2 after its first knot, i - DEGREE.
        times = np.arange(inner) + (DEGREE + 1) / 2
        basis = BSpline.design_matrix(times, knots, DEGREE).toarray()
        own = slice(DEGREE, DEGREE + inner)
        control[own] = 0.0
        control[own] = np.linalg.solve(basis[:, own], points[1:-1] - basis @ control)
    spline = BSpline(knots, control, DEGREE)
    breaks = np.arange(inner + DEGREE + 1, dtype=float)
    powers = [spline(breaks[:-1], nu=power) / math.factorial(power) for power in range(DEGREE + 1)]
    unit = Trajectory(breaks_s=breaks, coefficients=np.stack(powers, axis=1))
    limits = [(1, move.max_velocity_m_s), (2, move.max_acceleration_m_s2), (3, move.max_jerk_m_s3)]
    factor = max((find_peaks(unit, n)[3] / limit) ** (1 / n) for n, limit in limits if limit is not None)
    return stretch(unit, factor)
