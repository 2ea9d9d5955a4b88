"""The part of a track that a pendulum is fitted to: the sway, the tag's angle, and the pivot's velocity."""

from dataclasses import dataclass

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.filters import fit_smoothing_spline
from tagsway.filters.spikes import find_spikes
from tagsway.model import FloatArray, Notice, Track, Window

DRAWS = 100
"""Draws of the pivot's path: their scatter is the share of the input in the covariance of the samples."""

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
    std = _or_else(track.tcp.position_std, FALLBACK_STD_M)
    spikes = [find_spikes(time, track.tcp.position[:, axis], std=std[:, axis]) for axis in (0, 1)]
    tool = np.where(np.any(spikes, axis=0)[:, None], np.nan, track.tcp.position)
    seen = np.flatnonzero(np.all(np.isfinite(tool), axis=1) & (time <= window.end_s))
    if not len(seen) >= 30:
        raise _undetermined(f"the tool's tag was seen in {len(seen)} frames only: its path needs at least 30")
    paths = [fit_smoothing_spline(time[seen], tool[seen, axis], std[seen, axis]) for axis in (0, 1)]
    velocity = np.column_stack([path(time, 1) for path in paths])
    start, moved = _start_of_move(time, tool, velocity, window)
    start, end = max(start, time[seen[0]]), min(window.end_s, time[seen[-1]])
    spacing = float(np.median(np.diff(time)))
    step = min(STEP_RAD / angular_frequency_rad_s, max(2 * spacing, 0.005))
    notices: list[Notice] = []
    if end - start > LONGEST_STEPS * step:
        end = start + LONGEST_STEPS * step
        notices.append(
            Notice(
                code="pendulum_record_shortened",
                message=f"the pendulum was fitted to {start:.2f}:{end:.2f} s only: what follows adds little",
            )
        )
    inside = (time >= start) & (time <= end)
    both = inside & np.all(np.isfinite(track.pcp.position) & np.isfinite(track.tcp.position), axis=1)
    if not np.count_nonzero(both) >= 30:
        raise _undetermined(f"both tags were seen in {np.count_nonzero(both)} frames only: at least 30 are needed")
    nodes = np.linspace(start, end, max(int(np.ceil((end - start) / step)), 2) + 1)
    halves = np.interp(np.arange(2 * len(nodes) - 1) / 2, np.arange(len(nodes)), nodes)
    halves[-1] = end
    path = np.column_stack([p(time[inside]) for p in paths])
    return Record(
        time_s=time[inside],
        std_stated=bool(np.any(track.pcp.position_std > 0)),
        sway_m=(track.pcp.position - track.tcp.position)[inside],
        sway_std_m=np.hypot(_or_else(track.pcp.position_std, FALLBACK_STD_M), std)[inside],
        angle_rad=track.pcp.angle_rad[inside],
        angle_std_rad=_or_else(track.pcp.angle_std_rad, FALLBACK_STD_RAD)[inside],
        tool_m=path - path.mean(axis=0),
        nodes_s=nodes,
        velocity_m_s=np.column_stack([p(halves, 1) for p in paths]),
        velocity_draws_m_s=np.stack([p.draw(rng, DRAWS)(halves, 1) for p in paths], axis=1),
        moved=moved,
        lift_m=float(np.ptp(path[:, 1])) if moved else 0.0,
        notices=tuple(notices),
    )


def _start_of_move(time: FloatArray, tool: FloatArray, velocity: FloatArray, window: Window) -> tuple[float, bool]:
    """Return where the record starts, and whether the pivot moves in it."""
    before = (time < window.start_s) & np.all(np.isfinite(velocity), axis=1)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    if np.count_nonzero(before) > 1 and _travel(tool[time <= window.start_s]) > LEAST_TRAVEL_M:
        moving = time[before & (speed > MOVING_SHARE * np.max(speed[before]))]
        stops = np.flatnonzero(np.diff(moving) > STANDSTILL_S)
        first = moving[stops[-1] + 1] if len(stops) else moving[0]
        return float(max(first - LEAD_IN_S, time[0])), True
    return window.start_s, _travel(tool[(time >= window.start_s) & (time <= window.end_s)]) > LEAST_TRAVEL_M


def _travel(tool: FloatArray) -> float:
    """Return the larger range of x and z."""
    present = tool[np.all(np.isfinite(tool), axis=1)]
    return float(np.max(np.ptp(present, axis=0))) if len(present) else 0.0


def _or_else(std: FloatArray, fallback: float) -> FloatArray:
    """Return standard errors with a fallback where none is stated."""
    return np.where(np.isfinite(std) & (std > 0), std, fallback)


def _undetermined(message: str) -> NotIdentifiableError:
    return NotIdentifiableError(message, code="pendulum_not_determined")
