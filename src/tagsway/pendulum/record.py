"""The part of a track that a pendulum is fitted to: the sway, the tag's angle, and the pivot's velocity."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from tagsway.errors import NotIdentifiableError
from tagsway.filters import SmoothingSpline, find_track_spikes, fit_tag_splines, measure_tag_noise
from tagsway.model import FloatArray, Notice, TagTrack, Track, Window

DRAWS = 300
"""Draws of the pivot's path, whose scatter is the input's share of the samples' covariance.

About 50 directions of it rise above the noise: with 100 draws l still moves by a sixth of its error from seed to seed.
"""

LEAST_SAMPLES = 30
"""Two for each unknown, and a little."""

LONGEST_STEPS = 1200
"""Steps of the simulation: a longer record is cut at its end (25 swings, less for a fast camera)."""

STEP_RAD = 0.13
"""Step of the simulation in radians of the swing's phase: the phase is off by 2 parts in a million."""

LEAST_TRAVEL_M = 0.01
"""A pivot that stays within this stands still: what is left is the robot's own vibration."""

MOVING_SHARE = 0.05
"""Share of the peak speed above which the tool moves; the arms' vibration after a move stays below it."""

LEAD_IN_S, STANDSTILL_S = 0.1, 0.3
"""Rest before the move that is fitted with it; a stop longer than the second separates two moves."""

CODEC_MEMORY_S = 0.1
"""How long a codec keeps to one error of a moving block: H.264's errors wander over 20 to 100 frames at 200 fps."""

LEAST_STD_M, LEAST_STD_RAD = 1e-5, 2e-4
"""No tag is measured better than this; a simulated track without noise would otherwise be judged by its rounding."""

FALLBACK_STD_M, FALLBACK_STD_RAD = 1e-4, 3e-3
"""Standard errors of a track that states none; the residuals then say what the noise is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Samples to be explained, and the pivot's motion that is to explain them.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the samples.
    std_stated : bool
        Whether the track states its noise, or the residuals have to say.
    sway_m, sway_std_m : ndarray, shape (n, 2)
        x and z of PCP minus TCP, NaN where a tag was not seen, and the noise of each.
    angle_rad, angle_std_rad : ndarray, shape (n,)
        The PCP tag's rotation, NaN where there is none, and its noise.
    tool_m : ndarray, shape (n, 2)
        Smoothed path of the TCP, from its mean.
    nodes_s : ndarray, shape (k,)
        Nodes of the simulation, evenly spaced; samples lie between them.
    velocity_m_s : ndarray, shape (2 k - 1, 2)
        Smoothed velocity of the TCP at the nodes and half-way between.
    velocity_draws_m_s : ndarray, shape (2 k - 1, 2, draws)
        The same, as it may also have been.
    moved : bool
        Whether the pivot moved, or this is a decay alone.
    lift_m : float
        Range of the pivot's height.
    notices : tuple of Notice
        What was left out.
    """

    time_s: FloatArray
    std_stated: bool
    sway_m: FloatArray
    sway_std_m: FloatArray
    angle_rad: FloatArray
    angle_std_rad: FloatArray
    tool_m: FloatArray
    nodes_s: FloatArray
    velocity_m_s: FloatArray
    velocity_draws_m_s: FloatArray
    moved: bool
    lift_m: float
    notices: tuple[Notice, ...]

    @property
    def duration_s(self) -> float:
        """Length of the record."""
        return float(self.nodes_s[-1] - self.nodes_s[0])


def choose_record(track: Track, window: Window, *, angular_frequency_rad_s: float, rng: np.random.Generator) -> Record:
    """Return the move that ends before the window, if there is one, and the window.

    Parameters
    ----------
    track : Track
        In metres, with a TCP.
    window : Window
        The free vibration.
    angular_frequency_rad_s : float
        About ω_n: sets the step of the simulation.
    rng : Generator
        For the draws of the pivot's path.

    Returns
    -------
    Record
        From 0.1 s before the last move before the window (from the window's start if the pivot stands) to the window's
        end, cut where it would need more than 1200 steps of 0.13 / ω_n.

    Raises
    ------
    NotIdentifiableError
        Where too few samples show both tags.
    """
    if track.tcp is None:
        raise _undetermined("the tool's tag was never seen: the pivot's motion is not known")
    time = track.time_s
    std = _usable_std(track.tcp.position_std, LEAST_STD_M, FALLBACK_STD_M)
    tool = replace(track.tcp, position_std=std)
    left_out = find_track_spikes(time, tool) | ~np.all(np.isfinite(tool.position), axis=1) | (time > window.end_s)
    seen = time[~left_out]
    if not len(seen) >= LEAST_SAMPLES:
        raise _undetermined(f"the tool's tag was seen in {len(seen)} frames only: expected at least {LEAST_SAMPLES}")
    paths = fit_tag_splines(time, tool, left_out)
    start, moved = _start_of_move(seen, paths, window)
    if moved:
        speed = np.hypot(*(np.nan_to_num(path(time, 1)) for path in paths))
        moving = ~left_out & (time >= start) & (speed > MOVING_SHARE * np.max(speed))
        if np.count_nonzero(moving) >= LEAST_SAMPLES:
            paths = fit_tag_splines(time, tool, left_out, moving=moving)
    step = min(STEP_RAD / angular_frequency_rad_s, max(2 * float(np.median(np.diff(time))), 0.005))
    last = min(window.end_s, float(seen[-1]))
    end = min(last, start + LONGEST_STEPS * step)
    inside = (time >= start) & (time <= end)
    both = inside & np.all(np.isfinite(track.pcp.position) & np.isfinite(track.tcp.position), axis=1)
    if not np.count_nonzero(both) >= LEAST_SAMPLES:
        raise _undetermined(
            f"both tags were seen in {np.count_nonzero(both)} frames of the motion: expected at least {LEAST_SAMPLES}"
        )
    nodes = np.linspace(start, end, max(int(np.ceil((end - start) / step)), 2) + 1)
    halves = np.interp(np.arange(2 * len(nodes) - 1) / 2, np.arange(len(nodes)), nodes)
    halves[-1] = end
    path = np.column_stack([p(time[inside]) for p in paths])
    return Record(
        time_s=time[inside],
        std_stated=bool(np.any(track.pcp.position_std > 0)),
        sway_m=(track.pcp.position - track.tcp.position)[inside],
        sway_std_m=np.hypot(_noise(time, track.pcp), _noise(time, tool))[inside],
        angle_rad=track.pcp.angle_rad[inside],
        angle_std_rad=_usable_std(track.pcp.angle_std_rad, LEAST_STD_RAD, FALLBACK_STD_RAD)[inside],
        tool_m=path - path.mean(axis=0),
        nodes_s=nodes,
        velocity_m_s=np.column_stack([p(halves, 1) for p in paths]),
        velocity_draws_m_s=np.stack([p.draw(rng, DRAWS)(halves, 1) for p in paths], axis=1)
        + _draw_codec_drag(time, tool, halves, rng),
        moved=moved,
        lift_m=float(np.ptp(path[:, 1])) if moved else 0.0,
        notices=_shortened(start, end) if end < last else (),
    )


def _start_of_move(
    seen_s: FloatArray, paths: tuple[SmoothingSpline, SmoothingSpline], window: Window
) -> tuple[float, bool]:
    """Return where the record starts, and whether the pivot moves in it."""
    before = seen_s[seen_s < window.start_s]
    if len(before) > 1 and _travel(paths, before) > LEAST_TRAVEL_M:
        speed = np.hypot(paths[0](before, 1), paths[1](before, 1))
        moving = before[speed > MOVING_SHARE * np.max(speed)]
        stops = np.flatnonzero(np.diff(moving) > STANDSTILL_S)
        first = moving[stops[-1] + 1] if len(stops) else moving[0]
        return float(max(first - LEAD_IN_S, seen_s[0])), True
    start = max(window.start_s, float(seen_s[0]))
    return start, _travel(paths, seen_s[seen_s >= start]) > LEAST_TRAVEL_M


def _travel(paths: tuple[SmoothingSpline, SmoothingSpline], time_s: FloatArray) -> float:
    """Return the larger range of x and z."""
    return float(max(np.ptp(path(time_s)) for path in paths)) if len(time_s) else 0.0


def _shortened(start_s: float, end_s: float) -> tuple[Notice]:
    message = f"the pendulum was fitted to {start_s:.2f}:{end_s:.2f} s only: what follows adds little"
    return (Notice(code="pendulum_record_shortened", message=message),)


def _draw_codec_drag(time_s: FloatArray, tool: TagTrack, halves_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return draws of the velocity by which a codec may have dragged the tool's tag, shape (2 k - 1, 2, draws).

    As large as the noise beyond the stated one, and as slow as a codec changes its mind; nothing for raw video.
    """
    noise, stated = _noise(time_s, tool), np.where(np.isfinite(tool.position_std), tool.position_std, 0.0)
    known = np.any(np.isfinite(tool.position_std) & (tool.position_std > 0))
    excess = np.sqrt(np.maximum(noise**2 - stated**2, 0.0)) if known else np.zeros_like(noise)
    knots = np.arange(halves_s[0], halves_s[-1] + 2 * CODEC_MEMORY_S, CODEC_MEMORY_S)
    wander = make_interp_spline(knots, rng.normal(size=(len(knots), 2, DRAWS)), k=3)(halves_s)
    size = np.column_stack([np.interp(halves_s, time_s, column) for column in excess.T])
    drag: FloatArray = np.gradient(wander * size[:, :, None], halves_s, axis=0)
    return drag


def _noise(time_s: FloatArray, tag: TagTrack) -> FloatArray:
    """Return a tag's noise at each sample: as its own smoothing shows it, or as stated where there is too little."""
    stated = _usable_std(tag.position_std, LEAST_STD_M, FALLBACK_STD_M)
    spikes = find_track_spikes(time_s, tag)
    if np.count_nonzero(np.isfinite(tag.position).all(axis=1) & ~spikes) < LEAST_SAMPLES:
        return stated
    shown = measure_tag_noise(time_s, tag, spikes)
    return np.where(np.isfinite(shown), np.maximum(shown, LEAST_STD_M), stated)


def _usable_std(std: FloatArray, least: float, fallback: float) -> FloatArray:
    """Return standard errors that are not too good to be true, with a fallback where none is stated."""
    return np.where(np.isfinite(std) & (std > 0), np.maximum(std, least), fallback)


def _undetermined(message: str) -> NotIdentifiableError:
    return NotIdentifiableError(message, code="pendulum_not_determined")
