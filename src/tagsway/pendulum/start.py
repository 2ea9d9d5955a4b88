"""Where the fit of a pendulum starts: the arc's geometry, then a coarse grid simulated all at once."""

import numpy as np

from tagsway.model import GRAVITY_M_S2, FloatArray, ModalEstimate
from tagsway.pendulum.arc import Arc, fit_arc
from tagsway.pendulum.model import Unknown, predict_angle
from tagsway.pendulum.record import Record

LENGTH_OVER_RADIUS = np.array([0.4, 0.55, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.45, 1.7, 2.0, 2.5])
"""A slender body that hangs from its end has 4/3 where the tag sits at its tip, 2 where it sits at 2/3 of that."""

FREQUENCY_OVER_MODAL = np.array([0.97, 0.985, 1.0, 1.015, 1.03])
"""Around the decay's frequency: the basin of a fit over n swings is about 1/(4 n) wide."""

LARGE_SWING_RAD = 1.0
"""Above which several starts are polished: the pendulum's period then hangs on every start value."""


def find_arc(record: Record, fallback_radius_m: float) -> Arc:
    """Return the arc that the positions and the tag's rotation tell together.

    Parameters
    ----------
    record : Record
        With the sway and the tag's angle.
    fallback_radius_m : float
        Radius to start from where the payload swings too little to show one: the error is then infinite.
    """
    arc = fit_arc(
        record.sway_m,
        record.sway_std_m,
        record.angle_rad,
        record.angle_std_rad,
        angle_short_rad=record.angle_short_rad,
        tool_turn_rad=record.tool_turn_rad,
        tool_m=record.tool_m,
    )
    if arc.radius_std_m <= 0.2 * arc.radius_m and arc.radius_m < 20 * fallback_radius_m:
        return arc
    bottom = np.nanmedian(record.sway_m, axis=0)
    return Arc(
        centre_m=bottom + np.array([0.0, fallback_radius_m]),
        radius_m=fallback_radius_m,
        covariance_m2=np.diag([np.inf, np.inf, np.inf]),
    )


def angle_on(arc: Arc, sway_m: FloatArray) -> FloatArray:
    """Return the angle from straight down of positions, shape (n, 2), about the arc's centre."""
    away = sway_m - arc.centre_m
    return np.asarray(np.arctan2(away[:, 0], -away[:, 1]))


def find_starts(record: Record, arc: Arc, modal: ModalEstimate) -> list[FloatArray]:
    """Return parameter vectors to polish, the best first.

    Parameters
    ----------
    record : Record
        The data.
    arc : Arc
        Pivot and radius.
    modal : ModalEstimate
        Gives f_n and ζ where it knows them; else frequencies around that of a point mass at the tag are tried.

    Returns
    -------
    list of ndarray, shape (15,)
        The grid's best, and where the swing is large the two next best of another length.
    """
    base = _base(record, arc, modal)
    if modal.natural_frequency_hz is not None:
        frequencies = modal.natural_frequency_hz.value * FREQUENCY_OVER_MODAL
    else:
        point = float(np.sqrt(GRAVITY_M_S2 / arc.radius_m) / (2 * np.pi))
        count = int(np.clip(np.ceil(point * record.duration_s / 0.15), 8, 60))
        frequencies = np.linspace(0.6, 1.7, count) * point
    grid = np.stack(np.meshgrid(frequencies, LENGTH_OVER_RADIUS * arc.radius_m, [0.0, 0.1], indexing="ij"))
    f, length, drag = grid.reshape(3, -1)
    candidates = np.repeat(base[:, None], len(f), axis=1)
    candidates[Unknown.LOG_FREQUENCY] = np.log(f)
    candidates[Unknown.LOG_LENGTH] = np.log(length)
    candidates[Unknown.DRAG] = drag
    with np.errstate(all="ignore"):
        angle = predict_angle(record, candidates)
    radius, centre, cost = _lay_on(record.sway_m, angle)
    candidates[Unknown.LOG_RADIUS] = np.where(
        np.abs(radius / arc.radius_m - 1) < 0.3, np.log(np.maximum(radius, 1e-6)), np.log(arc.radius_m)
    )
    kept = np.abs(radius / arc.radius_m - 1) < 0.3
    candidates[Unknown.OFFSET_X : Unknown.OFFSET_Z + 1, kept] = centre[:, kept]
    order = np.argsort(cost)
    large = float(np.nanmax(np.abs(angle_on(arc, record.sway_m)))) > LARGE_SWING_RAD
    chosen = [int(order[0])]
    for i in order:
        if large and len(chosen) < 3 and not np.any(np.isclose(length[i], length[chosen])):
            chosen.append(int(i))
    return [candidates[:, i] for i in chosen]


def _base(record: Record, arc: Arc, modal: ModalEstimate) -> FloatArray:
    """Return a vector with the start of the motion and the offsets filled in."""
    q = angle_on(arc, record.sway_m)
    seen = np.flatnonzero(np.isfinite(q))
    since = record.time_s - record.nodes_s[0]
    near = seen[: max(6, int(np.count_nonzero(since[seen] < 0.06)))]
    # A parabola over the first instants; at rest before a move all but its constant is noise, and small.
    slope = np.polynomial.polynomial.polyfit(since[near], q[near], 2)
    base = np.zeros(len(Unknown))
    base[Unknown.LOG_RADIUS] = np.log(arc.radius_m)
    base[Unknown.DAMPING_RATIO] = 0.01 if modal.damping_ratio is None else np.clip(modal.damping_ratio.value, 0, 0.3)
    base[Unknown.OFFSET_X : Unknown.OFFSET_Z + 1] = arc.centre_m
    base[Unknown.ANGLE], base[Unknown.RATE] = slope[0], slope[1]
    if np.any(np.isfinite(record.angle_rad)):
        base[Unknown.TAG_ANGLE] = np.nanmedian(record.angle_rad - q) if np.any(np.isfinite(record.angle_rad - q)) else 0
    return base


def _lay_on(sway: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the radius and centre that lay each simulated arc on the measured sway, and the mean distance left."""
    seen = np.all(np.isfinite(sway), axis=1)
    x, z = sway[seen, :1], sway[seen, 1:]
    with np.errstate(all="ignore"):
        sine, down = np.sin(angle[seen]), -np.cos(angle[seen])
        ds, dd = sine - sine.mean(axis=0), down - down.mean(axis=0)
        radius = np.sum(ds * (x - x.mean()) + dd * (z - z.mean()), axis=0) / np.sum(ds**2 + dd**2, axis=0)
        centre = np.stack([x.mean() - radius * sine.mean(axis=0), z.mean() - radius * down.mean(axis=0)])
        cost = np.mean(np.hypot(x - centre[0] - radius * sine, z - centre[1] - radius * down), axis=0)
    return radius, centre, np.where(np.isfinite(cost), cost, np.inf)
