"""Polylines and line-arc paths: a feed rate along every way, and corners passed within an error."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Shaper, Trajectory
from tagsway.trajectories.corners import Corner, plan_corner
from tagsway.trajectories.curves import Arc, Line, change_of_direction, find_segments, find_ways
from tagsway.trajectories.feeds import Feed, plan_feed, refuse_inexact
from tagsway.trajectories.limits import find_peaks
from tagsway.trajectories.pieces import cut, shape_axes, stretch, unite_breaks
from tagsway.trajectories.profiles import refuse_heights
from tagsway.trajectories.tracing import trace_way

MOST_ROUNDS = 20
"""Of lengthening the ramps; a longer ramp is shaped differently, so that it takes a few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPlan:
    """A path in time.

    Parameters
    ----------
    trajectory : Trajectory
        From rest to rest.
    corners : tuple of Corner
        How each is passed, in order.
    starts_s : tuple of float
        When each way between two corners begins.
    feeds : tuple of Feed
        How far the tool is along each way, counted from its start.
    """

    trajectory: Trajectory
    corners: tuple[Corner, ...]
    starts_s: tuple[float, ...]
    feeds: tuple[Feed, ...]

    @property
    def length_m(self) -> float:
        """Of the path, corners included."""
        return math.fsum(feed.length_m for feed in self.feeds)


def plan_path(move: Move, *, shaper: Shaper | None = None) -> PathPlan:
    """Plan a move along lines and arcs, its feed rate shaped.

    Parameters
    ----------
    move : Move
        Profile "path": points, arcs, feed rate and cornering error.
    shaper : Shaper, optional
        Impulses and perhaps a box, laid over the feed rate of every way before its corners are planned: the cornering
        error is that of the shaped motion.

    Returns
    -------
    PathPlan
        The sum of the motions along the ways, each begun while the one before it ends. Lines are exact, arcs within
        1e-10 m.

    Raises
    ------
    InputError
        For a jerk limit on arcs or a quintic over corners; a shaper with a filter or with a time scale.

    Notes
    -----
    Where the tool passes corners, both ways push at once, together up to 2 sin(θ/2) times as much as one: the ramps are
    lengthened until the sharpest keeps a. A shaper that spreads the ramps leaves room for it; without one, and for a
    small error, stopping (corner_error_mm = 0) may be quicker. Where there are arcs, v²/R and the ramps share a: half
    each where corners are passed, else a/√2 each, for they are square to one another. Where an arc begins at speed the
    acceleration steps.
    """
    if shaper is not None:
        refuse_inexact(shaper)
    refuse_heights(move)
    segments = find_segments(move)
    ways = find_ways(segments)
    if move.along_path == "quintic":
        return _plan_quintic(move, ways, shaper)
    if move.max_jerk_m_s3 is not None and any(isinstance(segment, Arc) for segment in segments):
        raise InputError(
            f"a path with arcs cannot keep max_jerk_m_s3 = {move.max_jerk_m_s3:g}: the acceleration steps where an arc "
            "begins; leave it out, or use the profile b-spline"
        )
    feeds = _plan_feeds(move, ways, shaper)
    corners = tuple(
        plan_corner(
            before,
            after,
            angle_rad=change_of_direction(way[-1], following[0]),
            error_m=move.corner_error_mm / 1e3,
        )
        for (way, following), (before, after) in zip(itertools.pairwise(ways), itertools.pairwise(feeds), strict=True)
    )
    steps = [feed.distance.duration_s - corner.cornering_time_s for feed, corner in zip(feeds, corners, strict=False)]
    starts = (0.0, *itertools.accumulate(steps))
    parts = [trace_way(way, feed) for way, feed in zip(ways, feeds, strict=True)]
    return PathPlan(trajectory=_superpose(parts, starts), corners=corners, starts_s=starts, feeds=feeds)


def _plan_feeds(move: Move, ways: list[list[Line | Arc]], shaper: Shaper | None) -> tuple[Feed, ...]:
    """Plan the feed of every way so that two of them that push at once keep the acceleration together."""
    passing = move.corner_error_mm > 0 and len(ways) > 1
    round_share = 0.5 if passing else math.sqrt(0.5)
    whole = round_share if any(isinstance(segment, Arc) for way in ways for segment in way) else 1.0
    share = whole
    for _ in range(MOST_ROUNDS):
        feeds = tuple(_plan_way(move, way, shaper, (share, round_share)) for way in ways)
        if not passing:
            break
        angles = [change_of_direction(way[-1], following[0]) for way, following in itertools.pairwise(ways)]
        together = 2 * math.sin(max(angles) / 2) * max(find_peaks(feed.distance, 2)[0] for feed in feeds)
        smaller = share * min(1.0, whole * move.max_acceleration_m_s2 / together)
        if smaller >= share * (1 - 1e-9):
            break
        share = smaller
    return feeds


def _plan_way(move: Move, way: list[Line | Arc], shaper: Shaper | None, shares: tuple[float, float]) -> Feed:
    ramp_share, round_share = shares
    rates = [rate for rate in (move.feed_rate_m_s, move.max_velocity_m_s) if rate is not None]
    radii = [segment.radius_m for segment in way if isinstance(segment, Arc)]
    if radii:
        rates.append(math.sqrt(move.max_acceleration_m_s2 * round_share * min(radii)))
    return plan_feed(
        math.fsum(segment.length_m for segment in way),
        max_velocity_m_s=min(rates, default=math.inf),
        max_acceleration_m_s2=move.max_acceleration_m_s2 * ramp_share,
        max_jerk_m_s3=math.inf if move.max_jerk_m_s3 is None else move.max_jerk_m_s3 * ramp_share,
        shaper=shaper,
    )


def _plan_quintic(move: Move, ways: list[list[Line | Arc]], shaper: Shaper | None) -> PathPlan:
    """Plan one quintic along a path without corners, as quick as the peaks of the traced motion allow."""
    if len(ways) > 1:
        degrees = math.degrees(change_of_direction(ways[0][-1], ways[1][0]))
        raise InputError(
            f"a quintic along a path needs one without corners: the first turns by {degrees:.4g} degrees; "
            "give an arc that is tangent to both ways, or along_path = 'feed-rate'"
        )
    length = math.fsum(segment.length_m for segment in ways[0])
    coefficients = np.zeros((1, 6, 3))
    coefficients[0, 3:, 0] = np.array([10.0, -15.0, 6.0]) * length
    unit = Trajectory(breaks_s=np.array([0.0, 1.0]), coefficients=coefficients)
    traced = trace_way(ways[0], Feed(distance=unit, ramp_s=0.5))
    rates = [rate for rate in (move.feed_rate_m_s, move.max_velocity_m_s) if rate is not None]
    limits = [(1, rate) for rate in rates] + [(2, move.max_acceleration_m_s2)]
    if move.max_jerk_m_s3 is not None:
        if any(isinstance(segment, Arc) for segment in ways[0]):
            raise InputError(
                f"a path with arcs cannot keep max_jerk_m_s3 = {move.max_jerk_m_s3:g}: the acceleration steps where an "
                "arc begins; leave it out"
            )
        limits.append((3, move.max_jerk_m_s3))
    duration = max((find_peaks(traced, order)[3] / limit) ** (1 / order) for order, limit in limits)
    distance = stretch(unit, duration)
    feed = Feed(
        distance=distance if shaper is None else shape_axes(distance, shaper),
        ramp_s=duration / 2 + (0.0 if shaper is None else shaper.duration_s),
    )
    return PathPlan(trajectory=trace_way(ways[0], feed), corners=(), starts_s=(0.0,), feeds=(feed,))


def _superpose(parts: list[Trajectory], starts_s: tuple[float, ...]) -> Trajectory:
    """Return the sum of motions that each begin where the one before it ends."""
    breaks = unite_breaks(*(part.breaks_s + start for part, start in zip(parts, starts_s, strict=True)))
    order = max(part.coefficients.shape[1] for part in parts)
    total: FloatArray = np.zeros((len(breaks) - 1, order, 3))
    total[:, 0] = parts[0](0.0)
    for part, start in zip(parts, starts_s, strict=True):
        share = cut(part, breaks, delay_s=start)
        share[:, 0] -= part(0.0)
        total[:, : share.shape[1]] += share
    return Trajectory(breaks_s=breaks, coefficients=total)
