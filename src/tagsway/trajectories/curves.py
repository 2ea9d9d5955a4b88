"""Lines and circular arcs by their length."""

import itertools
import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Move

SMOOTH_RAD = 1e-6
"""Two ways whose directions differ by less go on as one: a corner so flat is rounding."""

FLATTEST_ARC = 1e-6
"""Of the chord: three points with less height between them lie on a line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A straight way.

    Parameters
    ----------
    start_m : ndarray, shape (3,)
        Where it begins.
    direction : ndarray, shape (3,)
        Unit vector.
    length_m : float
        How far it goes.
    """

    start_m: FloatArray
    direction: FloatArray
    length_m: float

    def tangent(self, distance_m: float) -> FloatArray:
        """Return the direction after a distance, shape (3,)."""
        return self.direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """A way on a circle: centre + radius (cos φ · outward + sin φ · forward), φ = distance / radius.

    Parameters
    ----------
    centre_m : ndarray, shape (3,)
        Of the circle.
    outward, forward : ndarray, shape (3,)
        Unit vectors from the centre to the start, and along the way there.
    radius_m, length_m : float
        Of the circle and of the way.
    """

    centre_m: FloatArray
    outward: FloatArray
    forward: FloatArray
    radius_m: float
    length_m: float

    def tangent(self, distance_m: float) -> FloatArray:
        """Return the direction after a distance, shape (3,)."""
        angle = distance_m / self.radius_m
        direction: FloatArray = math.cos(angle) * self.forward - math.sin(angle) * self.outward
        return direction

    def derivatives(self, distance_m: FloatArray) -> FloatArray:
        """Return position and its three derivatives by the distance, shape (4, n, 3)."""
        angle = np.asarray(distance_m)[:, None] / self.radius_m
        out = np.cos(angle) * self.outward + np.sin(angle) * self.forward
        along = np.cos(angle) * self.forward - np.sin(angle) * self.outward
        position = self.centre_m + self.radius_m * out
        return np.stack([position, along, -out / self.radius_m, -along / self.radius_m**2])


class Curve(Protocol):
    """A way by its length: a `Line`, an `Arc`, or another that is smooth."""

    @property
    def length_m(self) -> float:
        """How long it is."""

    def tangent(self, distance_m: float) -> FloatArray:
        """Return the direction after a distance, shape (3,)."""


class BentCurve(Curve, Protocol):
    """A way that is no line."""

    def derivatives(self, distance_m: FloatArray) -> FloatArray:
        """Return position and its three derivatives by the distance, shape (4, n, 3)."""


def find_segments(move: Move) -> list[Line | Arc]:
    """Return the lines and arcs of a path move, from point to point."""
    points = [np.array(point, dtype=float) for point in (move.from_m, *move.waypoints_m, move.to_m)]
    through = {arc.segment: np.array(arc.through_m, dtype=float) for arc in move.arcs}
    return [
        _arc(start, through[index], end) if index in through else _line(start, end)
        for index, (start, end) in enumerate(itertools.pairwise(points))
    ]


def find_ways(segments: list[Line | Arc]) -> list[list[Line | Arc]]:
    """Return the segments in groups that run into one another without a corner."""
    ways = [[segments[0]]]
    for before, after in itertools.pairwise(segments):
        if change_of_direction(before, after) > SMOOTH_RAD:
            ways.append([])
        ways[-1].append(after)
    return ways


def change_of_direction(before: Curve, after: Curve) -> float:
    """Return the angle between the tangents where one segment meets the next, 0 to π."""
    end, start = before.tangent(before.length_m), after.tangent(0.0)
    # Both halves of the angle: an arc cosine loses it near 0 and near pi.
    return 2 * math.atan2(float(np.linalg.norm(start - end)), float(np.linalg.norm(start + end)))


def _line(start: FloatArray, end: FloatArray) -> Line:
    length = float(np.linalg.norm(end - start))
    return Line(start_m=start, direction=(end - start) / length, length_m=length)


def _arc(start: FloatArray, through: FloatArray, end: FloatArray) -> Arc:
    """Return the arc through three points."""
    chord, reach = end - start, through - start
    normal = np.cross(reach, chord)
    square = float(normal @ normal)
    if not math.sqrt(square) > FLATTEST_ARC * float(chord @ chord):
        raise InputError(
            f"the points {start.tolist()}, {through.tolist()} and {end.tolist()} of an arc lie on a line: "
            "give a point beside the chord, or leave the arc out"
        )
    to_centre = np.cross(float(reach @ reach) * chord - float(chord @ chord) * reach, normal) / (2 * square)
    radius = float(np.linalg.norm(to_centre))
    outward = -to_centre / radius
    forward = np.cross(normal / math.sqrt(square), outward)
    last = chord - to_centre
    angle = math.atan2(float(last @ forward), float(last @ outward)) % (2 * math.pi)
    return Arc(centre_m=start + to_centre, outward=outward, forward=forward, radius_m=radius, length_m=radius * angle)
