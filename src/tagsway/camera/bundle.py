"""Bundle adjustment: the view that all tags share, and where each tag was in each frame."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.camera.projection import POSE, differentiate, project_tags
from tagsway.model import BoolArray, FloatArray, IntArray

MOST_STEPS = 60
SETTLED = 0.01
"""A step that lowers the sum of normalised squares by less changes nothing that could be told."""

SLOWEST_FALL = 0.5
"""A spread falls to no less of itself in a round."""

LASTING = 10.0
"""Frames that leave the plane alike: a sway lasts, where noise does not."""

MOST_DAMPING = 1e9

ROUNDS = 8
"""Of fit and weighing: how noisy the corners are, how far tags leave the plane."""

OUTLIER = 6.0
"""Distance of a tag from its model, in units of its noise, above which it counts less (Huber); 2.8 is usual."""

LEAST_NOISE_PX = 0.02
"""Less than the errors that a print, a codec and the grid of pixels leave in every frame alike."""

KNOWN_EACH = 8 - POSE
"""What a tag's eight coordinates tell beside where it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """What is fitted: n sightings of tags.

    Parameters
    ----------
    corners_px : ndarray, shape (n, 4, 2)
        From the principal point.
    tag, frame : ndarray of int, shape (n,)
        Whose, and in which frame.
    side : ndarray, shape (tags,)
        Sides of the tags.
    leaves : ndarray of bool, shape (tags,)
        Which tags may leave the plane (a product sways and yaws; a tool does not).
    share : ndarray, shape (n,)
        What each sighting counts: those that share their error count as one.
    """

    corners_px: FloatArray
    tag: IntArray
    frame: IntArray
    side: FloatArray
    leaves: BoolArray
    share: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Normal priors on the shared unknowns; a standard deviation of 0 holds one fixed. Both of shape (m,)."""

    mean: FloatArray
    std: FloatArray

    @property
    def free(self) -> BoolArray:
        """Which unknowns are fitted, shape (m,)."""
        free: BoolArray = self.std > 0
        return free


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """The fit.

    Parameters
    ----------
    shared : ndarray, shape (m,)
        The unknowns of all frames.
    covariance : ndarray, shape (m, m)
        Their covariance, 0 for those that were fixed.
    pose : ndarray, shape (n, POSE)
        Of each sighting.
    noise_px : float
        Standard error of a corner's coordinate.
    leaving : ndarray, shape (tags, 3)
        Standard deviation with which each tag leaves the plane: depth as a share of the distance, two angles over f.
    """

    shared: FloatArray
    covariance: FloatArray
    pose: FloatArray
    noise_px: float
    leaving: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class _Normal:
    """The normal equations with each sighting's own unknowns eliminated."""

    cost: float
    reduced: FloatArray
    right: FloatArray
    inner: FloatArray
    across: FloatArray
    inner_right: FloatArray
    scores: FloatArray


def adjust_bundle(views: Views, prior: Prior, pose: FloatArray, *, noise_px: float, leaving: FloatArray) -> Bundle:
    """Fit the view and every pose to the corners that were seen.

    Parameters
    ----------
    views : Views
        The corners.
    prior : Prior
        On the shared unknowns; its mean is the start.
    pose : ndarray, shape (n, POSE)
        Start of each sighting's own unknowns.
    noise_px : float
        Guess of a corner's standard error; found anew.
    leaving : ndarray, shape (tags, 3)
        Guess of how far tags leave the plane; found anew for those that may, 0 for the others.

    Returns
    -------
    Bundle
        With errors that count common errors of a frame's corners: those of the curvature, or where they are larger
        those of the scores' scatter from frame to frame (the "sandwich").

    Notes
    -----
    Levenberg-Marquardt. A sighting's unknowns touch no other sighting, so they are eliminated one by one (the Schur
    complement): the work is linear in the sightings. A tag that leaves the plane adds to its corners' noise what that
    does to the first order; as a fitted unknown of every frame it would draw the view to where the noise of all of them
    costs the least. How much, and the noise itself, are found from the residuals between the rounds (expectation and
    maximisation).
    """
    bundle = Bundle(
        shared=prior.mean.copy(),
        covariance=np.zeros((len(prior.mean),) * 2),
        pose=pose.copy(),
        noise_px=noise_px,
        leaving=leaving.copy(),
    )
    for _ in range(ROUNDS):
        bundle = _descend(views, prior, bundle, _weights(views, bundle, lasting=LASTING))
        bundle = _judge_noise(views, bundle)
    weight = _weights(views, bundle, lasting=LASTING)
    bundle = _descend(views, prior, bundle, weight)
    return replace(bundle, covariance=_covariance(views, prior, bundle, weight))


def _weights(views: Views, bundle: Bundle, *, lasting: float = 1.0) -> FloatArray:
    """Return the inverse covariance of each sighting's corners, shape (n, 8, 8); so many leave the plane alike."""
    shown = project_tags(bundle.shared, bundle.pose, views.tag, views.side)
    leave_slope = differentiate(shown, bundle.shared, bundle.pose, views.tag)[2]
    spread = leave_slope * bundle.leaving[views.tag][:, None]
    return np.asarray(np.linalg.inv(bundle.noise_px**2 * np.eye(8) + lasting * spread @ np.swapaxes(spread, 1, 2)))


def _descend(views: Views, prior: Prior, bundle: Bundle, weight: FloatArray) -> Bundle:
    """Return the bundle at the least cost."""
    damping, free = 1e-3, np.flatnonzero(prior.free)
    normal = _normal_equations(views, prior, bundle, weight)
    for _ in range(MOST_STEPS):
        damped = normal.reduced + damping * np.diag(np.diag(normal.reduced))
        step = np.linalg.solve(damped, normal.right)
        own = np.einsum("nij,nj->ni", normal.inner, normal.inner_right - np.einsum("gnj,g->nj", normal.across, step))
        shared = bundle.shared.copy()
        shared[free] += step
        trial = replace(bundle, shared=shared, pose=bundle.pose + own)
        with np.errstate(all="ignore"):
            after = _normal_equations(views, prior, trial, weight)
        gain = normal.cost - after.cost
        if gain > 0:
            bundle, normal, damping = trial, after, max(damping / 5, 1e-9)
        else:
            damping *= 10
        if 0 <= gain < SETTLED or damping > MOST_DAMPING:
            break
    return bundle


def _normal_equations(views: Views, prior: Prior, bundle: Bundle, weight: FloatArray) -> _Normal:
    free = np.flatnonzero(prior.free)
    shown = project_tags(bundle.shared, bundle.pose, views.tag, views.side)
    residual = (views.corners_px - shown.corners_px).reshape(-1, 8)
    shared_slope, pose_slope, _ = differentiate(shown, bundle.shared, bundle.pose, views.tag)
    shared_slope = shared_slope[free]
    miss = np.sqrt(np.einsum("ni,nij,nj->n", residual, weight, residual))
    cost = float(views.share @ np.where(miss < OUTLIER, miss**2, 2 * OUTLIER * miss - OUTLIER**2))
    counted = weight * (views.share / np.maximum(1.0, miss / OUTLIER))[:, None, None]
    weighted_pose = counted @ pose_slope
    inner = np.linalg.inv(np.swapaxes(pose_slope, 1, 2) @ weighted_pose)
    weighted = (counted @ residual[..., None])[..., 0]
    inner_right = np.einsum("nki,nk->ni", pose_slope, weighted)
    across = np.einsum("gnk,nkj->gnj", shared_slope, weighted_pose)
    kept = np.einsum("gnj,nji->gni", across, inner)
    scores = np.einsum("gnk,nk->gn", shared_slope, weighted) - np.einsum("gni,ni->gn", kept, inner_right)
    flat_slope = shared_slope.reshape(len(free), -1)
    pulled = np.einsum("nkl,gnl->gnk", counted, shared_slope).reshape(len(free), -1)
    reduced = flat_slope @ pulled.T - kept.reshape(len(free), -1) @ across.reshape(len(free), -1).T
    off, strength = (bundle.shared - prior.mean)[free], 1 / prior.std[free] ** 2
    cost += float(strength @ off**2)
    return _Normal(
        cost=cost if np.isfinite(cost) else np.inf,
        reduced=reduced + np.diag(strength),
        right=scores.sum(axis=1) - strength * off,
        inner=inner,
        across=across,
        inner_right=inner_right,
        scores=scores,
    )


def _judge_noise(views: Views, bundle: Bundle) -> Bundle:
    """Return the bundle with the corners' noise and the tags' way out of the plane as the residuals tell them."""
    shown = project_tags(bundle.shared, bundle.pose, views.tag, views.side)
    residual = (views.corners_px - shown.corners_px).reshape(-1, 8)
    _, pose_slope, leave_slope = differentiate(shown, bundle.shared, bundle.pose, views.tag)
    weight = _weights(views, bundle)
    # What the pose takes is taken off the weight, so that the rest is judged by what it can still show.
    weighted_pose = weight @ pose_slope
    inner = np.linalg.inv(np.swapaxes(pose_slope, 1, 2) @ weighted_pose)
    rest = weight - weighted_pose @ inner @ np.swapaxes(weighted_pose, 1, 2)
    square = np.einsum("ni,nij,nj->n", residual, rest, residual)
    share = views.share * (square < OUTLIER**2)
    if not share.any():
        share = views.share
    noise = bundle.noise_px * np.sqrt(float(share @ square) / (KNOWN_EACH * share.sum()))
    pull = np.einsum("nki,nkl,nl->ni", leave_slope, rest, residual)
    known = np.einsum("nki,nkl,nli->ni", leave_slope, rest, leave_slope)
    leaving = bundle.leaving.copy()
    for tag in np.flatnonzero(views.leaves):
        mine, variance = views.tag == tag, bundle.leaving[tag] ** 2
        found = variance + variance**2 * (pull[mine] ** 2 - known[mine])
        found = np.average(found, axis=0, weights=share[mine])
        # A spread of zero would stay zero, and the first rounds' view is not yet to be trusted.
        leaving[tag] = np.sqrt(np.maximum(found, variance * SLOWEST_FALL**2))
    return replace(bundle, noise_px=max(float(noise), LEAST_NOISE_PX), leaving=leaving)


def _covariance(views: Views, prior: Prior, bundle: Bundle, weight: FloatArray) -> FloatArray:
    normal = _normal_equations(views, prior, bundle, weight)
    free = np.flatnonzero(prior.free)
    plain = np.linalg.inv(normal.reduced)
    frames = np.unique(views.frame, return_inverse=True)[1]
    by_frame = np.zeros((int(frames.max()) + 1, len(free)))
    np.add.at(by_frame, frames, normal.scores.T)
    scatter = by_frame.T @ by_frame + np.diag(1 / prior.std[free] ** 2)
    robust = plain @ scatter @ plain
    stretch = np.sqrt(np.maximum(1.0, np.diag(robust) / np.diag(plain)))
    covariance = np.zeros((len(prior.mean),) * 2)
    covariance[np.ix_(free, free)] = plain * np.outer(stretch, stretch)
    return covariance
