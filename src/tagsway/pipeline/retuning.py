"""From the files of a second video to a corrected shaper."""

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from tagsway.design import PriorPayload, ResidualRecord, Retuned, retune_shaper
from tagsway.design.motion import find_way
from tagsway.design.residual import PivotVelocity
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.indicators import find_last_move
from tagsway.model import (
    GRAVITY_M_S2,
    CleanTrack,
    Estimate,
    FloatArray,
    Mode,
    Result,
    Shaper,
    Track,
    Trajectory,
    Window,
)
from tagsway.store.documents import read_result, read_shaper
from tagsway.store.moves import read_move
from tagsway.store.tracks import read_track
from tagsway.trajectories import plan_shaped

SEARCHED_S = 0.1
"""Around the tool's first visible motion: where the move began."""

REST_SHARE = 0.3
"""Of the record, at its end: a tool that stands so long has ended its move."""

STATED_LENGTH, UNKNOWN_LENGTH = 0.02, 0.15
"""Standard errors of a length that is stated, and of one that is not known: a spring makes it longer than g/ω²."""


def retune_from_files(
    result: Path,
    shaper: Path,
    *,
    move: Path | None = None,
    length_m: float | None = None,
    spread_percent: float | None = None,
    seed: int = 0,
) -> Retuned:
    """Correct the shaper that was used in a video.

    Parameters
    ----------
    result : Path
        result.json of that video; track.csv lies beside it. Its mode may be not determined.
    shaper : Path
        shaper.json.
    move : Path, optional
        move.toml that was run.
    length_m, spread_percent : float, optional
        As for `retune_shaper`.
    seed : int
        Of the draws.

    Raises
    ------
    InputError
        Where a file is missing or holds no lengths, or the move is another one than the tool made.
    NotIdentifiableError
        Where the tool or the residual was not seen.
    """
    measured, used = read_result(result), read_shaper(shaper)
    track = read_track(result.parent / "track.csv")
    prior = _prior(measured, used, length_m)
    asked = None if move is None else read_move(move)
    trajectory = None if asked is None else plan_shaped(asked, used)
    record = _record(measured, track, trajectory, source=str(result))

    def replan(corrected: Shaper) -> tuple[PivotVelocity, float]:
        assert asked is not None
        planned = plan_shaped(asked, corrected)
        return _commanded(planned, 0.0), planned.duration_s

    return retune_shaper(
        record,
        used,
        prior,
        spread_percent=spread_percent,
        replan=None if asked is None or not asked.shaped_axes else replan,
        rng=np.random.default_rng(seed),
    )


def _prior(measured: Result, used: Shaper, length_m: float | None) -> PriorPayload:
    if not used.modes:
        raise InputError(f"a shaper {used.type!r} without a mode cannot be corrected: design it for one")
    mode = Mode(natural_frequency_hz=used.modes[0].frequency_hz, damping_ratio=used.modes[0].damping_ratio)
    pendulum = measured.pendulum
    free = GRAVITY_M_S2 / mode.angular_frequency_rad_s**2
    length = Estimate.normal(free, UNKNOWN_LENGTH * free)
    if length_m is not None:
        length = Estimate.normal(length_m, STATED_LENGTH * length_m)
    elif pendulum is not None and pendulum.determined and pendulum.length_m is not None:
        length = pendulum.length_m
    radius = length.value
    if pendulum is not None and pendulum.tag_radius_m is not None:
        radius = pendulum.tag_radius_m.value
    return PriorPayload(mode=mode, length_m=length, tag_radius_m=radius)


def _record(measured: Result, track: Track, trajectory: Trajectory | None, *, source: str) -> ResidualRecord:
    if track.length_unit != "m" or track.tcp is None:
        raise InputError(f"{source}: the track holds no tool in mm: film both tags and state --tag-size")
    clean = clean_track(track)
    if clean.tcp is None:
        raise NotIdentifiableError(f"{source}: the tool was not seen long enough: film both tags")
    last = float(track.time_s[-1])
    begin = last - REST_SHARE * (last - float(track.time_s[0]))
    rest = measured.window or Window(start_s=begin, end_s=last)
    moved = find_last_move(clean, rest)
    if moved is None:
        raise NotIdentifiableError(f"{source}: the tool does not move before {rest.start_s:.3g} s: film the whole move")
    sway = track.pcp.position[:, 0] - track.tcp.position[:, 0]
    if trajectory is None:
        return ResidualRecord(
            time_s=track.time_s,
            sway_m=sway,
            start_s=moved.start_s,
            end_s=moved.end_s,
            velocity=seen_velocity(clean, moved),
        )
    start = _find_start(track, trajectory, moved)
    return ResidualRecord(
        time_s=track.time_s,
        sway_m=sway * _sense(track, trajectory),
        start_s=start,
        end_s=start + trajectory.duration_s,
        velocity=_commanded(trajectory, start),
    )


def seen_velocity(clean: CleanTrack, moved: Window) -> PivotVelocity:
    """Return the tool's velocity as it was seen, at rest outside the move."""
    assert clean.tcp is not None
    known = np.isfinite(clean.tcp.velocity).all(axis=1)
    spline = CubicSpline(clean.time_s[known], clean.tcp.velocity[known])

    def velocity(time_s: FloatArray) -> FloatArray:
        inside = (time_s >= moved.start_s) & (time_s <= moved.end_s)
        return np.where(inside[:, None], spline(np.clip(time_s, moved.start_s, moved.end_s)), 0.0)

    return velocity


def _commanded(trajectory: Trajectory, start_s: float) -> PivotVelocity:
    way = find_way(trajectory)

    def velocity(time_s: FloatArray) -> FloatArray:
        vectors = trajectory(time_s - start_s, 1)
        return np.stack([vectors @ way, vectors[:, 2]], axis=1)

    return velocity


def _sense(track: Track, trajectory: Trajectory) -> float:
    """Return 1 where the camera sees the way to the right, else -1."""
    assert track.tcp is not None
    x = track.tcp.position[np.isfinite(track.tcp.position[:, 0]), 0]
    return 1.0 if x[-1] >= x[0] else -1.0


def _find_start(track: Track, trajectory: Trajectory, moved: Window) -> float:
    """Return when the move began: where the tool's track lies best on it."""
    assert track.tcp is not None
    way = find_way(trajectory)
    seen = np.isfinite(track.tcp.position).all(axis=1)
    time, x, z = track.time_s[seen], *track.tcp.position[seen].T
    x = (x - x[0]) * _sense(track, trajectory)
    begin = trajectory(0.0)

    def misfit(start: float) -> float:
        path = trajectory(time - start) - begin
        left = np.stack([x - path @ way, z - path[:, 2]])
        return float(np.sum(np.var(left, axis=1)))

    found = minimize_scalar(
        misfit, bounds=(moved.start_s - SEARCHED_S, moved.start_s + SEARCHED_S), options={"xatol": 1e-6}
    )
    left = float(np.sqrt(misfit(found.x)))
    length = float(np.linalg.norm((trajectory(trajectory.duration_s) - begin)[:2]))
    if not left < 0.05 * length:
        raise InputError(
            f"the tool's track is {1e3 * left:.3g} mm off the move that was given: expected the move and the shaper "
            "that were filmed"
        )
    return float(found.x)
