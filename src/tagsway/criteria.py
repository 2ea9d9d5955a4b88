"""The definitions behind the indicators: one code for a measured track and for thousands of simulated ones.

Cases stand in the last axes, of shape `…` below, and broadcast; what was not seen is NaN. Along the travel, which leads
from the tool's first place to its last, e is how far the product is beyond its resting place:

- settling time: from the start until |e| stays within ±2 % of the reference. 0 where it never leaves the band, shorter
  than the trajectory where it enters early, NaN where it is outside when the record ends.
- overshoot: the largest e, over the reference; 0 where it never passes its resting place. Before the end of the move
  it counts as well.
- motion time: the longer of trajectory and settling time.
- PCP acceleration: the largest |x''|, and the largest √(x''² + (z'' + g)²), what the gripper must hold.
- residual acceleration: largest and root-mean-square |x''| after the move, the latter over time.
- box error: the largest |x - x_end| from the instant at which the product, on its way down, passes the rim of the box,
  which lies `rim_m` above its resting place. NaN where it never was above the rim.
- place error: the largest |x - x_end| after the move.
"""

from dataclasses import dataclass

import numpy as np

from tagsway.model import GRAVITY_M_S2, BoolArray, FloatArray, IntArray

SETTLED = 0.02
"""Half the width of the band that counts as settled, over the reference."""

RIM_M = 0.05
"""Height of the box of document 1, Figure 8.3; 15 mm of room on either side."""

LEVEL_M = 1e-3
"""A tool lower than its highest by less has not begun to descend: else a camera's noise on a level way would."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Criteria:
    """How moves ended, each shape (…); NaN where it cannot be said.

    Parameters
    ----------
    reference_m : ndarray
        What the percentages refer to.
    settling_time_s, trajectory_time_s, motion_time_s : ndarray
        From the start of the move; NaN where it never settles.
    overshoot_percent : ndarray
        Of the reference.
    horizontal_m_s2, vector_m_s2 : ndarray
        Largest PCP acceleration, and the largest with gravity.
    residual_max_m_s2, residual_rms_m_s2 : ndarray
        After the move; NaN where the record ends with it.
    box_error_m, place_error_m : ndarray
        Below the rim of the box, and after the move.
    """

    reference_m: FloatArray
    settling_time_s: FloatArray
    trajectory_time_s: FloatArray
    motion_time_s: FloatArray
    overshoot_percent: FloatArray
    horizontal_m_s2: FloatArray
    vector_m_s2: FloatArray
    residual_max_m_s2: FloatArray
    residual_rms_m_s2: FloatArray
    box_error_m: FloatArray
    place_error_m: FloatArray


def judge_move(
    time_s: FloatArray,
    tcp_m: FloatArray,
    pcp_m: FloatArray,
    pcp_acceleration_m_s2: FloatArray,
    *,
    end_s: FloatArray | float,
    final_m: FloatArray,
    reference_m: float | None = None,
    rim_m: float = RIM_M,
) -> Criteria:
    """Judge rest-to-rest moves, as the head of this module defines it.

    Parameters
    ----------
    time_s : ndarray, shape (n, …)
        From the start of the move to the end of the record; not falling.
    tcp_m, pcp_m, pcp_acceleration_m_s2 : ndarray, shape (n, 2, …)
        x and z of tool and product, and the product's acceleration.
    end_s : ndarray, shape (…), or float
        When the tool stands again.
    final_m : ndarray, shape (2, …)
        Where the product comes to rest.
    reference_m : float, optional
        Length that the percentages refer to; by default the travel.
    rim_m : float
        Height of the box's rim above the resting place.

    Returns
    -------
    Criteria
        Where the tool did not travel, or the product was never seen, NaN.
    """
    travel = _last_seen(tcp_m) - _first_seen(tcp_m)
    distance = np.hypot(travel[0], travel[1])
    way = np.divide(travel, distance, out=np.full_like(travel, np.nan), where=distance > 0)
    away = pcp_m - final_m
    beyond = away[:, 0] * way[0] + away[:, 1] * way[1]
    reference = np.broadcast_to(distance if reference_m is None else reference_m, beyond.shape[1:]).astype(float)
    duration = np.broadcast_to(end_s - time_s[0], beyond.shape[1:]).astype(float)
    settling = find_settling(time_s, beyond, SETTLED * reference)
    horizontal, vector = load_of(pcp_acceleration_m_s2)
    later = (time_s > end_s) & np.isfinite(horizontal)
    after = np.where(later, horizontal, np.nan)
    sideways = np.abs(away[:, 0])
    return Criteria(
        reference_m=reference,
        settling_time_s=settling,
        trajectory_time_s=duration,
        motion_time_s=np.where(np.isnan(settling), np.nan, np.fmax(duration, settling)),
        overshoot_percent=100 * np.maximum(largest(beyond), 0.0) / reference,
        horizontal_m_s2=largest(horizontal),
        vector_m_s2=largest(vector),
        residual_max_m_s2=largest(after),
        residual_rms_m_s2=_root_mean_square(time_s, after, later),
        box_error_m=find_box_error(tcp_m[:, 1], away[:, 1], sideways, rim_m=rim_m),
        place_error_m=largest(np.where(time_s >= end_s, sideways, np.nan)),
    )


def load_of(acceleration_m_s2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return |x''| and what the gripper must hold, √(x''² + (z'' + g)²), each shape (n, …)."""
    x, z = acceleration_m_s2[:, 0], acceleration_m_s2[:, 1]
    return np.abs(x), np.hypot(x, z + GRAVITY_M_S2)


def find_settling(time_s: FloatArray, beyond_m: FloatArray, band_m: FloatArray) -> FloatArray:
    """Return when the product enters the band for good, interpolated, from the first time on, shape (…)."""
    time = np.broadcast_to(time_s, beyond_m.shape)
    away = np.abs(beyond_m)
    seen = np.isfinite(away)
    outside = seen & ~(away <= band_m)
    last = _last_true(outside)
    follows = seen & (_index(beyond_m) > last)
    following = np.argmax(follows, axis=0)
    t0, t1 = _at(time, np.maximum(last, 0)), _at(time, following)
    a0, a1 = _at(away, np.maximum(last, 0)), _at(away, following)
    share = np.divide(a0 - band_m, a0 - a1, out=np.zeros_like(a0), where=a0 > a1)
    entered = t0 + share * (t1 - t0) - time[0]
    never = ~follows.any(axis=0) | ~np.isfinite(band_m)
    return np.where(last < 0, np.where(seen.any(axis=0), 0.0, np.nan), np.where(never, np.nan, entered))


def largest(values: FloatArray) -> FloatArray:
    """Return the largest along the first axis of what was seen, shape (…); NaN where nothing was."""
    return np.asarray(np.fmax.reduce(values, axis=0))


def find_box_error(
    tool_up: FloatArray, above_end: FloatArray, sideways: FloatArray, *, rim_m: float = RIM_M
) -> FloatArray:
    """Return the largest |x - x_end| below the rim, after the tool was highest for the last time, shape (…).

    Parameters
    ----------
    tool_up, above_end, sideways : ndarray, shape (n, …)
        Height of the tool, of the product above its resting place, and |x - x_end| of the product.
    rim_m : float
        Above the resting place.
    """
    top: BoolArray = np.asarray(tool_up >= largest(tool_up) - LEVEL_M, dtype=bool)
    descending = _index(above_end) > _last_true(top)
    inside = descending & (above_end < rim_m)
    was_above = np.any(above_end >= rim_m, axis=0)
    return np.where(was_above, largest(np.where(inside, sideways, np.nan)), np.nan)


def _root_mean_square(time_s: FloatArray, values: FloatArray, used: BoolArray) -> FloatArray:
    """Return √(∫ v² dt / ∫ dt) over steps that are seen from end to end."""
    square = values**2
    step = np.where(used[1:] & used[:-1], np.diff(time_s, axis=0), 0.0)
    mean = (np.nan_to_num(square[1:]) + np.nan_to_num(square[:-1])) / 2
    total = step.sum(axis=0)
    weighed = (step * mean).sum(axis=0)
    mean_square: FloatArray = np.divide(weighed, total, out=np.full(weighed.shape, np.nan), where=total > 0)
    return np.asarray(np.sqrt(mean_square))


def _first_seen(place_m: FloatArray) -> FloatArray:
    first = np.argmax(_seen(place_m), axis=0)
    return _at(place_m, np.broadcast_to(first, place_m.shape[1:]))


def _last_seen(place_m: FloatArray) -> FloatArray:
    last = np.maximum(_last_true(_seen(place_m)), 0)
    return _at(place_m, np.broadcast_to(last, place_m.shape[1:]))


def _seen(place_m: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(place_m[:, 0]) & np.isfinite(place_m[:, 1]), dtype=bool)


def _last_true(flags: BoolArray) -> IntArray:
    """Return the last index along the first axis that is true, -1 where none is."""
    last = len(flags) - 1 - np.argmax(flags[::-1], axis=0)
    return np.where(flags.any(axis=0), last, -1)


def _index(values: FloatArray) -> IntArray:
    """Return 0, 1, 2 … along the first axis, to broadcast against `values`."""
    return np.arange(len(values)).reshape(-1, *([1] * (values.ndim - 1)))


def _at(values: FloatArray, index: IntArray) -> FloatArray:
    """Return the values at one index along the first axis for each case."""
    return np.asarray(np.take_along_axis(values, index[None], axis=0)[0])
