"""The product's arc about the pivot: where its centre is and how long its radius, without any dynamics."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tagsway.errors import NotIdentifiableError
from tagsway.model import FloatArray

LEAST_SAMPLES = 12
"""Below this many samples no arc and no motion is fitted."""

SOFTNESS_STD = 2.0
"""Where the soft-L1 loss turns from square to linear, in standard deviations: a spike pulls like a 2σ sample."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """A circle on which the product's tag moves, in the frame of the tool's tag.

    Parameters
    ----------
    centre_m : ndarray, shape (2,)
        x and z of the pivot, seen from the TCP tag.
    radius_m, radius_std_m : float
        r and its standard error.
    """

    centre_m: FloatArray
    radius_m: float
    radius_std_m: float


def fit_circle(sway_m: FloatArray, std_m: FloatArray) -> Arc:
    """Fit a circle to the positions of the PCP relative to the TCP.

    Parameters
    ----------
    sway_m : ndarray, shape (n, 2)
        x and z of PCP minus TCP; NaN is left out.
    std_m : ndarray, shape (n, 2)
        Their standard errors.

    Returns
    -------
    Arc
        Minimum of the soft-L1 distance to the circle, along the radius.

    Raises
    ------
    NotIdentifiableError
        With fewer than 12 samples.

    Notes
    -----
    Started by the linear fit of x² + z² = 2 c·(x, z) + r² - |c|², which is biased to small radii on short arcs [1]_;
    the distance to the circle is not. A short arc (below 0.3 rad) leaves r with a large error: `fit_rotation` is then
    the better witness.

    References
    ----------
    .. [1] N. Chernov and C. Lesort, J. Math. Imaging Vis. 23 (2005) 239-252.
    """
    points, noise = _present(sway_m, std_m)
    middle = np.median(points, axis=0)
    shifted = points - middle
    design = np.column_stack([2 * shifted, np.ones(len(points))])
    (cx, cz, rest), *_ = np.linalg.lstsq(design, np.sum(shifted**2, axis=1), rcond=None)
    sigma = np.sqrt(np.mean(noise**2, axis=1))

    def distance(p: FloatArray) -> FloatArray:
        return np.asarray((np.hypot(shifted[:, 0] - p[0], shifted[:, 1] - p[1]) - p[2]) / sigma)

    start = np.array([cx, cz, np.sqrt(max(rest + cx**2 + cz**2, 1e-12))])
    solution = least_squares(distance, start, x_scale="jac", loss="soft_l1", f_scale=SOFTNESS_STD, max_nfev=60)
    jacobian = np.asarray(solution.jac)
    variance = np.linalg.pinv(jacobian.T @ jacobian)[2, 2]
    return Arc(
        centre_m=middle + solution.x[:2], radius_m=float(solution.x[2]), radius_std_m=float(np.sqrt(max(variance, 0.0)))
    )


def fit_rotation(sway_m: FloatArray, std_m: FloatArray, angle_rad: FloatArray, angle_std_rad: FloatArray) -> Arc:
    """Fit the circle whose radius turns with the product's tag: r = d(x) / d(sin q).

    Parameters
    ----------
    sway_m, std_m : ndarray, shape (n, 2)
        x and z of PCP minus TCP and their standard errors; NaN is left out.
    angle_rad, angle_std_rad : ndarray, shape (n,)
        The tag's own rotation, from any constant zero, and its standard error.

    Returns
    -------
    Arc
        From (x, z) = c + r (sin(φ - φ0), -cos(φ - φ0)), which is linear in c, r cos φ0 and r sin φ0.

    Raises
    ------
    NotIdentifiableError
        With fewer than 12 samples that have both.

    Notes
    -----
    Holds for a tag that is rigid with the product, and for small errors of the angle: their variance shortens r by
    σ_φ² / var(φ), which is added to the standard error.
    """
    seen = np.isfinite(angle_rad) & np.isfinite(angle_std_rad)
    points, noise, phi, phi_std = _present(sway_m, std_m, angle_rad, angle_std_rad, keep=seen)
    sine, cosine, one, zero = np.sin(phi), np.cos(phi), np.ones_like(phi), np.zeros_like(phi)
    design = np.vstack([np.column_stack([one, zero, sine, -cosine]), np.column_stack([zero, one, -cosine, -sine])])
    target = points.T.ravel()
    weight = np.ones(len(target))
    for _ in range(8):
        p, *_ = np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)
        radius = float(np.hypot(p[2], p[3]))
        sigma = np.sqrt(noise**2 + (radius * phi_std[:, None]) ** 2).T.ravel()
        miss = (target - design @ p) / sigma
        weight = 1 / (sigma * (1 + (miss / SOFTNESS_STD) ** 2) ** 0.25)
    weighted = design * weight[:, None]
    covariance = np.linalg.pinv(weighted.T @ weighted)
    toward = np.array([0.0, 0.0, p[2], p[3]]) / max(radius, 1e-12)
    shortening = radius * float(np.mean(phi_std**2)) / max(float(np.var(phi)), 1e-12)
    std = float(np.hypot(np.sqrt(toward @ covariance @ toward), shortening))
    return Arc(centre_m=np.asarray(p[:2], dtype=float), radius_m=radius, radius_std_m=std)


def _present(
    sway: FloatArray, std: FloatArray, *more: FloatArray, keep: np.ndarray | bool = True
) -> tuple[FloatArray, ...]:
    """Return the arrays' samples that are all there."""
    good = np.all(np.isfinite(sway) & np.isfinite(std), axis=1) & keep
    if not np.count_nonzero(good) >= LEAST_SAMPLES:
        raise NotIdentifiableError(
            f"only {np.count_nonzero(good)} samples show both tags: at least {LEAST_SAMPLES} are needed for an arc",
            code="pendulum_not_determined",
        )
    return sway[good], std[good], *(values[good] for values in more)
