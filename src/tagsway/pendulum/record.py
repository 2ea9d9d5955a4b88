"""The part of a track that a pendulum is fitted to: the sway, the tag's angle, and the pivot's velocity."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.interpolate import make_interp_spline

from tagsway.errors import NotIdentifiableError
from tagsway.filters import (
    SmoothingSpline,
    find_image_noise,
    find_moves,
    find_track_spikes,
    fit_smoothing_spline,
    fit_tag_splines,
    measure_tag_noise,
)
from tagsway.model import BoolArray, FloatArray, IntArray, Notice, TagTrack, Track, Window
from tagsway.pendulum.arc import LEAST_STD_M, LEAST_STD_RAD
from tagsway.pendulum.shortfall import find_shortfall

DRAWS = 300
"""Draws of the pivot's path, whose scatter is the input's share of the samples' covariance.

About 50 directions of it rise above the noise: with 100 draws l still moves by a sixth of its error from seed to seed.
"""

LEAST_SAMPLES = 30
"""Two for each unknown, and a little."""

LONGEST_STEPS = 720
"""Steps of the simulation: a longer record is cut at its end (15 swings, less for a fast camera)."""

STEP_RAD = 0.13
"""Step of the simulation in radians of the swing's phase: the phase is off by 2 parts in a million."""

LEAST_TRAVEL_M = 0.01
"""A pivot that stays within this stands still: what is left is the robot's own vibration."""

MOVING_SHARE = 0.05
"""Share of the peak speed above which the tool moves; the arms' vibration after a move stays below it."""

LEAST_TURN_RAD, TURN_OVER_NOISE = 0.01, 10.0
"""A tool that turns by less than 0.6°, or than so many errors of its angle, keeps upright."""

MARGIN_S = 0.3
"""Samples on both sides of the record that steady its splines at the ends."""

LEAD_IN_S = 0.1
"""Rest before the move that is fitted with it."""

CODEC_MEMORY_S = 0.1
"""How long a codec keeps to one error of a moving block: H.264's errors wander over 20 to 100 frames at 200 fps."""

FALLBACK_STD_M, FALLBACK_STD_RAD = 1e-4, 3e-3
"""Standard errors of a track that states none; the residuals then say what the noise is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Samples to be explained, and the pivot's motion that is to explain them.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the samples.
    angular_frequency_rad_s : float
        About ω_n, as the record was chosen for it.
    std_stated : bool
        Whether the track states its noise, or the residuals have to say.
    sway_m, sway_std_m : ndarray, shape (n, 2)
        x and z of PCP minus TCP, NaN where a tag was not seen, and the noise of each.
    angle_rad, angle_std_rad : ndarray, shape (n,)
        The PCP tag's rotation, NaN where there is none, and its noise.
    angle_short_rad : ndarray, shape (n,)
        What a coder may have taken from all of it together, to one standard error.
    tool_m : ndarray, shape (n, 2)
        Smoothed path of the TCP, from its mean.
    tool_turn_rad : ndarray, shape (n,)
        Smoothed rotation of the TCP from its median; zero where it does not show one.
    turn_rate_rad_s, turn_at_rad : ndarray, shape (2 k - 1,)
        The same, its rate and itself, at the nodes and half-way between.
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
    angular_frequency_rad_s: float
    std_stated: bool
    sway_m: FloatArray
    sway_std_m: FloatArray
    angle_rad: FloatArray
    angle_std_rad: FloatArray
    angle_short_rad: FloatArray
    tool_m: FloatArray
    tool_turn_rad: FloatArray
    turn_at_rad: FloatArray
    turn_rate_rad_s: FloatArray
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
        end, cut where it would need more than 720 steps of 0.13 / ω_n.

    Raises
    ------
    NotIdentifiableError
        Where too few samples show both tags.
    """
    if track.tcp is None:
        raise _undetermined("the tool's tag was never seen: the pivot's motion is not known")
    step = min(STEP_RAD / angular_frequency_rad_s, max(2 * float(np.median(np.diff(track.time_s))), 0.005))
    near = _Vicinity.of(track, track.tcp, window, LONGEST_STEPS * step)
    start, moving_m_s = near.start_of_move(window)
    moved = moving_m_s is not None
    last = min(window.end_s, near.last_seen_s)
    end = min(last, start + LONGEST_STEPS * step)
    near = near.part((near.time_s >= start - MARGIN_S) & (near.time_s <= end + MARGIN_S))
    time = near.time_s
    inside = (time >= start) & (time <= end)
    both = inside & np.all(np.isfinite(near.pcp.position) & np.isfinite(near.tool.position), axis=1)
    if not np.count_nonzero(both) >= LEAST_SAMPLES:
        raise _undetermined(
            f"both tags were seen in {np.count_nonzero(both)} frames of the motion: expected at least {LEAST_SAMPLES}"
        )
    paths = near.paths(start, moving_m_s)
    nodes = np.linspace(start, end, max(int(np.ceil((end - start) / step)), 2) + 1)
    halves = np.interp(np.arange(2 * len(nodes) - 1) / 2, np.arange(len(nodes)), nodes)
    halves[-1] = end
    path = np.column_stack([p(time[inside]) for p in paths])
    turn = fit_turn(time, near.tool)
    noise = _noise(time, near.tool, near.spikes)
    return Record(
        time_s=time[inside],
        std_stated=bool(np.any(track.pcp.position_std > 0)),
        sway_m=(near.pcp.position - near.tool.position)[inside],
        sway_std_m=np.hypot(_noise(time, near.pcp, find_track_spikes(time, near.pcp)), noise)[inside],
        angular_frequency_rad_s=angular_frequency_rad_s,
        angle_rad=near.pcp.angle_rad[inside],
        angle_std_rad=_usable_std(near.pcp.angle_std_rad, LEAST_STD_RAD, FALLBACK_STD_RAD)[inside],
        angle_short_rad=find_shortfall(part_of(near.pcp, inside)),
        tool_m=path - path.mean(axis=0),
        tool_turn_rad=turn(time[inside]),
        turn_at_rad=turn(halves),
        turn_rate_rad_s=turn(halves, 1),
        nodes_s=nodes,
        velocity_m_s=np.column_stack([p(halves, 1) for p in paths]),
        velocity_draws_m_s=np.stack([p.draw(rng, DRAWS)(halves, 1) for p in paths], axis=1)
        # A codec holds back what moves: a tool that stands it leaves where it is.
        + (_draw_codec_drag(time, near.tool, noise, halves, rng) if moved else 0.0),
        moved=moved,
        lift_m=float(np.ptp(path[:, 1])) if moved else 0.0,
        notices=_shortened(start, end) if end < last else (),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Vicinity:
    """What lies within the longest record of the window's start: a film of an hour costs no more than one of a minute.

    `spikes` are the tool's; `last_seen_s` is when the tool was last seen in the whole track.
    """

    time_s: FloatArray
    tool: TagTrack
    pcp: TagTrack
    spikes: BoolArray
    last_seen_s: float

    @classmethod
    def of(cls, track: Track, tool: TagTrack, window: Window, longest_s: float) -> Self:
        """Return the track's part that a record can come from."""
        seen = np.all(np.isfinite(tool.position), axis=1) & (track.time_s <= window.end_s)
        inside = (track.time_s >= window.start_s - longest_s) & (track.time_s <= window.start_s + longest_s + MARGIN_S)
        inside &= track.time_s <= window.end_s
        if not np.count_nonzero(seen & inside) >= LEAST_SAMPLES:
            raise _undetermined(
                f"the tool's tag was seen in {np.count_nonzero(seen & inside)} frames only: "
                f"expected at least {LEAST_SAMPLES}"
            )
        time, near = track.time_s[inside], part_of(tool, inside)
        near = replace(near, position_std=_usable_std(near.position_std, LEAST_STD_M, FALLBACK_STD_M))
        return cls(
            time_s=time,
            tool=near,
            pcp=part_of(track.pcp, inside),
            spikes=find_track_spikes(time, near),
            last_seen_s=float(track.time_s[seen][-1]),
        )

    @property
    def left_out(self) -> BoolArray:
        """Where the tool was not seen, or falsely."""
        return np.asarray(self.spikes | ~np.all(np.isfinite(self.tool.position), axis=1))

    def part(self, chosen: BoolArray) -> Self:
        """Return the chosen samples."""
        return replace(
            self,
            time_s=self.time_s[chosen],
            tool=part_of(self.tool, chosen),
            pcp=part_of(self.pcp, chosen),
            spikes=self.spikes[chosen],
        )

    def start_of_move(self, window: Window) -> tuple[float, float | None]:
        """Return where the record starts, and the speed above which the pivot moves; None where it stands."""
        seen = self.time_s[~self.left_out]
        if not len(seen) >= LEAST_SAMPLES:
            raise _undetermined(
                f"the tool's tag was seen in {len(seen)} frames only: expected at least {LEAST_SAMPLES}"
            )
        paths = fit_tag_splines(self.time_s, self.tool, self.left_out)
        velocity = np.column_stack([path(seen, 1) for path in paths])
        place = np.column_stack([path(seen) for path in paths])
        moves = [
            move for move in find_moves(seen, place, velocity, least=LEAST_TRAVEL_M) if move.start_s < window.start_s
        ]
        if moves:
            least = MOVING_SHARE * float(np.max(np.hypot(*velocity[seen < window.start_s].T)))
            return float(max(moves[-1].start_s - LEAD_IN_S, seen[0])), least
        start = max(window.start_s, float(seen[0]))
        after = seen[seen >= start]
        if not _travel(paths, after) > LEAST_TRAVEL_M:
            return start, None
        return start, MOVING_SHARE * float(np.max(np.hypot(paths[0](after, 1), paths[1](after, 1))))

    def paths(self, start_s: float, moving_m_s: float | None) -> tuple[SmoothingSpline, SmoothingSpline]:
        """Return the tool's smoothed path, as rough as it is where the tool moves."""
        paths = fit_tag_splines(self.time_s, self.tool, self.left_out)
        if moving_m_s is None:
            return paths
        speed = np.hypot(*(np.nan_to_num(path(self.time_s, 1)) for path in paths))
        moving = ~self.left_out & (self.time_s >= start_s) & (speed > moving_m_s)
        if not np.count_nonzero(moving) >= LEAST_SAMPLES:
            return paths
        return fit_tag_splines(self.time_s, self.tool, self.left_out, moving=moving)


def fit_turn(time_s: FloatArray, tool: TagTrack) -> Callable[..., FloatArray]:
    """Return the tool's smoothed rotation from its median as a function of times and of a derivative's order.

    Zero where its tag shows none beyond its noise: a tool that keeps upright must not turn the pivot's offset by noise.
    """
    angle = np.where(np.isfinite(tool.angle_std_rad), tool.angle_rad, np.nan)
    if np.count_nonzero(np.isfinite(angle)) >= LEAST_SAMPLES:
        spline = fit_smoothing_spline(time_s, angle, tool.angle_std_rad)
        path, seen = spline(time_s), np.isfinite(angle)
        wander = float(np.ptp(np.nanpercentile(path, [2, 98])))
        if wander > max(LEAST_TURN_RAD, TURN_OVER_NOISE * float(np.nanmedian(spline.std(time_s[seen])))):
            level, first, last = float(np.nanmedian(path)), spline.time_s[0], spline.time_s[-1]
            return lambda t, order=0: spline(np.clip(t, first, last), order) - (0.0 if order else level)
    return lambda t, order=0: np.zeros(np.shape(t))


def part_of(tag: TagTrack, chosen: BoolArray | IntArray) -> TagTrack:
    """Return some of a tag's samples."""
    return replace(
        tag,
        position=tag.position[chosen],
        position_std=tag.position_std[chosen],
        angle_rad=tag.angle_rad[chosen],
        angle_std_rad=tag.angle_std_rad[chosen],
    )


def _travel(paths: tuple[SmoothingSpline, SmoothingSpline], time_s: FloatArray) -> float:
    """Return the larger range of x and z."""
    return float(max(np.ptp(path(time_s)) for path in paths)) if len(time_s) else 0.0


def _shortened(start_s: float, end_s: float) -> tuple[Notice]:
    message = f"the pendulum was fitted to {start_s:.2f}:{end_s:.2f} s only: what follows adds little"
    return (Notice(code="pendulum_record_shortened", message=message),)


def _draw_codec_drag(
    time_s: FloatArray, tool: TagTrack, noise_m: FloatArray, halves_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return draws of the velocity by which a codec may have dragged the tool's tag, shape (2 k - 1, 2, draws).

    As large as the noise beyond the images' own, and as slow as a codec changes its mind; nothing for raw video.
    """
    images = np.array([find_image_noise(axis, share=tool.image_share) for axis in tool.position_std.T])
    excess = np.sqrt(np.maximum(noise_m**2 - images**2, 0.0)) if np.any(images > 0) else np.zeros_like(noise_m)
    knots = np.arange(halves_s[0], halves_s[-1] + 2 * CODEC_MEMORY_S, CODEC_MEMORY_S)
    wander = make_interp_spline(knots, rng.normal(size=(len(knots), 2, DRAWS)), k=3)(halves_s)
    size = np.column_stack([np.interp(halves_s, time_s, column) for column in excess.T])
    drag: FloatArray = np.gradient(wander * size[:, :, None], halves_s, axis=0)
    return drag


def _noise(time_s: FloatArray, tag: TagTrack, spikes: BoolArray) -> FloatArray:
    """Return a tag's noise at each sample: as its own smoothing shows it, or as stated where there is too little."""
    stated = _usable_std(tag.position_std, LEAST_STD_M, FALLBACK_STD_M)
    if np.count_nonzero(np.isfinite(tag.position).all(axis=1) & ~spikes) < LEAST_SAMPLES:
        return stated
    shown = measure_tag_noise(time_s, tag, spikes)
    return np.where(np.isfinite(shown), np.maximum(shown, LEAST_STD_M), stated)


def _usable_std(std: FloatArray, least: float, fallback: float) -> FloatArray:
    """Return standard errors that are not too good to be true, with a fallback where none is stated."""
    return np.where(np.isfinite(std) & (std > 0), np.maximum(std, least), fallback)


def _undetermined(message: str) -> NotIdentifiableError:
    return NotIdentifiableError(message, code="pendulum_not_determined")
