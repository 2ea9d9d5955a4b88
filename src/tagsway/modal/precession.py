"""A sway across the plane that is filmed, and what it does to the sway in it.

A payload that also sways towards the camera runs on an ellipse, and the ellipse turns. The camera sees the turning as a
damping and a frequency that are not the payload's: of the order of a third of the square of the sway across, in rad. Of
that sway it sees what it lifts, y² / 2 r, which comes twice a swing like the lift of the arc, but not in its phase.
"""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.modal.decay import predict
from tagsway.modal.ellipse import ACROSS_STD_RAD, GAIN, IMAGINARY, RADIUS, REAL, TRIES, Shown, inform
from tagsway.modal.samples import DecayFit
from tagsway.modal.sway import MAD_TO_STD, Sway
from tagsway.model import FloatArray

WORTH = 30.0
"""Fall of the squares, over the noise's, that a sway across must bring: its numbers do so by chance in one of 1e6."""

CIRCLE = (0.5, 2.0)
"""Of the sway's own radius, between which a circle without a sway across must lie: beyond, the fit went astray."""

LOOSE_GAIN_STD = 0.2
"""Of the tag's rotation over the arc's, where the gripper bends or stretches: without a sway across, it may well."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Precession:
    """A sway across the plane.

    Parameters
    ----------
    seen : bool
        Whether it is seen; else the way is the sway's own value, and no more is known than how large it may be.
    way, added : ndarray, shape (n,)
        Way along the arc, now that its circle is known, and what of it the turning ellipse adds.
    turned : ndarray, shape (n,)
        The same of the tag's rotation, in rad.
    slopes : ndarray, shape (n, k)
        What one standard error of each thing that is uncertain does to the way without it.
    curvature, curvature_std : float
        Of the arc, in 1 / length unit.
    across_rad, across_std_rad : float
        Amplitude of the sway across at the window's start.
    """

    seen: bool
    way: FloatArray
    added: FloatArray
    turned: FloatArray
    slopes: FloatArray
    curvature: float
    curvature_std: float
    across_rad: float
    across_std_rad: float

    def clear(self, sway: Sway) -> Sway:
        """Return the sway as it would be without the one across."""
        return replace(
            sway,
            value=self.way - self.added,
            angle_rad=sway.angle_rad - self.turned,
            common=self.slopes,
            curvature=self.curvature,
            curvature_std=self.curvature_std,
        )


def find_precession(sway: Sway, time_s: FloatArray, fit: DecayFit) -> Precession | None:
    """Find a sway across the plane by what it lifts.

    Parameters
    ----------
    sway : Sway
        As it was measured.
    time_s : ndarray, shape (n,)
        Of its samples, from the window's start.
    fit : DecayFit
        Of the sway in the plane.

    Returns
    -------
    Precession or None
        None where the path is straight, as a small swing does not couple with another one, or where its circle is lost.

    Notes
    -----
    With x and y the two parts of the sway, (s - s0)² + (v - v0)² + y² = r² for the tag's place (s, v) in the picture,
    and y = Re C w, x = Re A w with w the decay of a plane swing. The two slow factors turn and fall back as the normal
    form of a spherical pendulum has it [1]_, q² the square of the swing in rad and κ gravity's share of ω_n²:

        A' = -i s A - g L C,   C' = i (Δ - s) C + g L A,   L = q² Im A C*,
        s = ω κ q² (|A|² + |C|² - 1) / 16,   g = ω (1/3 + κ/24)

    The tag's rotation tells r, and so y² apart from the arc's own lift. Do not use it for a tag that is loose.

    References
    ----------
    .. [1] M. G. Olsson, Am. J. Phys. 46 (1978) 1118-1119: of a spherical pendulum's ellipse, Ω = 3/8 ω a c.
    """
    if not (sway.planar and sway.curvature > 0 and not sway.angular):
        return None
    shown = Shown.of(sway, time_s, fit)
    few = shown.thinned()
    plain = few.solve(few.begin(), twin=False)
    if not CIRCLE[0] < plain[RADIUS] < CIRCLE[1]:
        return None
    gain, lifts = few.hint(plain)
    loose = replace(few, gain_std=LOOSE_GAIN_STD)
    plain = loose.solve(plain, twin=False)
    if gain > WORTH:
        found = [few.solve(start, twin=True, tries=TRIES) for start in few.starts(plain, lifts)]
        best = few.solve(min(found, key=few.cost), twin=True)
        other = loose.solve(best, twin=True)
        # A tag that turns more or less than its arc, on a gripper that gives way, is no sway across.
        if few.cost(best) - loose.cost(other) > WORTH:
            best, few = other, loose
        if loose.cost(plain) - few.cost(best) > WORTH:
            return _describe(shown, few, best)
    hidden = shown.unit * shown.small()[1]
    return Precession(
        seen=False,
        way=sway.value,
        added=np.zeros(len(time_s)),
        turned=np.zeros(len(time_s)),
        slopes=hidden @ shown.hide(loose.look(plain), _look_along(sway, time_s, fit, hidden)),
        curvature=sway.curvature,
        curvature_std=sway.curvature_std,
        across_rad=0.0,
        across_std_rad=ACROSS_STD_RAD,
    )


def _describe(shown: Shown, few: Shown, p: FloatArray) -> Precession:
    """Return the sway across that was fitted, and what it adds at all samples."""
    rows = few.slopes(p, twin=True)
    left = few.misfits(p[:, None])[:, 0]
    scale = max(1.0, MAD_TO_STD * float(np.median(np.abs(left[: len(few.s)]))))
    unit = np.linalg.norm(rows, axis=0)
    unit[unit == 0] = 1.0
    covariance = np.linalg.pinv((rows / unit).T @ (rows / unit) / scale**2, rcond=1e-12) / np.outer(unit, unit)
    size, axes = np.linalg.eigh(covariance)
    spread = axes * np.sqrt(np.maximum(size, 0.0))
    share = 1e-3 / np.max(np.abs(spread))
    high, low = (shown.without(p[:, None] + sign * share * spread) for sign in (1, -1))
    added = shown.added(p[:, None])[:, 0]
    c, c_cov = p[[REAL, IMAGINARY]], covariance[REAL : IMAGINARY + 1, REAL : IMAGINARY + 1]
    across = float(np.hypot(*c))
    start = float(np.sqrt(shown.square[0])) / p[RADIUS]
    return Precession(
        seen=True,
        way=shown.unit * p[RADIUS] * shown.direction(p[:, None])[:, 0],
        added=shown.unit * added,
        turned=shown.sign() * p[GAIN] / p[RADIUS] * added,
        slopes=shown.unit * (high - low) / (2 * share),
        curvature=1 / (p[RADIUS] * shown.unit),
        curvature_std=float(np.sqrt(covariance[RADIUS, RADIUS])) / p[RADIUS] ** 2 / shown.unit,
        across_rad=across * start,
        across_std_rad=float(np.sqrt(c @ c_cov @ c)) / max(across, 1e-12) * start,
    )


def _look_along(sway: Sway, time_s: FloatArray, fit: DecayFit, added: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what the sway's own course tells of what is added to it: of that which the decay cannot take up."""
    value, every = predict(time_s, fit.parameters, fit.terms, sway.drive)
    noise = fit.scale * np.sqrt(max(fit.inflation, 1.0)) * sway.spread
    return inform(every[:, fit.terms.free] / noise[:, None], added / noise[:, None], (sway.value - value) / noise)
