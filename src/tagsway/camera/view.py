"""The camera without a calibration target: its lens and its place, from the corners of the tags that moved."""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np

from tagsway.camera.bundle import Bundle, Prior, Views, adjust_bundle
from tagsway.camera.projection import LENS, OF_A_TAG, POSE, View
from tagsway.model import (
    BoolArray,
    Camera,
    Estimate,
    FloatArray,
    IntArray,
    Notice,
    PlaneView,
    SeenTag,
    Settings,
    Sightings,
    TagSightings,
)

USUAL_FOCAL_WIDTHS = 1.5
FOCAL_STD_LOG = 0.4
"""Focal lengths in widths of the image: 0.7 for a telephone, 1 to 2.5 for what films a machine from 1 to 2 m."""

RADIAL_STD = 0.15
TILT_STD = math.tan(math.radians(10))
DEPTH_STD = 0.03
"""Of one tag behind another, as a share of the distance."""

ATTITUDE_STD_RAD = math.radians(2)
"""Of a tag that somebody stuck on as parallel to the motion as the eye can tell."""

PRINT_STD = 0.002
"""Of a print's length over its width: the feed of the paper."""

MOST_FRAMES = 120
MOST_CANDIDATES = 4000
"""Frames that are looked at to choose from, whatever the video's length."""

LEAST_FRAMES = 20
LEAST_SPAN = 0.15
"""Of the image's width that a tag must cross: below, the camera's tilt is its prior."""

WORST_SCALE = 0.01
WORST_NOISE_PX = 0.5
"""Corners that miss a plane's motion by more did not move in a plane, or not before one camera."""

LESS_LIKE = 0.02
"""Of correlation below a tag's median: it is partly hidden."""

START_NOISE_PX = 2.0
"""More than corners miss the frontal view that the fit starts from, so that none counts as an outlier there."""

SAME_PLACE_PX = 0.5

TIME_WEIGHT = 0.2
"""Of the time in the distance between frames, where the place counts in widths of the image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scene:
    """What the fit starts from: tags, their sides, and the lens as it is known or guessed."""

    tags: tuple[TagSightings, ...]
    side: FloatArray
    leaves: BoolArray
    camera: Camera
    known: bool


def find_view(
    sightings: Sightings, settings: Settings, *, camera: Camera | None = None
) -> tuple[PlaneView | None, tuple[Notice, ...]]:
    """Find how the camera looks at the plane of the motion, from the tags' own corners.

    Parameters
    ----------
    sightings : Sightings
        In pixels; where the lens is known, without its distortion (`undistort_sightings`).
    settings : Settings
        Which tag is which, and how large.
    camera : Camera, optional
        A known lens: its focal length is kept, and only the plane's tilt is found.

    Returns
    -------
    view : PlaneView or None
        None where the tags moved too little to tell, or not in a plane: plain scale is then the better choice.
    notices : tuple of Notice
        `camera_from_motion` with what was found, or `plain_scale` with the reason.

    Notes
    -----
    Bundle adjustment over a spread of frames, at most 120 of them however long the video. The tool moves in
    the plane; the product may leave it, by as much as the fit itself finds. The principal point is the image's centre
    and the roll is zero: neither can be told from the motion. Priors, as standard deviations: focal length 40 % around
    1.5 widths of the image, k1 0.15, tilt 10°, a tag's depth 3 % of the distance, its own attitude 2°, the length of
    its print over the width 0.2 %. A frontal view says nothing of the focal length: its prior comes back, and no length
    depends on it. The side of the printed square is pure scale: no picture shows its error.
    """
    scene = _arrange(sightings, settings, camera)
    if scene is None:
        return None, ()
    span = max(float(np.max(np.nanmax(tag.centre_px, axis=0) - np.nanmin(tag.centre_px, axis=0))) for tag in scene.tags)
    if not span >= LEAST_SPAN * sightings.video.width:
        share = 100 * span / sightings.video.width
        return None, _plain(f"the tags cross {share:.0f} % of the image only, which does not tell the camera's tilt")
    chosen = choose_frames(sightings.time_s, scene.tags, width=sightings.video.width)
    if len(chosen) < LEAST_FRAMES:
        return None, _plain(f"{len(chosen)} frames show the tags well enough, {LEAST_FRAMES} are needed")
    bundle = _fit(scene, chosen)
    view = _describe(bundle, scene, sightings)
    if not bundle.noise_px <= WORST_NOISE_PX:
        return None, _plain(f"the tags' corners miss a motion in a plane by {bundle.noise_px:.2f} px")
    worst = max(tag.scale.std / tag.scale.value for tag in view.tags)
    if not worst <= WORST_SCALE:
        return None, _plain(f"lengths from the camera's view would be known to {100 * worst:.1f} % only")
    return view, (Notice(code="camera_from_motion", message=_words(view, known=scene.known)),)


def choose_frames(time_s: FloatArray, tags: tuple[TagSightings, ...], *, width: int) -> IntArray:
    """Return a spread of frames in which every tag is well seen: the farthest from those already chosen, in place and
    time.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the frames.
    tags : tuple of TagSightings
        Their places count.
    width : int
        Of the image, in pixels: what a distance in time is compared with.

    Returns
    -------
    ndarray of int, shape (m,)
        In order of time; at most 120.
    """
    good = np.ones(len(time_s), dtype=bool)
    for tag in tags:
        whole = np.isfinite(tag.corners_px).all(axis=(1, 2)) & np.isfinite(tag.angle_rad)
        typical = np.median(tag.correlation[whole]) if whole.any() else np.inf
        good &= whole & (tag.correlation >= typical - LESS_LIKE)
    candidates = np.flatnonzero(good)
    candidates = candidates[:: max(1, len(candidates) // MOST_CANDIDATES)]
    if len(candidates) <= MOST_FRAMES:
        return candidates
    time = (time_s[candidates] - time_s[candidates[0]]) / (time_s[candidates[-1]] - time_s[candidates[0]])
    turns = [tag.corners_px[candidates, 1] - tag.corners_px[candidates, 0] for tag in tags]
    places = [tag.centre_px[candidates] for tag in tags]
    where = np.column_stack([*places, *turns, TIME_WEIGHT * width * time]) / width
    nearest = np.full(len(candidates), np.inf)
    chosen = [0]
    while len(chosen) < MOST_FRAMES:
        nearest = np.minimum(nearest, np.sum((where - where[chosen[-1]]) ** 2, axis=1))
        chosen.append(int(np.argmax(nearest)))
    return candidates[np.unique(chosen)]


def share_places(corners_px: FloatArray) -> FloatArray:
    """Return one over how often a tag was seen where it is in each frame, shape (n, 4, 2) → (n,).

    A picture that does not change repeats its error: a codec copies it, and the grid of pixels cuts it the same way.
    """
    apart = np.abs(corners_px[:, None] - corners_px[None]).max(axis=(2, 3))
    share: FloatArray = 1 / np.count_nonzero(apart < SAME_PLACE_PX, axis=1)
    return share


def _arrange(sightings: Sightings, settings: Settings, camera: Camera | None) -> _Scene | None:
    """Return the tags that move or stand in the plane, those of known size first; None where there is none."""
    wanted = [(settings.tcp_id, settings.tcp_tag_size_m), (settings.pcp_id, settings.pcp_tag_size_m)]
    wanted.sort(key=lambda item: item[1] is None)
    found = [(sightings.tag(tag_id), size) for tag_id, size in wanted]
    seen = [(tag, size) for tag, size in found if tag is not None and tag.seen.any()]
    if not seen:
        return None
    # A side that is not known is what it looks like: the unit of length is then a pixel.
    unit = 1.0
    sides: list[float] = []
    for tag, size in seen:
        looks = float(np.nanmedian(np.linalg.norm(np.diff(tag.corners_px, axis=1), axis=2)))
        unit = size / looks if size is not None and not sides else unit
        sides.append(looks * unit if size is None else size)
    video = sightings.video
    lens = camera or Camera(
        width=video.width,
        height=video.height,
        fx=USUAL_FOCAL_WIDTHS * video.width,
        fy=USUAL_FOCAL_WIDTHS * video.width,
        cx=(video.width - 1) / 2,
        cy=(video.height - 1) / 2,
    )
    return _Scene(
        tags=tuple(tag for tag, _ in seen),
        side=np.array(sides),
        leaves=np.array([tag.tag_id == settings.pcp_id for tag, _ in seen]),
        camera=lens,
        known=camera is not None,
    )


def _fit(scene: _Scene, chosen: IntArray) -> Bundle:
    count = len(scene.tags)
    principal = np.array([scene.camera.cx, scene.camera.cy])
    corners = np.concatenate([tag.corners_px[chosen] for tag in scene.tags]) - principal
    centres = np.concatenate([tag.centre_px[chosen] for tag in scene.tags]) - principal
    looks = float(np.median(np.linalg.norm(np.diff(scene.tags[0].corners_px[chosen], axis=1), axis=2)))
    focal = scene.camera.fx
    lens_mean = [math.log(focal), 0.0, 0.0, 0.0, math.log(scene.side[0] / looks)]
    lens_std = [FOCAL_STD_LOG, RADIAL_STD / focal**2, TILT_STD / focal, TILT_STD / focal, 1.0]
    if scene.known:
        lens_std[:2] = [0.0, 0.0]
    own_std = np.full((count, OF_A_TAG), ATTITUDE_STD_RAD / focal)
    own_std[:, 0], own_std[:, 3] = DEPTH_STD, PRINT_STD
    own_std[0, 0] = 0.0
    pose = np.zeros((len(corners), POSE))
    pose[:, :2] = centres
    pose[:, 2] = np.concatenate([tag.angle_rad[chosen] for tag in scene.tags])
    leaving = np.where(scene.leaves[:, None], [0.003, 0.02 / focal, 0.02 / focal], 0.0)
    return adjust_bundle(
        Views(
            corners_px=corners,
            tag=np.repeat(np.arange(count), len(chosen)),
            frame=np.tile(chosen, count),
            side=scene.side,
            leaves=scene.leaves,
            share=np.concatenate([share_places(tag.corners_px[chosen]) for tag in scene.tags]),
        ),
        Prior(
            mean=np.concatenate([lens_mean, np.zeros(OF_A_TAG * count)]),
            std=np.concatenate([lens_std, own_std.ravel()]),
        ),
        pose,
        noise_px=START_NOISE_PX,
        leaving=leaving,
    )


def _describe(bundle: Bundle, scene: _Scene, sightings: Sightings) -> PlaneView:
    view = View.of(bundle.shared)
    std = _errors(bundle, lambda shared: np.array([*astuple(View.of(shared))]))
    own = bundle.shared[LENS:].reshape(-1, OF_A_TAG)
    ahead = view.axes[2, 2]
    middle = np.array([np.nanmedian(tag.centre_px, axis=0) for tag in scene.tags])
    errors = _length_errors(bundle, middle - np.array([scene.camera.cx, scene.camera.cy]))
    tags = []
    for number, tag in enumerate(scene.tags):
        depth = float(own[number, 0]) * view.distance
        scale = (view.distance + depth / ahead) / view.focal_px
        estimate = Estimate.normal(scale, scale * float(errors[number]), low=0.0)
        tags.append(SeenTag(tag_id=tag.tag_id, depth=depth, scale=estimate))
    lens = scene.camera
    return PlaneView(
        camera=Camera(
            width=sightings.video.width,
            height=sightings.video.height,
            fx=view.focal_px,
            fy=view.focal_px,
            cx=lens.cx,
            cy=lens.cy,
            distortion=(view.radial_k1, 0.0, 0.0, 0.0, 0.0),
        ),
        focal_px=Estimate.normal(view.focal_px, float(std[0]), low=0.0),
        radial_k1=Estimate.normal(view.radial_k1, float(std[1])),
        pitch_rad=Estimate.normal(view.pitch_rad, float(std[2])),
        yaw_rad=Estimate.normal(view.yaw_rad, float(std[3])),
        distance=view.distance,
        tags=tuple(tags),
    )


def _length_errors(bundle: Bundle, middle_px: FloatArray) -> FloatArray:
    """Return the relative standard error of lengths in each tag's plane: the worst of a level one, an upright one, and
    the way there from the first tag."""
    near = np.array([[0.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])

    def log_lengths(shared: FloatArray) -> FloatArray:
        view = View.of(shared)
        ray = (middle_px[:, None] + near) / view.focal_px
        plane = ray.copy()
        for _ in range(20):
            plane = ray / (1 + view.radial_k1 * np.sum(plane**2, axis=-1, keepdims=True))
        depths = shared[LENS::OF_A_TAG] * view.distance
        place = np.array([view.cast(points, depth) for points, depth in zip(plane, depths, strict=True)])
        apart = np.linalg.norm(place[:, 0] - place[0, 0], axis=1)
        level, upright = (np.linalg.norm(place[:, i + 1] - place[:, i], axis=1) for i in (1, 3))
        return np.concatenate([np.log(level), np.log(upright), np.log(np.where(apart > 0, apart, 1.0))])

    worst: FloatArray = _errors(bundle, log_lengths).reshape(3, -1).max(axis=0)
    return worst


def _errors(bundle: Bundle, tell: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the standard errors of what the shared unknowns tell, shape (k,)."""
    steps = np.diag(1e-3 * np.sqrt(np.diag(bundle.covariance)))
    change = np.array([tell(bundle.shared + step) - tell(bundle.shared - step) for step in steps]) / 2e-3
    spread = np.sqrt(np.diag(bundle.covariance))
    share = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 0)
    correlation = bundle.covariance * np.outer(share, share)
    errors: FloatArray = np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", change, correlation, change), 0.0))
    return errors


def _plain(reason: str) -> tuple[Notice, ...]:
    return (Notice(code="plain_scale", message=f"{reason}: each tag's plain scale is used"),)


def _words(view: PlaneView, *, known: bool) -> str:
    def degrees(angle: Estimate) -> str:
        return f"{math.degrees(angle.value):.1f} ± {math.degrees(angle.std):.1f}°"

    tilt = f"pitch {degrees(view.pitch_rad)}, yaw {degrees(view.yaw_rad)}"
    if known:
        return f"the plane's tilt against the known camera was found from the tags' corners: {tilt}"
    lens = f"focal length {view.focal_px.value:.0f} ± {view.focal_px.std:.0f} px"
    if view.focal_px.std > 0.6 * FOCAL_STD_LOG * view.focal_px.value:
        lens += " (assumed: so frontal a view does not tell it)"
    radial = f"k1 {view.radial_k1.value:.4f} ± {view.radial_k1.std:.1g}"
    return f"the camera was found from the tags' own corners: {lens}, {radial}, {tilt}"
