"""A sway across the plane that is filmed, and what it does to the sway in it.

A payload that also sways towards the camera runs on an ellipse, and the ellipse turns. The camera sees the turning as a
damping and a frequency that are not the payload's: of the order of a third of the square of the sway across, in rad. Of
that sway it sees what it lifts, y² / 2 r, which comes twice a swing like the lift of the arc, but not in its phase.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from tagsway.modal.decay import ALPHA, COSINE, OMEGA, SINE, SOFTENING, predict
from tagsway.modal.samples import DecayFit
from tagsway.modal.sway import MAD_TO_STD, Sway
from tagsway.model import FloatArray

WORTH = 30.0
"""Fall of the squares, over the noise's, that a sway across must bring: its numbers do so by chance in one of 1e6."""

ACROSS_STD_RAD = 0.03
"""Of the amplitude across, in phase and out of it, where none is seen: payloads sway by two degrees to any side."""

COUPLING_STD = 0.1
"""Of the rate of turning, relative: whether the spring pulls along the arc or along each axis changes it by 12 %."""

DETUNING_STD = 0.02
"""Of the two frequencies, relative: a gripper is seldom as stiff in both directions."""

ANGLE_GAIN_STD = 0.005
"""Of the tag's rotation over the arc's: height and width of a picture are not scaled alike."""

LOOSE_GAIN_STD = 0.2
"""The same where the gripper bends or stretches: without a sway across, nothing forbids it."""

STEP_RAD = 1.5
"""Of the sway's phase: the ellipse turns by less than a tenth of that."""

TRIES = 6
"""Steps from each start value; from the best of them, five times as many."""

MOST_SAMPLES = 300
"""That are fitted."""

LARGEST_RAD = 0.8
"""Sway across, in phase and out of it, beyond which the expansion leaves its ground."""


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
        None where the path is straight: a small swing does not couple with another one.

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
    shown = _Shown.of(sway, time_s, fit)
    few = shown.thinned()
    plain = few.solve(few.begin(), twin=False)
    gain, lifts, _ = few.hint(plain)
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
            return shown.describe(best, few)
    _, lifts, covariance = loose.hint(plain)
    return Precession(
        seen=False,
        way=sway.value,
        added=np.zeros(len(time_s)),
        turned=np.zeros(len(time_s)),
        slopes=shown.unit * shown._small()[1] @ np.linalg.cholesky(covariance + np.outer(lifts, lifts)),
        curvature=sway.curvature,
        curvature_std=sway.curvature_std,
        across_rad=0.0,
        across_std_rad=ACROSS_STD_RAD,
    )


S0, V0, RADIUS, TURNED, GAIN, REAL, IMAGINARY, DETUNING, COUPLING = range(9)
"""Places of what is fitted: lengths over the arc's radius, rad, relative, C, relative to ω, relative."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown:
    """What a camera saw of a sway, in units of the arc's radius, and the plane decay that was fitted to it."""

    time_s: FloatArray
    s: FloatArray
    v: FloatArray
    std: FloatArray
    angle: FloatArray
    angle_std: FloatArray
    plane: FloatArray
    """w, complex."""
    square: FloatArray
    """q² at the steps of the slow factors and halfway between them, shape (2 k + 1,)."""
    step_s: float
    omega: float
    gravity: float
    unit: float
    gain_std: float = ANGLE_GAIN_STD

    @classmethod
    def of(cls, sway: Sway, time_s: FloatArray, fit: DecayFit) -> "_Shown":
        unit = 1 / sway.curvature
        omega = float(np.hypot(*fit.parameters[[OMEGA, ALPHA]]))
        size = float(np.hypot(*fit.parameters[[COSINE, SINE]])) / unit
        steps = max(8, int(np.ceil(omega * time_s[-1] / STEP_RAD)))
        halves = np.linspace(0.0, time_s[-1], 2 * steps + 1)
        along, across = sway.along / unit, sway.across / unit
        seen = np.isfinite(sway.angle_rad) & (sway.angle_std_rad > 0)
        noise = fit.scale / unit * sway.spread
        return cls(
            time_s=time_s,
            s=along,
            v=across,
            std=noise,
            angle=np.where(seen, sway.angle_rad, 0.0),
            angle_std=np.hypot(np.where(seen, sway.angle_std_rad, np.inf), noise),
            plane=_plane_decay(time_s, fit) / unit,
            square=np.abs(_plane_decay(halves, fit) / unit) ** 2,
            step_s=2 * float(halves[1]),
            omega=omega,
            gravity=float(np.clip(16 * fit.parameters[SOFTENING] / size**2, 0.0, 1.0)),
            unit=unit,
        )

    def thinned(self) -> "_Shown":
        every = slice(None, None, -(-len(self.time_s) // MOST_SAMPLES))
        names = ("time_s", "s", "v", "std", "angle", "angle_std", "plane")
        return replace(self, **{name: getattr(self, name)[every] for name in names})

    @property
    def side(self) -> float:
        """1 where the arc is below its centre, else -1."""
        lift = self.s - np.median(self.s)
        return float(np.sign(np.dot(lift**2 - np.mean(lift**2), self.v)) or 1.0)

    def begin(self) -> FloatArray:
        start = np.zeros(9)
        start[[RADIUS, GAIN, COUPLING]] = 1.0
        low = np.abs(self.s) < 0.3 * np.max(np.abs(self.s)) + 1e-9
        start[V0] = float(np.median(self.v[low])) + self.side
        start[TURNED] = float(np.median(self.angle - self._sign() * self._direction(start[:, None])[:, 0]))
        return start

    def _sign(self) -> float:
        """Sign of the tag's rotation against the way along the arc."""
        return float(np.sign(np.dot(self.s - np.mean(self.s), self.angle - np.mean(self.angle))) or 1.0)

    def _direction(self, p: FloatArray) -> FloatArray:
        return np.asarray(np.arctan2(self.s[:, None] - p[S0], self.side * (p[V0] - self.v[:, None])), dtype=float)

    def factors(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return A and C at the samples, complex, shape (n, k), for parameters of shape (9, k)."""
        c = p[REAL] + 1j * p[IMAGINARY]
        state = np.stack([np.ones_like(c), c])
        states = [state]
        turning = p[COUPLING] * self.omega * (1 / 3 + self.gravity / 24)
        detuned, soft = self.omega * p[DETUNING], self.omega * self.gravity / 16
        squares = self.square[:, None] / p[RADIUS] ** 2

        def slope(now: FloatArray, square: FloatArray) -> FloatArray:
            a, c = now
            turn = turning * square * (a * c.conj()).imag
            slow = soft * square * (np.abs(a) ** 2 + np.abs(c) ** 2 - 1)
            return np.stack([-1j * slow * a - turn * c, 1j * (detuned - slow) * c + turn * a])

        h = self.step_s
        for low, middle, high in zip(squares[:-2:2], squares[1:-1:2], squares[2::2], strict=True):
            one = slope(state, low)
            two = slope(state + h / 2 * one, middle)
            three = slope(state + h / 2 * two, middle)
            state = state + h / 6 * (one + 2 * two + 2 * three + slope(state + h * three, high))
            states.append(state)
        place = np.clip(self.time_s / h, 0, len(states) - 1)
        first = np.minimum(place.astype(int), len(states) - 2)
        share = (place - first)[:, None]
        every = np.array(states)
        a, c = ((1 - share) * every[first, k] + share * every[first + 1, k] for k in (0, 1))
        return a, c

    def misfits(self, p: FloatArray) -> FloatArray:
        """Return all residuals over their errors, shape (2 n + 4, k), for parameters of shape (9, k)."""
        y: FloatArray = np.zeros((len(self.s), 1))
        if np.any(p[REAL]) or np.any(p[IMAGINARY]):
            y = (self.factors(p)[1] * self.plane[:, None]).real
        distance = np.sqrt((self.s[:, None] - p[S0]) ** 2 + (self.v[:, None] - p[V0]) ** 2 + y**2) - p[RADIUS]
        turned = self.angle[:, None] - p[TURNED] - self._sign() * p[GAIN] * self._direction(p)
        known = np.stack(
            [
                (p[GAIN] - 1) / self.gain_std,
                p[DETUNING] / DETUNING_STD,
                (p[COUPLING] - 1) / COUPLING_STD,
            ]
        )
        return np.concatenate([distance / self.std[:, None], turned / self.angle_std[:, None], known])

    def slopes(self, p: FloatArray, *, twin: bool) -> FloatArray:
        steps = np.where(np.arange(9) < (9 if twin else 5), 1e-6, 0.0)
        high, low = self.misfits(p[:, None] + np.diag(steps)), self.misfits(p[:, None] - np.diag(steps))
        return np.asarray((high - low) / 2e-6, dtype=float)

    def solve(self, start: FloatArray, *, twin: bool, tries: int = 5 * TRIES) -> FloatArray:
        """Return the parameters at the least cost; without the twin, C stays where it is."""
        most = np.full(9, np.inf)
        most[[REAL, IMAGINARY]], most[DETUNING], most[COUPLING] = self._largest(), 10 * DETUNING_STD, 2.0
        found = least_squares(
            lambda p: self.misfits(p[:, None])[:, 0],  # type: ignore[misc]
            start,
            lambda p: self.slopes(p, twin=twin),  # type: ignore[misc]
            loss="soft_l1",
            f_scale=1.5,
            bounds=(-most, most),
            ftol=1e-6,
            max_nfev=tries,
        )
        return np.asarray(found.x, dtype=float)

    def _largest(self) -> float:
        return LARGEST_RAD / float(np.sqrt(self.square[0]))

    def cost(self, p: FloatArray) -> float:
        left = self.misfits(p[:, None])[:, 0]
        return float(np.sum(4.5 * (np.sqrt(1 + (left / 1.5) ** 2) - 1)))

    def hint(self, plain: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return by how much a small sway across lowers the squares; |C|², Re C² and Im C²; and their covariance."""
        left, rows = self.misfits(plain[:, None])[:, 0], self.slopes(plain, twin=False)[:, :5]
        lifts = self._small()[0] / 2 / self.std[:, None]
        lifts = np.concatenate([lifts, np.zeros((len(rows) - len(lifts), 3))])
        basis = np.linalg.qr(rows)[0]
        left = np.clip(left, -4, 4)
        outside = lifts - basis @ (basis.T @ lifts)
        size = np.linalg.lstsq(outside, -left, rcond=1e-3)[0]
        likely = 2 * ACROSS_STD_RAD**2 / self.square[0]
        covariance = np.linalg.inv(outside.T @ outside + np.eye(3) / likely**2)
        return float(np.sum((outside @ size) ** 2)), -covariance @ outside.T @ left, covariance

    def starts(self, plain: FloatArray, lifts: FloatArray) -> list[FloatArray]:
        """Return start values: what a small sway across would be, and others of its size."""
        hint = np.sqrt(complex(lifts[1], lifts[2]) or 1e-4)
        hint /= max(1.0, 2 * abs(hint) / self._largest())
        starts = []
        for turn in (1.0, np.exp(0.25j * np.pi), 1j, np.exp(0.75j * np.pi)):
            start = plain.copy()
            start[[REAL, IMAGINARY]] = (hint * turn).real, (hint * turn).imag
            starts.append(start)
        return starts

    def _small(self) -> tuple[FloatArray, FloatArray]:
        """Return y² and what the way gains while C is small, by |C|², Re C² and Im C², shape (n, 3) each.

        Then C turns to C - G Im C and A to 1 + G C Im C - (G Im C)² / 2, with G = g ∫q².
        """
        cells = self.step_s / 6 * (self.square[:-2:2] + 4 * self.square[1:-1:2] + self.square[2::2])
        edges = self.step_s * np.arange(len(cells) + 1)
        whole = self.omega * np.interp(self.time_s, edges, np.append(0.0, np.cumsum(cells)))[:, None]
        turn = whole * (1 / 3 + self.gravity / 24)
        size, real, imaginary = np.eye(3)
        of_both, of_imaginary = imaginary / 2 + 0.5j * (size - real), (size - real) / 2
        of_size = size - turn * imaginary + turn**2 * of_imaginary
        of_square = real + 1j * imaginary - 2 * turn * of_both + turn**2 * of_imaginary
        w = self.plane[:, None]
        lifts = (np.abs(w) ** 2 * of_size + (w**2 * of_square).real) / 2
        gained = turn * of_both - turn**2 / 2 * of_imaginary - 1j * whole * self.gravity / 16 * size
        return np.asarray(lifts), np.asarray((gained * w).real)

    def describe(self, p: FloatArray, few: "_Shown") -> Precession:
        rows = few.slopes(p, twin=True)
        left = few.misfits(p[:, None])[:, 0]
        scale = max(1.0, MAD_TO_STD * float(np.median(np.abs(left[: len(few.s)]))))
        unit = np.linalg.norm(rows, axis=0)
        unit[unit == 0] = 1.0
        covariance = np.linalg.pinv((rows / unit).T @ (rows / unit) / scale**2, rcond=1e-12) / np.outer(unit, unit)
        size, axes = np.linalg.eigh(covariance)
        spread = axes * np.sqrt(np.maximum(size, 0.0))
        share = 1e-3 / np.max(np.abs(spread))
        high, low = (self.without(p[:, None] + sign * share * spread) for sign in (1, -1))
        added = self.added(p[:, None])[:, 0]
        c, c_cov = p[[REAL, IMAGINARY]], covariance[REAL : IMAGINARY + 1, REAL : IMAGINARY + 1]
        across = float(np.hypot(*c))
        start = float(np.sqrt(self.square[0])) / p[RADIUS]
        return Precession(
            seen=True,
            way=self.unit * p[RADIUS] * self._direction(p[:, None])[:, 0],
            added=self.unit * added,
            turned=self._sign() * p[GAIN] / p[RADIUS] * added,
            slopes=self.unit * (high - low) / (2 * share),
            curvature=1 / (p[RADIUS] * self.unit),
            curvature_std=float(np.sqrt(covariance[RADIUS, RADIUS])) / p[RADIUS] ** 2 / self.unit,
            across_rad=across * start,
            across_std_rad=float(np.sqrt(c @ c_cov @ c)) / max(across, 1e-12) * start,
        )

    def added(self, p: FloatArray) -> FloatArray:
        """Return what the sway across adds to the way, shape (n, k)."""
        return np.asarray(((self.factors(p)[0] - 1) * self.plane[:, None]).real, dtype=float)

    def without(self, p: FloatArray) -> FloatArray:
        """Return the way along the arc without it, shape (n, k)."""
        return np.asarray(p[RADIUS] * self._direction(p) - self.added(p), dtype=float)


def _plane_decay(time_s: FloatArray, fit: DecayFit) -> FloatArray:
    """Return w, of which the fit's first mode is the real part, but for its overtones."""
    terms = replace(fit.terms, further=0, slope=False, driven=False)
    rows = predict(time_s, fit.parameters[:10], terms)[1]
    cosine, sine = fit.parameters[[COSINE, SINE]]
    z = complex(cosine, -sine)
    return np.asarray(z * (rows[:, COSINE] + 1j * rows[:, SINE]))
