"""The product's arc about the pivot: where its centre is and how long its radius, without any dynamics.

Two witnesses tell it. The tag's positions lie on a circle; and the tag turns with its arm, so that the direction from
the pivot to it and its own angle differ by a constant only. Both share the pivot and the radius, and one weighted fit
joins them.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from tagsway.errors import NotIdentifiableError
from tagsway.model import SCALE_STD, BoolArray, Estimate, FloatArray, Notice
from tagsway.pendulum.priors import RELATIVE_SCALE_STD, TILT_STD_RAD, VERTICAL_SCALE_STD

LEAST_SAMPLES = 12
"""Below this many samples no arc and no motion is fitted."""

MOST_SAMPLES = 3000
"""A longer record is thinned evenly: its arc is known to what scale and lens leave by then."""

SOFTNESS_STD = 2.0
"""Where the soft-L1 loss turns from square to linear, in standard deviations: a spike pulls like a 2σ sample."""

DISAGREEMENT_STD, LEAST_DISAGREEMENT = 4.0, 0.02
"""The witnesses disagree where their radii differ by more than both: standard errors, and a share of r."""

LEAST_STD_M, LEAST_STD_RAD = 1e-5, 2e-4
"""No tag is measured better than this; a simulated track without noise would otherwise be judged by its rounding."""

LARGEST_RADIUS_STD = 0.1
"""Relative standard error above which a witness, or both, tell no radius."""

LEAST_INFORMATION = 1e-13
"""Least eigenvalue, of columns of length one, below which the samples leave a direction open."""

STRETCH_STEP = 1e-4
"""Step of its finite difference."""

LONGEST_COLOUR = 200
"""Lags over which residuals are tested for a colour that white noise has not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """A circle on which the product's tag moves, in the frame of the tool's tag.

    Parameters
    ----------
    centre_m : ndarray, shape (2,)
        x and z of the pivot, seen from the TCP tag.
    radius_m : float
        r.
    covariance_m2 : ndarray, shape (3, 3)
        Of x, z and r, from the samples' noise and the foreshortening along z alone.
    witnesses : tuple of Estimate
        The radius as the circle tells it, and as the tag's rotation does, each with its noise alone; empty where there
        is no rotation to compare, or one of them tells nothing.
    """

    centre_m: FloatArray
    radius_m: float
    covariance_m2: FloatArray
    witnesses: tuple[Estimate, ...] = ()

    @property
    def radius_std_m(self) -> float:
        """Standard error of r, without that of the scale."""
        return math.sqrt(float(self.covariance_m2[2, 2]))

    @property
    def known(self) -> bool:
        """Whether the samples tell the radius within a tenth."""
        return self.radius_std_m <= LARGEST_RADIUS_STD * self.radius_m

    def radius(self) -> Estimate:
        """Return r with the error of the scale: of both tags, and of one against the other."""
        scale = math.hypot(SCALE_STD, RELATIVE_SCALE_STD / 2) * self.radius_m
        return Estimate.normal(self.radius_m, math.hypot(self.radius_std_m, scale), low=0.0)

    def offset(self) -> tuple[Estimate, Estimate]:
        """Return x and z of the pivot from the TCP tag, with the errors of the scales and of the picture's vertical.

        Notes
        -----
        The pivot is a radius above the bottom of the arc: the relative scale moves that bottom by half of its error
        times the distance of the tags from each other, and the arm takes part in it.
        """
        x, z = self.centre_m
        parts = np.array(
            [
                [SCALE_STD * x, SCALE_STD * z],
                [RELATIVE_SCALE_STD / 2 * x, RELATIVE_SCALE_STD / 2 * z],
                [TILT_STD_RAD * z, TILT_STD_RAD * x],
                np.sqrt(np.diag(self.covariance_m2)[:2]),
            ]
        )
        std = np.linalg.norm(parts, axis=0)
        return Estimate.normal(float(x), float(std[0])), Estimate.normal(float(z), float(std[1]))

    def disagreement(self) -> Notice | None:
        """Return a notice where the two witnesses tell different radii."""
        if len(self.witnesses) < 2:
            return None
        circle, rotation = self.witnesses
        gap = rotation.value - circle.value
        if abs(gap) <= max(DISAGREEMENT_STD * math.hypot(circle.std, rotation.std), LEAST_DISAGREEMENT * self.radius_m):
            return None
        return Notice(
            code="arc_witnesses_disagree",
            message=f"the product's tag runs on a circle of {1e3 * circle.value:.1f} ± {1e3 * circle.std:.1f} mm, yet "
            f"it turns as if it hung {1e3 * rotation.value:.1f} ± {1e3 * rotation.std:.1f} mm below its pivot: the tag "
            "slips, the product bends, or its pivot wanders; r and the pivot are those of the circle",
        )


Witness = Literal["circle", "rotation", "both"]

FREE = {"circle": [0, 1, 2, 5], "rotation": [0, 1, 3, 5], "both": [0, 1, 2, 3, 5]}
"""Which of x, z, r, the angle's zero and the relative scale each witness tells; the stretch of z none, it is only
reckoned with."""

STRETCH, RELATIVE = 4, 5
"""Places of the stretch of z and of one tag's scale against the other's among the parameters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """What is fitted: positions, the tag's angle (NaN: none), the tool's turn and path, and the errors."""

    point: FloatArray
    sigma: FloatArray
    angle: FloatArray
    angle_std: FloatArray
    short: FloatArray
    turn: FloatArray
    tool: FloatArray

    def arm(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far each sample is right of the pivot, and below it."""
        # The pivot sits on the tool: where the tool turns, so does its offset from the TCP tag.
        sine, cosine = np.sin(self.turn), np.cos(self.turn)
        point = self.point - p[RELATIVE] * self.tool
        right = point[:, 0] - cosine * p[0] + sine * p[1]
        return right, (sine * p[0] + cosine * p[1] - point[:, 1]) * (1 - p[STRETCH])

    def held_back(self) -> "_Samples":
        """Return the samples with the tag's rotation smaller by a standard error of what a coder takes from it."""
        return replace(self, angle=self.angle - self.short)

    def residuals(self, p: FloatArray, noise: FloatArray, witness: Witness) -> FloatArray:
        """Return what is left of (x, z, r, zero, stretch, relative scale): of circle, rotation, and relative scale.

        The sample's own place on the arc is a nuisance: minimised over it, what is left is the distance to the circle,
        and the difference of two angles, of which one is measured as σ / r. `noise` are factors on both witnesses'.
        """
        right, down = self.arm(p)
        distance = np.hypot(right, down)
        left = []
        if witness != "rotation":
            left.append((distance - p[2]) / (noise[0] * self.sigma))
        if witness != "circle":
            gap = np.arctan2(right, down) - self.angle + p[3]
            spread = np.hypot(noise[1] * self.angle_std, noise[0] * self.sigma / np.maximum(distance, 1e-9))
            left.append((gap - 2 * np.pi * np.round(gap / (2 * np.pi)))[self.turned] / spread[self.turned])
        return np.concatenate([*left, p[[RELATIVE]] / RELATIVE_SCALE_STD])

    @property
    def turned(self) -> BoolArray:
        """Which samples have an angle."""
        return np.isfinite(self.angle)


def fit_arc(
    sway_m: FloatArray,
    std_m: FloatArray,
    angle_rad: FloatArray | None = None,
    angle_std_rad: FloatArray | None = None,
    *,
    angle_short_rad: FloatArray | None = None,
    tool_turn_rad: FloatArray | None = None,
    tool_m: FloatArray | None = None,
) -> Arc:
    """Fit the circle of the PCP about its pivot, to its positions and to its tag's own rotation.

    Parameters
    ----------
    sway_m, std_m : ndarray, shape (n, 2)
        x and z of PCP minus TCP and their standard errors; NaN is left out.
    angle_rad, angle_std_rad : ndarray, shape (n,), optional
        The tag's own rotation, from any constant zero, and its standard error; NaN is left out.
    angle_short_rad : ndarray, shape (n,), optional
        What a coder may have taken from all of them together, to one standard error.
    tool_turn_rad : ndarray, shape (n,), optional
        The tool's rotation from where the offset is wanted, smooth; the pivot's offset turns with it.
    tool_m : ndarray, shape (n, 2), optional
        The tool's path where it moves: a share of it that is one tag's scale against the other's shifts the product.

    Returns
    -------
    Arc
        Minimum of the soft-L1 loss over both witnesses.

    Raises
    ------
    NotIdentifiableError
        With fewer than 12 samples.

    Notes
    -----
    In five unknowns c, r, the angle's zero φ0 and the relative scale e = 0 ± 0.5 %, with d = PCP - (1 + e) TCP - c:
    |d| = r ± σ, and atan2(d_x, -d_z) = φ - φ0 ± √(σ_φ² + σ²/r²). It is orthogonal regression: an angle's noise does not
    shorten r. A short arc (below 0.3 rad) is known by its rotation, a long one by its circle; a joint fit is never
    worse than the better of the two. Gravity does not enter: a tilted picture turns the offset and leaves r.

    Each witness's residuals say what its noise is, never less than stated, and how coloured it is: the errors are
    widened by √(1 + 2 Σ ρ), ρ their autocorrelation. Where the witnesses disagree, the circle alone is believed if it
    tells r within a tenth: a tag may slip on its product, the product cannot leave its pivot.

    References
    ----------
    .. [1] N. Chernov and C. Lesort, J. Math. Imaging Vis. 23 (2005) 239-252.
    """
    samples = _present(sway_m, std_m, angle_rad, angle_std_rad, angle_short_rad, tool_turn_rad, tool_m)
    rotates = np.count_nonzero(samples.turned) >= LEAST_SAMPLES
    start = _start_of_rotation(samples) if rotates else _start_of_circle(samples)
    circle, noise = _fit(samples, start, "circle", np.ones(2))
    if not rotates:
        return circle
    rotation, noise = _fit(samples, start, "rotation", noise)
    together = start if not circle.known else np.array([*circle.centre_m, circle.radius_m, *start[3:]])
    joint, _ = _fit(samples, together, "both", noise)
    if not (circle.known and rotation.known):
        return joint
    told = tuple(Estimate.normal(one.radius_m, one.radius_std_m) for one in (circle, rotation))
    joint = replace(joint, witnesses=told)
    return joint if joint.disagreement() is None else replace(circle, witnesses=told)


def _fit(samples: _Samples, start: FloatArray, witness: Witness, noise: FloatArray) -> tuple[Arc, FloatArray]:
    """Return the arc that a witness tells, or both, and the factors on both noises that their residuals show."""
    free, p = FREE[witness], start.copy()

    def residual(part: FloatArray, stretch: float = 0.0, seen: _Samples = samples) -> FloatArray:
        full = p.copy()
        full[free], full[STRETCH] = part, stretch
        return seen.residuals(full, noise, witness)

    for last in (False, True):
        solution = least_squares(
            residual, p[free], x_scale="jac", loss="soft_l1", f_scale=SOFTNESS_STD, max_nfev=40, xtol=1e-9
        )
        p[free] = solution.x
        left = residual(solution.x)
        if not last and witness != "both":
            noise = noise.copy()
            noise[witness == "rotation"] *= max(1.0, 1.4826 * float(np.median(np.abs(left))))
    shifts = [VERTICAL_SCALE_STD * (residual(solution.x, STRETCH_STEP) - left) / STRETCH_STEP]
    if witness != "circle":
        shifts.append(residual(solution.x, seen=samples.held_back()) - left)
    middle = len(samples.point)
    parts = (slice(0, middle), slice(middle, -1)) if witness == "both" else (slice(0, -1),)
    covariance = _covariance(np.asarray(solution.jac), left, shifts, parts)
    if witness == "rotation":
        return _radius_of_rotation(samples, p, noise[0], covariance[:2, :2]), noise
    return Arc(centre_m=p[:2].copy(), radius_m=float(p[2]), covariance_m2=covariance[:3, :3]), noise


def _covariance(
    jacobian: FloatArray, left: FloatArray, shifts: list[FloatArray], parts: tuple[slice, ...]
) -> FloatArray:
    """Return the parameters' covariance under the soft-L1 loss, for residuals that are coloured.

    H⁻¹ (Σ ψ² J Jᵀ) H⁻¹ with ψ the loss's slope and H its curvature: for normal noise it is what scatter there is, and
    not the few percent more that H⁻¹ alone would say. `shifts` are what a standard error of the stretch does to the
    residuals, and one of the rotation's shortfall.
    """
    square = (left / SOFTNESS_STD) ** 2
    slope, bend = left / np.sqrt(1 + square), (1 + square) ** -1.5
    plain = jacobian / np.sqrt(bend)[:, None]
    variance = np.ones(len(left))
    for part in parts:
        variance[part] = np.mean(slope[part] ** 2) * _colour(slope[part])
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    information = (jacobian / size).T @ (jacobian / size)
    if not np.linalg.eigvalsh(information)[0] > LEAST_INFORMATION:
        return np.full((len(size), len(size)), np.inf)
    inverse = np.linalg.inv(information) / np.outer(size, size)
    moved = inverse @ (plain.T @ (bend * np.array(shifts)).T)
    return np.asarray(inverse @ ((plain.T * variance) @ plain) @ inverse + moved @ moved.T)


def _colour(values: FloatArray) -> float:
    """Return by how much a series' colour widens the variance of its mean: 1 + 2 Σ ρ, while ρ stands out."""
    centred = values - np.mean(values)
    count = len(centred)
    power = np.abs(np.fft.rfft(centred, 2 * count)) ** 2
    correlation = np.fft.irfft(power)[: min(count // 4, LONGEST_COLOUR) + 1]
    if not correlation[0] > 0:
        return 1.0
    correlation = correlation[1:] / correlation[0]
    lost = np.flatnonzero(correlation < 2 / math.sqrt(count))
    return 1 + 2 * float(np.sum(correlation[: lost[0]] if len(lost) else correlation))


def _radius_of_rotation(samples: _Samples, p: FloatArray, noise: float, covariance: FloatArray) -> Arc:
    """Return the arc about a centre that the rotation told: its radius is the mean distance from there."""
    right, down = samples.arm(p)
    distance = np.hypot(right, down)
    radius = float(np.median(distance))
    slope = np.array([-np.mean(right / distance), np.mean(down / distance)])
    whole = np.full((3, 3), np.inf)
    if not np.all(np.isfinite(covariance)):
        return Arc(centre_m=p[:2].copy(), radius_m=radius, covariance_m2=whole)
    whole[:2, :2] = covariance
    whole[2, :2] = whole[:2, 2] = covariance @ slope
    whole[2, 2] = slope @ covariance @ slope + noise**2 * np.mean(samples.sigma**2) / len(distance)
    return Arc(centre_m=p[:2].copy(), radius_m=radius, covariance_m2=whole)


def _start_of_circle(samples: _Samples) -> FloatArray:
    """Return the linear fit of x² + z² = 2 c·(x, z) + r² - |c|², which errs to small radii on short arcs."""
    middle = np.median(samples.point, axis=0)
    shifted = samples.point - middle
    design = np.column_stack([2 * shifted, np.ones(len(shifted))])
    (x, z, rest), *_ = np.linalg.lstsq(design, np.sum(shifted**2, axis=1), rcond=None)
    radius = math.sqrt(max(rest + x**2 + z**2, 1e-12))
    return np.array([x + middle[0], z + middle[1], radius, 0.0, 0.0, 0.0])


def _start_of_rotation(samples: _Samples) -> FloatArray:
    """Return the fit of (x, z) = c + r (sin(φ - φ0), -cos(φ - φ0)), linear in c, r cos φ0 and r sin φ0."""
    point, phi = samples.point[samples.turned], samples.angle[samples.turned]
    sine, cosine, one, zero = np.sin(phi), np.cos(phi), np.ones_like(phi), np.zeros_like(phi)
    design = np.vstack([np.column_stack([one, zero, sine, -cosine]), np.column_stack([zero, one, -cosine, -sine])])
    target, weight = point.T.ravel(), np.ones(2 * len(point))
    for _ in range(6):
        p, *_ = np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)
        miss = np.abs(target - design @ p)
        weight = np.minimum(1.0, np.median(miss) / np.maximum(miss, 1e-12)) ** 0.5
    return np.array([p[0], p[1], math.hypot(p[2], p[3]), math.atan2(p[3], p[2]), 0.0, 0.0])


def _present(
    sway: FloatArray,
    std: FloatArray,
    angle: FloatArray | None,
    angle_std: FloatArray | None,
    short: FloatArray | None,
    turn: FloatArray | None,
    tool: FloatArray | None,
) -> _Samples:
    """Return the samples whose positions are there, thinned evenly where there are many."""
    unknown = np.full(len(sway), np.nan)
    phi, phi_std = unknown if angle is None else angle, unknown if angle_std is None else angle_std
    turned = np.zeros(len(sway)) if turn is None else turn
    good = np.flatnonzero(np.all(np.isfinite(sway) & np.isfinite(std), axis=1) & np.isfinite(turned))
    if not len(good) >= LEAST_SAMPLES:
        raise NotIdentifiableError(
            f"only {len(good)} samples show both tags: at least {LEAST_SAMPLES} are needed for an arc",
            code="pendulum_not_determined",
        )
    good = good[:: max(1, math.ceil(len(good) / MOST_SAMPLES))]
    known = np.isfinite(phi[good]) & (phi_std[good] > 0)
    return _Samples(
        point=sway[good],
        sigma=np.maximum(np.sqrt(np.mean(std[good] ** 2, axis=1)), LEAST_STD_M),
        angle=np.where(known, phi[good], np.nan),
        angle_std=np.where(known, np.maximum(np.nan_to_num(phi_std[good]), LEAST_STD_RAD), 1.0),
        short=np.zeros(len(good)) if short is None else short[good],
        turn=turned[good],
        tool=np.zeros((len(good), 2)) if tool is None else tool[good],
    )
