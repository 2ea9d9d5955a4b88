"""What ends a grip: a payload that peels off, slips, or is not seen any more."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.modal.rests import estimate_noise
from tagsway.modal.slip import find_slip
from tagsway.modal.sway import remove_spikes
from tagsway.model import GRAVITY_M_S2, BoolArray, Estimate, Event, EventKind, FloatArray, Notice, Track

LOST_S = 0.3
"""A product whose tag is not seen for so long, to the record's end, is lost."""

FALL_STD_M_S2 = 0.8
"""Standard error at which an acceleration is told from gravity's: a fall is looked at for as long as that takes."""

FEWEST, LONGEST_FALL_S = 5, 0.06
"""Samples and time over which a fall is looked at."""

FALL_TOLERANCE_M_S2 = 1.5
"""By which a fall may differ from gravity beside its error: a camera that is not level, drag, a scale that is off."""

LEFT_STD = 6.0
"""Standard errors of its noise by which a product's distance from the tool must grow."""

OFF_STD = 8.0
"""The same of one that is lost while it falls: 25 ms of a fall make 11 and more at 0.05 mm, a hand's drag up to 6."""

LEAST_GROWTH = 0.03
"""Share of the distance from the pivot by which it must have grown, whenever the product is seen after a peel-off."""

SOON_S = 0.06
"""After which it has: by 18 mm in a free fall."""

BEFORE_S, AFTER_S = 0.05, 0.06
"""Around a peel-off, in which its instant is looked for."""

LAST_SIGHTINGS = (5, 7, 10)
"""Before the last one, at which a product that is lost while it falls may have begun to."""

LEAST_PARTING_M_S2 = 3.0
"""What held a product must have accelerated it by more, beside gravity: else nothing tells its fall from its sway."""

TIMES_S = 1e-3
"""Apart, the instants that are tried."""

FRAME_SHARE = 0.5
"""Of the distance between two frames, by which an instant between them is not known."""

LAST_S = 0.05
"""Before an event, over which the acceleration is averaged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sightings:
    """The product where it was seen, and its place relative to the tool."""

    time_s: FloatArray
    product: FloatArray
    relative: FloatArray
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parting:
    """When a product began to fall, and by how much what held it had accelerated it beside gravity, in m/s²."""

    time_s: Estimate
    acceleration: float


def find_events(track: Track) -> tuple[Event, ...]:
    """Find what happened to the grip.

    Parameters
    ----------
    track : Track
        Raw.

    Returns
    -------
    tuple of Event
        In their order. A slip is looked for before a peel-off only.

    Notes
    -----
    A product that peels off does two things at once: its acceleration becomes gravity's, and its distance from the tool
    grows, to the last time that it is seen. The first alone is also true of a tool that moves down, the second of a
    jump of the tag or of a slip. Without a scale a fall shows as a distance that doubles while the product goes down.
    One that is lost while it falls has only begun to leave its arc; a tag that is covered is still on it. The instant
    is the one from which on a fall fits best, after a motion of even jerk; without a scale, where the distance begins
    to grow. Where the tool itself goes down as fast as it would fall, a product that it holds and one that it lost
    move alike: the begin of that is given.
    """
    seen = _look(track)
    if seen is None:
        return ()
    lost = _is_lost(track, float(seen.time_s[-1]))
    peel = _find_fall(seen, lost=lost) if track.length_unit == "m" else _find_runaway(seen)
    held = seen if peel is None else _until(seen, peel.value)
    events = []
    # Without the tool's tag, a move of the tool would look the same.
    slip = None if track.tcp is None else find_slip(held.time_s, held.relative, held.product - held.relative)
    if slip is not None:
        events.append(_make(held, "grip_slip", slip.time_s, slip.growth if track.length_unit == "m" else None, track))
    if peel is not None:
        events.append(_make(held, "peel_off", peel, None, track))
    elif lost:
        step = float(np.median(np.diff(track.time_s)))
        events.append(_make(held, "product_lost", Estimate.normal(float(seen.time_s[-1]), step), None, track))
    return tuple(events)


def describe_events(events: Sequence[Event]) -> tuple[Notice, ...]:
    """Return what happened in words, a notice each."""
    return tuple(Notice(code=event.kind, message=_describe(event)) for event in events)


def _describe(event: Event) -> str:
    words = f"{event.words} at {event.time_s.value:.3f} ± {max(event.time_s.std, 5e-4):.3f} s"
    if event.growth_m is not None:
        words += f", by {1e3 * event.growth_m.value:.2g} ± {1e3 * event.growth_m.std:.1g} mm"
    held, horizontal = event.held_acceleration_m_s2, event.horizontal_acceleration_m_s2
    if held is not None and horizontal is not None:
        words += (
            f"; just before, it was accelerated by {horizontal.value:.1f} ± {horizontal.std:.1f} m/s² horizontally, "
            f"and the gripper had to hold {held.value:.1f} ± {held.std:.1f} m/s² with gravity"
        )
    return words + ("; what follows is not used" if event.ends_grip else "")


def _look(track: Track) -> _Sightings | None:
    product = track.pcp.position
    tool = np.zeros_like(product) if track.tcp is None else track.tcp.position
    both = np.isfinite(product).all(axis=1) & np.isfinite(tool).all(axis=1)
    if np.count_nonzero(both) < 4 * FEWEST:
        return None
    clean = np.column_stack([remove_spikes(axis) for axis in product[both].T])
    relative = clean - np.column_stack([remove_spikes(axis) for axis in tool[both].T])
    if track.tcp is None:
        # Without a tool the product hangs from somewhere: from above, as far as it swings.
        relative = relative - np.median(relative, axis=0) - [0.0, 2 * float(np.ptp(relative[:, 0])) + 1e-9]
    noise = max(estimate_noise(axis) for axis in relative.T)
    return _Sightings(time_s=track.time_s[both], product=clean, relative=relative, noise=noise)


def _until(seen: _Sightings, end_s: float) -> _Sightings:
    kept = seen.time_s <= end_s
    return _Sightings(
        time_s=seen.time_s[kept], product=seen.product[kept], relative=seen.relative[kept], noise=seen.noise
    )


def _is_lost(track: Track, last_s: float) -> bool:
    after = track.time_s > last_s
    if not float(track.time_s[-1]) - last_s > LOST_S:
        return False
    return track.tcp is None or bool(np.mean(np.isfinite(track.tcp.position[after, 0])) > 0.5)


def _find_fall(seen: _Sightings, *, lost: bool) -> Estimate | None:
    """Return when a product left its arc to fall, in metres."""
    step = float(np.median(np.diff(seen.time_s)))
    last = len(seen.time_s) - 1
    distance = np.hypot(*seen.relative.T)
    found: Estimate | None = None
    reach = np.inf
    for first in sorted({*_find_falls(seen, step), *(max(last - back, 0) for back in LAST_SIGHTINGS)}):
        # A tool that goes down as fast as it would fall comes before: the last begin at which it is still held counts.
        parting = None if distance[first] > reach else _find_parting(seen, first)
        if parting is None or not parting.acceleration > LEAST_PARTING_M_S2:
            continue
        start = parting.time_s.value
        soon_over = lost and float(seen.time_s[-1]) - start < LOST_S
        gone = soon_over and _falls_from(seen, float(seen.time_s[last - FEWEST])) and _leaves_arc(seen, start)
        if _falls_from(seen, start) and (gone or _stays_away(seen, start)):
            found = parting.time_s
            near = distance[np.abs(seen.time_s - start) < 3 * step]
            reach = min(reach, (1 + LEAST_GROWTH) * float(np.median(near)) + LEFT_STD * seen.noise)
    return found


def _stays_away(seen: _Sightings, start_s: float) -> bool:
    """Return whether the product is farther from the pivot than before, as long as it is seen."""
    distance = np.hypot(*(seen.relative - _find_pivot(seen, start_s)).T)
    before, after = distance[seen.time_s <= start_s][-FEWEST:], distance[seen.time_s > start_s + SOON_S]
    if not len(after):
        after = distance[seen.time_s > start_s][-2:]
    return bool(np.mean(after > (1 + LEAST_GROWTH) * np.median(before) + LEFT_STD * seen.noise) > 0.9)


def _leaves_arc(seen: _Sightings, start_s: float) -> bool:
    """Return whether its distance from the pivot, as it was last seen, is off the line on which it had been going.

    What a hand covers is still on its arc, whose acceleration may be gravity's for a moment.
    """
    distance = np.hypot(*(seen.relative - _find_pivot(seen, start_s)).T)
    held = int(np.searchsorted(seen.time_s, start_s, side="right"))
    before = slice(min(int(np.searchsorted(seen.time_s, start_s - BEFORE_S)), max(held - FEWEST, 0)), held)
    if not held >= FEWEST or not len(seen.time_s) - held >= 2:
        return False
    line = np.polynomial.Polynomial.fit(seen.time_s[before], distance[before], 1)
    return bool(abs(np.mean((distance - line(seen.time_s))[-2:])) > OFF_STD * seen.noise)


def _falls_from(seen: _Sightings, start_s: float) -> bool:
    """Return whether the product's acceleration, as far as it was seen, was gravity's from an instant on."""
    inside = (seen.time_s >= start_s) & (seen.time_s <= start_s + LONGEST_FALL_S)
    if np.count_nonzero(inside) < FEWEST - 1:
        return False
    time = seen.time_s[inside] - start_s
    rows = np.column_stack([np.ones(len(time)), time, time**2 / 2])
    acceleration = np.linalg.lstsq(rows, seen.product[inside], rcond=None)[0][2]
    std = seen.noise * float(np.sqrt(np.linalg.pinv(rows.T @ rows)[2, 2]))
    return bool(np.hypot(acceleration[0], acceleration[1] + GRAVITY_M_S2) < FALL_TOLERANCE_M_S2 + 3 * std)


def _find_parting(seen: _Sightings, first: int) -> _Parting | None:
    """Return the instant near a sample from which on the product falls, after any smooth motion before."""
    near_s = float(seen.time_s[first])
    inside = (seen.time_s >= near_s - BEFORE_S) & (seen.time_s <= near_s + AFTER_S)
    time, place = seen.time_s[inside] - near_s, seen.product[inside]
    if len(time) < 2 * FEWEST:
        return None
    tried = np.arange(time[FEWEST - 2], time[-FEWEST + 2], TIMES_S)
    misfit, held = np.empty(len(tried)), np.empty((len(tried), 2))
    for k, begin in enumerate(tried):
        before, after = np.minimum(time - begin, 0.0), np.maximum(time - begin, 0.0)
        rows = np.column_stack([np.ones(len(time)), time - begin, before**2 / 2, before**3 / 6])
        rest = place + [0.0, GRAVITY_M_S2 / 2] * after[:, None] ** 2
        answer, *_ = np.linalg.lstsq(rows, rest, rcond=None)
        misfit[k], held[k] = float(np.sum((rest - rows @ answer) ** 2)), answer[2]
    best = int(np.argmin(misfit))
    if best in (0, len(tried) - 1):
        return None
    noise = max(float(np.sqrt(misfit[best] / max(2 * len(time) - 9, 1))), seen.noise / np.sqrt(2), 1e-15)
    return _Parting(
        time_s=_instant(near_s, tried, misfit / noise**2, float(np.median(np.diff(seen.time_s)))),
        acceleration=float(np.hypot(held[best, 0], held[best, 1] + GRAVITY_M_S2)),
    )


def _instant(near_s: float, tried: FloatArray, misfit: FloatArray, step: float) -> Estimate:
    """Return the best of the instants, and the spread of those that are as likely."""
    likely = tried[misfit < np.min(misfit) + 1]
    std = float(np.hypot(np.ptp(likely) / 2 + TIMES_S, FRAME_SHARE * step))
    return Estimate.normal(near_s + float(tried[int(np.argmin(misfit))]), std)


def _find_falls(seen: _Sightings, step: float) -> list[int]:
    """Return the first samples of the stretches in which the product is accelerated as in a free fall."""
    count = FEWEST
    while count * step < LONGEST_FALL_S and _acceleration_std(seen.noise, count, step) > FALL_STD_M_S2:
        count += 2
    if len(seen.time_s) < count:
        return []
    acceleration, whole = _slide_parabola(seen, count)
    error = _acceleration_std(seen.noise, count, step)
    away = np.hypot(acceleration[:, 0], acceleration[:, 1] + GRAVITY_M_S2)
    falls = whole & (away < FALL_TOLERANCE_M_S2 + 3 * error)
    starts = np.flatnonzero(falls & ~np.concatenate([[False], falls[:-1]]))
    return [int(k) for k in starts]


def _acceleration_std(noise: float, count: int, step: float) -> float:
    """Return the standard error of twice a parabola's leading coefficient, of `count` even samples."""
    place = np.arange(count) - (count - 1) / 2
    curved = place**2 - np.mean(place**2)
    return 2 * noise / float(np.linalg.norm(curved)) / step**2


def _slide_parabola(seen: _Sightings, count: int) -> tuple[FloatArray, BoolArray]:
    """Return the mean acceleration over `count` samples from each on, and whether these have no gap among them."""
    time = np.lib.stride_tricks.sliding_window_view(seen.time_s, count)
    place = time - time.mean(axis=1, keepdims=True)
    # The part of the square that a straight line does not explain.
    square = place**2 - np.mean(place**2, axis=1, keepdims=True)
    square -= place * (np.sum(square * place, axis=1) / np.sum(place**2, axis=1))[:, None]
    weight = 2 * square / np.sum(square**2, axis=1, keepdims=True)
    position = np.lib.stride_tricks.sliding_window_view(seen.product, count, axis=0)
    span = time[:, -1] - time[:, 0]
    whole = span < 1.6 * (count - 1) * float(np.median(np.diff(seen.time_s)))
    return np.einsum("nak,nk->na", position, weight), whole


def _find_runaway(seen: _Sightings) -> Estimate | None:
    """Return when, without a scale, the distance began to grow to twice its size and more, while the product fell."""
    distance = np.hypot(*seen.relative.T)
    usual = float(np.median(distance[: max(8, len(distance) // 10)]))
    near = np.flatnonzero(~(distance > 2 * usual))
    if len(near) == 0 or near[-1] == len(distance) - 1:
        return None
    left = int(near[-1]) + 1
    close = np.flatnonzero(distance[:left] < usual + max(0.05 * usual, LEFT_STD * seen.noise))
    first = int(close[-1]) if len(close) else 0
    if not (seen.product[left, 1] < seen.product[first, 1] and seen.time_s[left] - seen.time_s[first] < LOST_S):
        return None
    near_s = float(seen.time_s[first])
    inside = (seen.time_s >= near_s - BEFORE_S) & (seen.time_s <= near_s + AFTER_S / 2)
    time = seen.time_s[inside] - near_s
    if len(time) < FEWEST + 3:
        return None
    away = np.hypot(*(seen.relative[inside] - _find_pivot(seen, near_s)).T)
    tried = np.arange(time[2], time[-2], TIMES_S)
    basis = np.linalg.qr(np.column_stack([np.ones(len(time)), time]))[0]
    rest = away - basis @ (basis.T @ away)
    bends = np.maximum(time[:, None] - tried, 0.0) ** 2
    bends = bends - basis @ (basis.T @ bends)
    gain = np.maximum(bends.T @ rest, 0.0) ** 2 / np.sum(bends**2, axis=0)
    noise = max(float(np.sqrt(max(rest @ rest - gain.max(), 0.0) / len(time))), seen.noise, 1e-15)
    return _instant(near_s, tried, -gain / noise**2, float(np.median(np.diff(seen.time_s))))


def _find_pivot(seen: _Sightings, until_s: float) -> FloatArray:
    """Return the centre of the arc seen so far, relative to the tool's tag; the tag where too little of it was seen."""
    before = seen.relative[seen.time_s < until_s - 0.02][:: max(1, len(seen.time_s) // 2000)]
    if len(before) < 20 or not float(np.ptp(before[:, 0])) > 0.3 * float(np.median(np.hypot(*before.T))):
        return np.zeros(2)
    rows = np.column_stack([2 * before, np.ones(len(before))])
    square, weight = np.sum(before**2, axis=1), np.ones(len(before))
    for _ in range(6):
        circle = np.linalg.lstsq(rows * weight[:, None], square * weight, rcond=None)[0]
        residual = np.abs(square - rows @ circle)
        weight = 1 / np.sqrt(1 + (residual / max(2 * float(np.median(residual)), 1e-15)) ** 2)
    return np.asarray(circle[:2])


def _make(held: _Sightings, kind: EventKind, time_s: Estimate, growth: Estimate | None, track: Track) -> Event:
    inside = (held.time_s >= time_s.value - LAST_S) & (held.time_s <= time_s.value)
    horizontal = vector = None
    if np.count_nonzero(inside) >= FEWEST and track.length_unit == "m":
        time = held.time_s[inside] - time_s.value
        rows = np.column_stack([np.ones(len(time)), time, time**2 / 2])
        (_, _, (ax, az)), *_ = np.linalg.lstsq(rows, held.product[inside], rcond=None)
        noise = max(estimate_noise(held.product[:, axis]) for axis in (0, 1))
        std = noise * float(np.sqrt(np.linalg.pinv(rows.T @ rows)[2, 2]))
        horizontal = Estimate.normal(float(abs(ax)), std, low=0.0)
        vector = Estimate.normal(float(np.hypot(ax, az + GRAVITY_M_S2)), std, low=0.0)
    return Event(
        kind=kind,
        time_s=time_s,
        horizontal_acceleration_m_s2=horizontal,
        held_acceleration_m_s2=vector,
        growth_m=growth,
    )
