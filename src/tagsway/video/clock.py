"""The true time of each frame, from the stamps that the container holds."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray, Notice
from tagsway.video.runs import ONE_RUN, Runs

_MILLISECOND = 1e-3
_SIXHUNDREDTH = 1 / 600
_STEADY = 0.1  # intervals of one rate differ by less than this, beside the rounding
_BREAK = 1.9  # slow motion is at least half of the rate; dim light makes phones slow down by less
_SHORTEST_PART = 16  # frames of one rate in a row ...
_SMALLEST_SHARE = 0.05  # ... and this share of all; shorter ones are bursts
_MOST_PARTS = 5  # an edit leaves two or three; more are a camera that cannot hold a rate
_REAL_CAPTURE_RATIO = 1.5  # a phone that misses its nominal rate by less has true stamps


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """When each frame of a file was taken.

    Parameters
    ----------
    stamps : ndarray of int, shape (n,)
        The container's stamps, rising, one a frame.
    time_s : ndarray, shape (n,)
        Time of each, 0 at the first, rising.
    by_order : bool
        True where the file has no stamps: then the k-th image belongs to the k-th time.
    uniform : bool
        True where the stamps agree with a uniform clock within their rounding: then the times are that clock's.
    fps_hz : float
        Capture rate; of a clock that is not uniform, the mean.
    time_source : {"container", "option", "metadata"}
        What the rate was taken from.
    pts_rounding_s : float
        Step of the container's stamps, in seconds of capture.
    dropped, duplicated : int
        Places of the uniform clock without a frame; frames whose stamp another one has already.
    runs : Runs
        Of the file's packets: what several decoders can share out among them.
    notices : tuple of Notice
        What the user should know of it.
    """

    stamps: IntArray
    time_s: FloatArray
    by_order: bool
    uniform: bool
    fps_hz: float
    time_source: Literal["container", "option", "metadata"]
    pts_rounding_s: float
    dropped: int
    duplicated: int
    runs: Runs = ONE_RUN
    notices: tuple[Notice, ...] = ()


def fit_clock(
    stamps: IntArray,
    *,
    tick_s: float,
    header_hz: float | None = None,
    fps_hz: float | None = None,
    captured_hz: float | None = None,
    by_order: bool = False,
) -> Clock:
    """Return the clock behind a file's time stamps.

    Parameters
    ----------
    stamps : ndarray of int, shape (n,)
        Of all frames, in any order, in ticks.
    tick_s : float
        Seconds to a tick.
    header_hz : float or None
        The rate that the header states; taken where the stamps cannot tell it from their own.
    fps_hz : float or None
        Capture rate that the user gave; the times are scaled to it.
    captured_hz : float or None
        Capture rate in the file's metadata; used where it is far from the stamps' own, as slow motion's is.
    by_order : bool
        Passed through.

    Returns
    -------
    Clock
        Uniform where the stamps allow it, with what was dropped left out; else the stamps' own times.

    Raises
    ------
    InputError
        For fewer than two frames, and for two rates in one file, which is what edited slow motion leaves.

    Notes
    -----
    A stamp is the true time rounded to some step: the tick, the largest step that divides all stamps, or a
    millisecond or 1/600 s that an earlier container left. t_i = t_0 + T k_i with whole k_i is fitted by least
    squares, the stretch doubled as T becomes known, and holds where no stamp is off by more than that step.
    """
    given = np.sort(np.asarray(stamps, dtype=np.int64))
    unique = np.unique(given)
    if len(unique) < 2:
        raise InputError(f"the video has {len(given)} frame: expected a film of at least two")
    raw_s: FloatArray = (unique - unique[0]).astype(np.float64) * tick_s
    _refuse_two_rates(raw_s, tick_s)
    fitted = _fit_uniform(raw_s, unique - unique[0], tick_s)
    places, period_s, rounding_s = fitted or (None, float(raw_s[-1]) / (len(raw_s) - 1), tick_s)
    if places is not None and header_hz and abs(header_hz * period_s - 1) * places[-1] * period_s < rounding_s:
        period_s = 1 / header_hz
    scale, source, notices = _choose_rate(1 / period_s, fps_hz, captured_hz)
    time_s = scale * (raw_s if places is None else places.astype(np.float64) * period_s)
    return Clock(
        stamps=unique,
        time_s=time_s,
        by_order=by_order,
        uniform=places is not None,
        fps_hz=(len(unique) - 1) / float(time_s[-1]) if places is None else 1 / (scale * period_s),
        time_source=source,
        pts_rounding_s=scale * rounding_s,
        dropped=0 if places is None else int(places[-1]) + 1 - len(unique),
        duplicated=len(given) - len(unique),
        notices=notices,
    )


def count_clock(numbers: IntArray, *, tick_s: float, fps_hz: float | None = None) -> Clock:
    """Return the clock of frames that are numbered evenly, as a high-speed camera's are: a missing number was dropped.

    Parameters
    ----------
    numbers : ndarray of int, shape (n,)
        Rising.
    tick_s : float
        Time from one number to the next as the source states it; NaN where it does not.
    fps_hz : float or None
        The rate that the user gave, in numbers a second.

    Returns
    -------
    Clock
        Uniform, 0 at the first number.

    Raises
    ------
    InputError
        Where nobody knows the rate.
    """
    if fps_hz is None and not (tick_s > 0 and math.isfinite(tick_s)):
        raise InputError("its images hold no times: give the capture rate with --fps")
    if fps_hz is not None:
        _check_rate(fps_hz)
    rate_hz = 1 / tick_s if fps_hz is None else fps_hz
    return Clock(
        stamps=numbers,
        time_s=(numbers - numbers[0]) / rate_hz,
        by_order=False,
        uniform=True,
        fps_hz=rate_hz,
        time_source="container" if fps_hz is None else "option",
        pts_rounding_s=0.0,
        dropped=int(numbers[-1] - numbers[0]) + 1 - len(numbers),
        duplicated=0,
    )


def _check_rate(fps_hz: float) -> None:
    if not (fps_hz > 0 and math.isfinite(fps_hz)):
        raise InputError(f"--fps is {fps_hz:g}: expected the capture rate in Hz, a positive number")


def _choose_rate(
    own_hz: float, fps_hz: float | None, captured_hz: float | None
) -> tuple[float, Literal["container", "option", "metadata"], tuple[Notice, ...]]:
    """Return the factor on all times, where it comes from, and what to say about it."""
    if fps_hz is not None:
        _check_rate(fps_hz)
        return own_hz / fps_hz, "option", ()
    if captured_hz is None or not (captured_hz > 0 and math.isfinite(captured_hz)):
        return 1.0, "container", ()
    if 1 / _REAL_CAPTURE_RATIO < captured_hz / own_hz < _REAL_CAPTURE_RATIO:
        return 1.0, "container", ()
    words = (
        f"the file plays at {own_hz:.5g} fps, but its metadata say that it was captured at {captured_hz:.5g} fps: "
        "the times were scaled to that; --fps overrides it"
    )
    return own_hz / captured_hz, "metadata", (Notice(code="capture_rate_from_metadata", message=words),)


def _fit_uniform(raw_s: FloatArray, ticks: IntArray, tick_s: float) -> tuple[IntArray, float, float] | None:
    """Return whole places, period and rounding of the uniform clock that the stamps agree with, if there is one."""
    common_s = int(np.gcd.reduce(ticks)) * tick_s
    steps = np.diff(raw_s)
    coarse = [step for step in sorted({common_s, _MILLISECOND, _SIXHUNDREDTH}) if _lie_on_grid(raw_s, step, tick_s)]
    for share in (0.5, 0.2, 0.03):  # where many frames were dropped, the usual step is two periods or more
        usual = float(np.quantile(steps, share))
        places, period, off_s = _count_periods(raw_s, float(steps[steps < 1.6 * usual].mean()))
        for rounding in (tick_s, *coarse):
            if rounding < 0.6 * period and np.all(np.diff(places) > 0) and off_s <= 1.3 * rounding + 1e-9 * raw_s[-1]:
                return places, period, rounding
    return None


def _lie_on_grid(raw_s: FloatArray, step_s: float, tick_s: float) -> bool:
    """Tell whether an earlier container had rounded the stamps to a step coarser than the tick."""
    off = raw_s / step_s - np.rint(raw_s / step_s)
    return bool(step_s > tick_s and np.ptp(off) * step_s <= 2.1 * tick_s)


def _count_periods(raw_s: FloatArray, period: float) -> tuple[IntArray, float, float]:
    """Return each stamp's whole number of periods, the period by least squares, and the residuals' range."""
    known, offset = min(8, len(raw_s)), 0.0
    while True:
        places = np.rint((raw_s[:known] - offset) / period)
        if np.ptp(places) > 0:
            period, offset = (float(value) for value in np.polyfit(places, raw_s[:known], 1))
        if known == len(raw_s):
            return (places - places[0]).astype(np.int64), period, float(np.ptp(raw_s - period * places))
        known = min(known + known // 4, len(raw_s))


def _refuse_two_rates(raw_s: FloatArray, tick_s: float) -> None:
    """Raise where the file has stretches of two rates, each held steadily: edited slow motion."""
    steps = np.diff(raw_s)
    size = max(_SHORTEST_PART, int(_SMALLEST_SHARE * len(raw_s)))
    parts: list[tuple[int, float]] = []
    for start in range(0, len(steps) - size + 1, size // 2):
        inside = steps[start : start + size]
        median = float(np.median(inside))
        slack = _STEADY * median + 2 * max(tick_s, min(_SIXHUNDREDTH, 0.25 * median))
        if np.mean(np.abs(inside - median) <= slack) < 0.9:
            continue
        mean = float(inside[np.abs(inside - median) <= slack].mean())
        if not parts or not 1 / _BREAK < mean / parts[-1][1] < _BREAK:
            parts.append((start, mean))
    if not 1 < len(parts) <= _MOST_PARTS:
        return
    (_, before), (start, after) = next(pairwise(parts))
    middle = math.sqrt(before * after)
    crossed = (steps[max(start - size, 0) :] > middle) == (after > middle)
    frame = max(start - size, 0) + int(np.argmax(_holds(crossed, size // 2)))
    raise InputError(
        f"the video changes its rate at frame {frame}, at {raw_s[frame]:.3f} s, from {1 / before:.4g} to "
        f"{1 / after:.4g} fps, as edited slow motion does: its times are not true. "
        "Use the recording as it came from the camera, or cut it there"
    )


def _holds(state: np.ndarray[tuple[int], np.dtype[np.bool_]], count: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return where a state begins that holds for most of the next entries."""
    ahead = np.convolve(state, np.ones(count), mode="full")[count - 1 :]
    return state & (ahead >= 0.8 * np.minimum(count, len(state) - np.arange(len(state))))
