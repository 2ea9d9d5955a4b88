"""The pictures of a scene, one grey image at a time.

Only what moves is drawn anew in each frame. A thing is flat, so a picture of it is its texture seen through the inverse
of the camera: for each sample of the sensor the ray, for each ray the place on the thing. The texture carries the lens'
blur already, which leaves nothing in it that the samples could alias; the exposure is the mean over moments so close
that the thing moves by less than that blur from one to the next.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray, IntArray
from tagsway.scene.camera import View, place_camera
from tagsway.scene.model import Scene, Tag, TagName
from tagsway.scene.motion import Motion, simulate_scene
from tagsway.scene.sprites import ImageArray, Sprite, draw_wall, make_sprite

Sprites = dict[tuple[TagName, float], Sprite]
SHARE_OF_BLUR = 0.7
"""How far a thing may move between two moments of one exposure, in units of the lens' blur."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """All that is known of a film before a picture is drawn.

    Parameters
    ----------
    scene : Scene
        What is filmed.
    view : View
        The camera.
    frame : ndarray of int, shape (n,)
        Numbers of the captured frames that reach the file.
    time_s : ndarray, shape (n,)
        The middle of each one's exposure.
    poses : Motion
        At beginning, middle and end of each exposure, 3 n rows.
    shake_px : ndarray, shape (n, 2)
        How far the picture is shifted.
    noise_seed : int
        Of wall and sensor noise: the same film gives the same pictures again.
    """

    scene: Scene
    view: View
    frame: IntArray
    time_s: FloatArray
    poses: Motion
    shake_px: FloatArray
    noise_seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where a flat thing is: its tag's centre, its right and its up, each of shape (3,)."""

    centre: FloatArray
    right: FloatArray
    up: FloatArray


def plan_film(scene: Scene, *, rng: np.random.Generator | None = None) -> Film:
    """Simulate a scene and settle what its camera will see, without drawing it.

    Parameters
    ----------
    scene : Scene
        What is filmed.
    rng : Generator, optional
        Of all that is random; by default one begun with the scene's seed.
    """
    rng = np.random.default_rng(scene.seed) if rng is None else rng
    video, half = scene.video, scene.picture.exposure_s / 2
    count = max(1, round(scene.duration_s * video.fps_hz))
    limit = 0.4 / video.fps_hz
    jitter = np.clip(video.time_jitter_s * rng.standard_normal(count), -limit, limit)
    kept = rng.random(count) >= video.lost_share
    for first, last in video.lost:
        kept[max(first, 0) : last + 1] = False
    kept[0] = True  # the file's clock begins with it
    frame = np.flatnonzero(kept)
    time = (np.arange(count) / video.fps_hz + jitter - jitter[0])[frame]
    shake = scene.camera.shake_px * _shake(time, scene.camera.shake_hz, rng)
    poses = simulate_scene(scene, (time[:, None] + np.array([-half, 0.0, half])).ravel())
    target = scene.camera.target_m
    if target is None:
        seen = np.concatenate([poses.tcp_m, poses.pcp_m])[:, [0, 2]]
        middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
        target = (float(middle[0]), float(middle[1]))
    return Film(
        scene=scene,
        view=place_camera(scene.camera, target),
        frame=frame,
        time_s=time,
        poses=poses,
        shake_px=shake,
        noise_seed=int(rng.integers(2**62)),
    )


def render_frames(scene: Scene, *, rng: np.random.Generator | None = None) -> Iterator[GreyArray]:
    """Yield the pictures of a scene, as the sensor gives them and before any codec; see `expose_film`."""
    return expose_film(plan_film(scene, rng=rng))


def expose_film(film: Film) -> Iterator[GreyArray]:
    """Yield the pictures of a film.

    Parameters
    ----------
    film : Film
        From `plan_film`.

    Yields
    ------
    ndarray of uint8, shape (height, width)
        One for each frame that reaches the file.
    """
    camera, picture = film.scene.camera, film.scene.picture
    rng = np.random.default_rng(film.noise_seed)
    wall = draw_wall(picture, camera.width, camera.height, rng)
    sprites: Sprites = {}
    for index in range(len(film.time_s)):
        image = draw_frame(film, index, wall, sprites)
        if picture.noise_grey > 0:
            image += np.float32(picture.noise_grey) * rng.standard_normal(image.shape, dtype=np.float32)
        yield np.clip(np.rint(image), 0, 255).astype(np.uint8)


def draw_frame(film: Film, index: int, wall: ImageArray, sprites: Sprites) -> ImageArray:
    """Draw one picture of a film, before noise and before it is rounded to grey levels.

    Parameters
    ----------
    film : Film
        From `plan_film`.
    index : int
        Which of its frames.
    wall : ndarray of float32, shape (height, width)
        What is behind everything.
    sprites : dict
        The things that were drawn for earlier frames; it gains those that this one needs.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Grey levels.
    """
    scene, time, shake = film.scene, film.time_s[index], film.shake_px[index]
    image = _shift(wall, shake) if scene.camera.shake_px > 0 else wall.copy()
    for name, tag in carriers(scene):
        covers = [o.share for o in scene.occlusions if o.tag == name and o.start_s <= time < o.end_s]
        key = (name, max(covers, default=0.0))
        if key not in sprites:
            scale = film.view.scale_m_per_px(pose_of(film, name, tag, index, 0.0).centre)
            sprites[key] = make_sprite(scene, name, tag, scale, covered=key[1])
        paint_sprite(
            image, sprites[key], _moments(film, name, tag, index), film.view, shake, scene.picture.supersampling
        )
    return image


def carriers(scene: Scene) -> list[tuple[TagName, Tag]]:
    """Return the scene's tags by name, from back to front."""
    tags = scene.tags
    named: tuple[tuple[TagName, Tag | None], ...] = (
        ("reference", tags.reference),
        ("pcp", tags.pcp),
        ("tcp", tags.tcp),
    )
    return [(name, tag) for name, tag in named if tag is not None]


def pose_of(film: Film, name: TagName, tag: Tag, index: int, moment: float) -> Pose:
    """Return where a tag is in one frame, at a moment of its exposure from -0.5 (begin) to 0.5 (end)."""
    right, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    behind = np.array([0.0, tag.depth_m, 0.0])
    if name == "reference":
        reference = film.scene.tags.reference
        x, z = (0.0, 0.0) if reference is None else reference.position_m
        return Pose(centre=np.array([x, 0.0, z]) + behind, right=right, up=up)
    u = 2 * moment
    weights = np.array([u * (u - 1) / 2, 1 - u * u, u * (u + 1) / 2])
    rows = slice(3 * index, 3 * index + 3)
    if name == "tcp":
        return Pose(centre=weights @ film.poses.tcp_m[rows] + behind, right=right, up=up)
    q, s = float(weights @ film.poses.angle_rad[rows]), float(weights @ film.poses.sideways_rad[rows])
    return Pose(
        centre=weights @ film.poses.pcp_m[rows] + behind,
        right=np.array([math.cos(q), 0.0, math.sin(q)]),
        up=np.array([-math.sin(q) * math.cos(s), -math.sin(s), math.cos(q) * math.cos(s)]),
    )


def paint_sprite(
    image: ImageArray,
    sprite: Sprite,
    poses: list[Pose],
    view: View,
    shift_px: FloatArray,
    samples: int,
) -> None:
    """Paint a thing into a picture, as the mean over its poses.

    Parameters
    ----------
    image : ndarray of float32, shape (height, width)
        Changed in place.
    sprite : Sprite
        The thing.
    poses : list of Pose
        Where it is, at moments that share the exposure evenly.
    view : View
        The camera.
    shift_px : ndarray, shape (2,)
        Shake of the picture.
    samples : int
        Samples a pixel and axis.
    """
    flat = sprite.corners_m
    outline = np.concatenate(
        [view.project(p.centre + flat[:, :1] * p.right + flat[:, 1:] * p.up) + shift_px for p in (poses[0], poses[-1])]
    )
    size = np.array(image.shape[::-1])
    low = np.clip(np.floor(outline.min(axis=0)) - 1, 0, size).astype(int)
    high = np.clip(np.ceil(outline.max(axis=0)) + 2, 0, size).astype(int)
    width, height = (int(v) for v in high - low)
    if width <= 0 or height <= 0:
        return
    grid = np.stack(np.meshgrid(np.arange(low[0] - 1, high[0] + 1), np.arange(low[1] - 1, high[1] + 1)), axis=-1)
    rays = np.concatenate([view.cast(grid - shift_px), np.ones((*grid.shape[:2], 1))], axis=-1)
    fine = (samples * (width + 2), samples * (height + 2))
    gathered = np.zeros((samples * height, samples * width, 2), dtype=np.float32)
    for pose in poses:
        onto_ray = view.axes @ np.stack([pose.right, pose.up, pose.centre - view.centre_m], axis=1)
        place = rays @ np.linalg.inv(onto_ray).T
        x, z = place[..., 0] / place[..., 2], place[..., 1] / place[..., 2]
        texel = np.stack(
            [(x - sprite.left_m) / sprite.texel_m - 0.5, (sprite.top_m - z) / sprite.texel_m - 0.5], axis=-1
        )
        # Within a pixel the camera is linear to 1e-6 px: rays through the pixels' centres are enough.
        lookup = cv2.resize(texel.astype(np.float32), fine, interpolation=cv2.INTER_LINEAR)
        lookup = lookup[samples:-samples, samples:-samples]
        gathered += cv2.remap(sprite.texture, lookup, np.empty(0), cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    mean = cv2.resize(gathered, (width, height), interpolation=cv2.INTER_AREA) / np.float32(len(poses))
    mean = mean.reshape(height, width, 2)
    part = image[low[1] : high[1], low[0] : high[0]]
    part *= 1 - mean[:, :, 1]
    part += mean[:, :, 0]


def _moments(film: Film, name: TagName, tag: Tag, index: int) -> list[Pose]:
    begin, end = (pose_of(film, name, tag, index, moment) for moment in (-0.5, 0.5))
    reach = tag.size_m * np.array([[0.0, 0.0], [-1, -1], [1, -1], [1, 1], [-1, 1]])
    first, last = (film.view.project(p.centre + reach[:, :1] * p.right + reach[:, 1:] * p.up) for p in (begin, end))
    path = float(np.max(np.hypot(*(last - first).T)))
    count = max(1, math.ceil(path / (SHARE_OF_BLUR * film.scene.picture.blur_px)))
    return [pose_of(film, name, tag, index, (j + 0.5) / count - 0.5) for j in range(count)]


def _shake(time_s: FloatArray, frequency_hz: float, rng: np.random.Generator) -> FloatArray:
    """Return a random shift of unit variance with frequencies about the given one, shape (n, 2)."""
    terms = 12
    frequency = frequency_hz * rng.uniform(0.5, 1.5, size=(terms, 2))
    phase = rng.uniform(0, 2 * np.pi, size=(terms, 2))
    waves = np.cos(2 * np.pi * frequency * time_s[:, None, None] + phase)
    shift: FloatArray = math.sqrt(2 / terms) * waves.sum(axis=1)
    return shift


def _shift(wall: ImageArray, shift_px: FloatArray) -> ImageArray:
    matrix = np.array([[1.0, 0.0, shift_px[0]], [0.0, 1.0, shift_px[1]]])
    moved = cv2.warpAffine(wall, matrix, wall.shape[::-1], flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(moved, dtype=np.float32)
