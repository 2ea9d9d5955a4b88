"""Tags in a plane, as a camera with one radial coefficient sees them.

The plane's own axes are right, down and away from the camera; its origin lies on the optical axis at the distance D.
The lens is x_d = x (1 + k1 ρ²), ρ in focal lengths.
"""

from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, IntArray

LENS = 5
"""The unknowns that all tags share come first: ln f, k1 / f², tan(pitch) / f, tan(yaw) / f, ln(D / f).

Those behind ln f say what the picture shows whatever f is: so f, of which it shows little, is nearly independent.
"""

OF_A_TAG = 4
"""Then for each tag: depth behind the plane as a share of D, two angles of its own out of the plane over f, and by what
share its print is longer than wide."""

LEAVING = slice(0, 3)
"""Those of a tag's own unknowns in which a frame may differ from the others, where a tag leaves the plane."""

POSE = 3
"""Of a tag in a frame: place in the plane (2, in units of D / f) and angle."""

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners in the tag's own frame, y up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The shared unknowns, by name; angles in rad, distance in the unit of the tags' sides."""

    focal_px: float
    radial_k1: float
    pitch_rad: float
    yaw_rad: float
    distance: float

    @classmethod
    def of(cls, shared: FloatArray) -> "View":
        """Return the view that the vector of unknowns holds."""
        focal = float(np.exp(shared[0]))
        return cls(
            focal_px=focal,
            radial_k1=float(shared[1]) * focal**2,
            pitch_rad=float(np.arctan(shared[2] * focal)),
            yaw_rad=float(np.arctan(shared[3] * focal)),
            distance=float(np.exp(shared[4])) * focal,
        )

    @property
    def axes(self) -> FloatArray:
        """The plane's axes in the camera's, as columns, shape (3, 3)."""
        cp, sp, cy, sy = np.cos(self.pitch_rad), np.sin(self.pitch_rad), np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.array([[cy, sy * sp, sy * cp], [0.0, cp, -sp], [-sy, cy * sp, cy * cp]])

    def cast(self, ray: FloatArray, depth: float) -> FloatArray:
        """Return where rays X/Z, Y/Z, shape (..., 2), meet a parallel plane so far behind, in the plane's own axes."""
        axes = self.axes
        normal = axes[:, 2]
        reach = (depth + normal[2] * self.distance) / (ray @ normal[:2] + normal[2])
        point = reach[..., None] * (ray @ axes[:2] + axes[2]) - self.distance * axes[2]
        place: FloatArray = point[..., :2]
        return place


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """Corners of n tags as a camera sees them.

    Parameters
    ----------
    corners_px : ndarray, shape (n, 4, 2)
        From the principal point, x right and y down.
    ray, seen : ndarray, shapes (n, 4, 2) and (n, 4, 3)
        X/Z, Y/Z of the undistorted rays, and the corners in the camera's axes.
    flat, in_camera : ndarray, shape (n, 4, 3)
        The corners from the plane's origin, in the plane's axes and in the camera's.
    bent : tuple of ndarray, shape (n, 4, 3) each
        How a corner moves in the plane's axes with the tag's angle in the plane, its two angles out of it, and its
        print's length.
    """

    corners_px: FloatArray
    ray: FloatArray
    seen: FloatArray
    flat: FloatArray
    in_camera: FloatArray
    bent: tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def project_tags(shared: FloatArray, pose: FloatArray, tag: IntArray, side: FloatArray) -> Shown:
    """Return the corners of tags in pixels from the principal point.

    Parameters
    ----------
    shared : ndarray, shape (LENS + OF_A_TAG tags,)
        The unknowns that all frames share.
    pose : ndarray, shape (n, POSE)
        Each sighting's own.
    tag : ndarray of int, shape (n,)
        Which tag it is.
    side : ndarray, shape (tags,)
        Sides of their squares.
    """
    view = View.of(shared)
    own = shared[LENS:].reshape(-1, OF_A_TAG)[tag]
    half, longer = 0.5 * side[tag, None], 0.5 * own[:, 3, None]
    x, y = half * SQUARE[:, 0] * (1 - longer), half * SQUARE[:, 1] * (1 + longer)
    nod, turn = view.focal_px * own[:, 1, None], view.focal_px * own[:, 2, None]
    sn, cn, st, ct = np.sin(nod), np.cos(nod), np.sin(turn), np.cos(turn)
    sine, cosine = np.sin(pose[:, 2, None]), np.cos(pose[:, 2, None])

    def in_plane(right: FloatArray, up: FloatArray, away: FloatArray) -> FloatArray:
        return np.stack([cosine * right - sine * up, -sine * right - cosine * up, away], axis=-1)

    # Out of the plane a tag turns about its own x axis first, then about its y axis.
    right, up, away = x * ct + y * sn * st, y * cn, x * st - y * sn * ct
    place = np.column_stack([pose[:, :2] / view.focal_px, own[:, 0]])
    flat = in_plane(right, up, away) + view.distance * place[:, None]
    in_camera = flat @ view.axes.T
    seen = in_camera + np.array([0.0, 0.0, view.distance])
    ray = seen[..., :2] / seen[..., 2:]
    u, v = -0.5 * half * SQUARE[:, 0], 0.5 * half * SQUARE[:, 1]
    bent = (
        in_plane(-up, right, 0 * away),
        in_plane(y * cn * st, -y * sn, -y * cn * ct),
        in_plane(-away, 0 * up, right),
        in_plane(u * ct + v * sn * st, v * cn, u * st - v * sn * ct),
    )
    return Shown(
        corners_px=view.focal_px * ray * (1 + view.radial_k1 * np.sum(ray**2, axis=-1, keepdims=True)),
        ray=ray,
        seen=seen,
        flat=flat,
        in_camera=in_camera,
        bent=bent,
    )


def differentiate(
    shown: Shown, shared: FloatArray, pose: FloatArray, tag: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how the corners move with the shared unknowns, (m, n, 8), with each sighting's own, (n, 8, POSE), and with
    its tag's leaving the plane, (n, 8, 3)."""
    view = View.of(shared)
    own = shared[LENS:].reshape(-1, OF_A_TAG)[tag]
    ray, axes = shown.ray, view.axes
    square = np.sum(ray**2, axis=-1, keepdims=True)

    def in_picture(move: FloatArray) -> FloatArray:
        """Return pixels for a small move of the corners in the camera's axes."""
        slide = (move[..., :2] - ray * move[..., 2:]) / shown.seen[..., 2:]
        along = 2 * view.radial_k1 * np.sum(ray * slide, axis=-1, keepdims=True)
        moved: FloatArray = view.focal_px * (slide * (1 + view.radial_k1 * square) + ray * along)
        return moved.reshape(-1, 8)

    scale = view.distance / view.focal_px
    units = np.array([scale, scale, view.distance])
    moves = [unit * np.broadcast_to(axes[:, index], shown.flat.shape) for index, unit in enumerate(units)]
    turns = [
        bent @ axes.T * unit for bent, unit in zip(shown.bent, (1.0, view.focal_px, view.focal_px, 1.0), strict=True)
    ]
    pose_slope = np.stack([in_picture(move) for move in (*moves[:2], turns[0])], axis=-1)
    tag_slope = np.stack([in_picture(move) for move in (moves[2], *turns[1:])], axis=-1)
    pitch = shown.flat[..., 1:2] * axes[:, 2] - shown.flat[..., 2:] * axes[:, 1]
    yaw = np.stack([shown.in_camera[..., 2], 0 * shown.in_camera[..., 1], -shown.in_camera[..., 0]], axis=-1)
    place = np.column_stack([pose[:, :2], own[:, 0]]) * units
    farther = in_picture((place @ axes.T)[:, None] + np.array([0.0, 0.0, view.distance]))
    radial = (view.focal_px * ray * square).reshape(-1, 8)
    tangents = np.tan([view.pitch_rad, view.yaw_rad])
    tilts = [in_picture(turn) / (1 + t**2) for turn, t in zip((pitch, yaw), tangents, strict=True)]
    # With f the picture's own unknowns stay as they are, and so k1, the tangents and the distance grow.
    sideways = np.einsum("nka,na->nk", pose_slope[..., :2], pose[:, :2])
    focal = shown.corners_px.reshape(-1, 8) + 2 * view.radial_k1 * radial + farther - sideways
    focal = focal + tangents[0] * tilts[0] + tangents[1] * tilts[1]
    focal = focal + np.einsum("nka,na->nk", tag_slope[..., 1:3], own[:, 1:3])
    slopes = [focal, view.focal_px**2 * radial, view.focal_px * tilts[0], view.focal_px * tilts[1], farther]
    for number in range((len(shared) - LENS) // OF_A_TAG):
        slopes += list(np.moveaxis((tag == number)[:, None, None] * tag_slope, -1, 0))
    return np.stack(slopes), pose_slope, tag_slope[..., LEAVING]
