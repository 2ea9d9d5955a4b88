"""What a camera saw of a sway on an ellipse, and what of it is known from how it lifts."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from tagsway.modal.decay import ALPHA, COSINE, OMEGA, PLACES, SINE, SOFTENING, predict
from tagsway.modal.samples import DecayFit
from tagsway.modal.sway import Sway, remove_spikes
from tagsway.model import BoolArray, FloatArray

ACROSS_STD_RAD = 0.03
"""Of the amplitude across, in phase and out of it, where none is seen: payloads sway by two degrees to any side."""

COUPLING_STD = 0.1
"""Of the rate of turning, relative: whether the spring pulls along the arc or along each axis changes it by 12 %."""

DETUNING_STD = 0.02
"""Of the two frequencies, relative: a gripper is seldom as stiff in both directions."""

ANGLE_GAIN_STD = 0.005
"""Of the tag's rotation over the arc's: height and width of a picture are not scaled alike."""

STEP_RAD = 1.5
"""Of the sway's phase: the ellipse turns by less than a tenth of that."""

TRIES = 6
"""Steps from each start value; from the best of them, five times as many."""

MOST_SAMPLES = 300
"""That are fitted: with more, what the expansion leaves out would count for more than their noise."""

LARGEST_RAD = 0.8
"""Sway across, in phase and out of it, beyond which the expansion leaves its ground."""

RADII = (0.25, 4.0)
"""Of the circle, over that of the arc: what a search may try; beyond it the swing's angle means nothing."""

S0, V0, RADIUS, TURNED, GAIN, REAL, IMAGINARY, DETUNING, COUPLING = range(9)
"""Places of what is fitted: lengths over the arc's radius, rad, relative, C, relative to ω, relative."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What a camera saw of a sway, in units of the arc's radius, and the plane decay that was fitted to it.

    Parameters
    ----------
    time_s, s, v, std : ndarray, shape (n,)
        Times, places along the main axis and across it, and their standard errors.
    angle, angle_std : ndarray, shape (n,)
        The tag's rotation in rad; an infinite error where there is none.
    plane : ndarray, shape (n,)
        w, complex: the decay is its real part.
    square : ndarray, shape (2 k + 1,)
        |w|² at the steps of the slow factors and halfway between them.
    step_s : float
        Between these steps.
    omega : float
        ω_n in rad/s.
    gravity : float
        κ, gravity's share of ω_n².
    unit : float
        The arc's radius, in the track's length unit.
    steady : ndarray of bool, shape (n,)
        Which of the samples are no spikes.
    centre : tuple of float
        Of the sway's own circle, along the main axis and across it.
    side : float
        1 where the arc is below its centre, else -1.
    gain_std : float
        Of the tag's rotation over the arc's, whose mean is 1.
    """

    time_s: FloatArray
    s: FloatArray
    v: FloatArray
    std: FloatArray
    angle: FloatArray
    angle_std: FloatArray
    plane: FloatArray
    square: FloatArray
    step_s: float
    omega: float
    gravity: float
    unit: float
    steady: BoolArray
    centre: tuple[float, float]
    side: float
    gain_std: float = ANGLE_GAIN_STD

    @classmethod
    def of(cls, sway: Sway, time_s: FloatArray, fit: DecayFit) -> "Shown":
        """Return what a sway shows."""
        unit = 1 / sway.curvature
        omega = float(np.hypot(*fit.parameters[[OMEGA, ALPHA]]))
        size = float(np.hypot(*fit.parameters[[COSINE, SINE]])) / unit
        steps = max(8, int(np.ceil(omega * time_s[-1] / STEP_RAD)))
        halves = np.linspace(0.0, time_s[-1], 2 * steps + 1)
        along, across = sway.along / unit, sway.across / unit
        seen = np.isfinite(sway.angle_rad) & (sway.angle_std_rad > 0)
        noise = fit.scale / unit * sway.spread
        side, centre = _find_centre(along, across, sway.value / unit, noise)
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
            steady=(remove_spikes(along) == along) & (remove_spikes(across) == across),
            centre=centre,
            side=side,
        )

    def thinned(self) -> "Shown":
        """Return every k-th sample of it, without spikes."""
        steady = np.flatnonzero(self.steady)
        every = steady[:: max(1, -(-len(steady) // MOST_SAMPLES))]
        names = ("time_s", "s", "v", "std", "angle", "angle_std", "plane", "steady")
        return replace(self, **{name: getattr(self, name)[every] for name in names})

    def begin(self) -> FloatArray:
        """Return start values, shape (9,), without a sway across."""
        start = np.zeros(9)
        start[[RADIUS, GAIN, COUPLING]] = 1.0
        start[[S0, V0]] = self.centre
        start[TURNED] = float(np.median(self.angle - self.sign() * self.direction(start[:, None])[:, 0]))
        return start

    def sign(self) -> float:
        """Sign of the tag's rotation against the way along the arc."""
        return float(np.sign(np.dot(self.plane.real, self.angle - np.mean(self.angle))) or 1.0)

    def direction(self, p: FloatArray) -> FloatArray:
        """Return the angle at which the tag is seen from the circle's centre, shape (n, k), in rad."""
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
        """Return all residuals over their errors, shape (2 n + 3, k), for parameters of shape (9, k)."""
        y: FloatArray = np.zeros((len(self.s), 1))
        if np.any(p[REAL]) or np.any(p[IMAGINARY]):
            y = (self.factors(p)[1] * self.plane[:, None]).real
        distance = np.sqrt((self.s[:, None] - p[S0]) ** 2 + (self.v[:, None] - p[V0]) ** 2 + y**2) - p[RADIUS]
        turned = self.angle[:, None] - p[TURNED] - self.sign() * p[GAIN] * self.direction(p)
        known = np.stack(
            [
                (p[GAIN] - 1) / self.gain_std,
                p[DETUNING] / DETUNING_STD,
                (p[COUPLING] - 1) / COUPLING_STD,
            ]
        )
        return np.concatenate([distance / self.std[:, None], turned / self.angle_std[:, None], known])

    def slopes(self, p: FloatArray, *, twin: bool) -> FloatArray:
        """Return the derivatives of the misfits, shape (2 n + 3, 9); 0 for C's own, without the twin."""
        steps = np.where(np.arange(9) < (9 if twin else 5), 1e-6, 0.0)
        high, low = self.misfits(p[:, None] + np.diag(steps)), self.misfits(p[:, None] - np.diag(steps))
        return np.asarray((high - low) / 2e-6, dtype=float)

    def solve(self, start: FloatArray, *, twin: bool, tries: int = 5 * TRIES) -> FloatArray:
        """Return the parameters at the least cost; without the twin, C stays where it is."""
        most = np.full(9, np.inf)
        most[[REAL, IMAGINARY]], most[DETUNING], most[COUPLING] = self._largest(), 10 * DETUNING_STD, 2.0
        least = -most
        least[RADIUS], most[RADIUS] = RADII
        found = least_squares(
            lambda p: self.misfits(p[:, None])[:, 0],  # type: ignore[misc]
            start,
            lambda p: self.slopes(p, twin=twin),  # type: ignore[misc]
            loss="soft_l1",
            f_scale=1.5,
            bounds=(least, most),
            ftol=1e-6,
            max_nfev=tries,
        )
        return np.asarray(found.x, dtype=float)

    def _largest(self) -> float:
        return LARGEST_RAD / float(np.sqrt(self.square[0]))

    def cost(self, p: FloatArray) -> float:
        """Return twice the soft-L1 cost."""
        left = self.misfits(p[:, None])[:, 0]
        return float(np.sum(4.5 * (np.sqrt(1 + (left / 1.5) ** 2) - 1)))

    def look(self, plain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the lift tells of |C|², Re C² and Im C²: the information, shape (3, 3), and its pull."""
        left, rows = self.misfits(plain[:, None])[:, 0], self.slopes(plain, twin=False)[:, :5]
        lifts = self.small()[0] / 2 / self.std[:, None]
        return inform(rows, np.concatenate([lifts, np.zeros((len(rows) - len(lifts), 3))]), -left)

    def hint(self, plain: FloatArray) -> tuple[float, FloatArray]:
        """Return by how much a small sway across lowers the squares, and its |C|², Re C² and Im C²."""
        information, pull = self.look(plain)
        squares = np.linalg.pinv(information, rcond=1e-6, hermitian=True) @ pull
        return float(pull @ squares), squares

    def hide(self, *told: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return a root of the mean square of |C|², Re C² and Im C², where no sway across is seen, shape (3, 3).

        C is normal beforehand; what was told of its squares makes it less likely.
        """
        information, pull = (np.sum(one, axis=0) for one in zip(*told, strict=True))
        # Close about 0, where long records leave little.
        size = 4 * np.sinh(np.linspace(-9, 9, 181)) / np.sinh(9)
        real, imaginary = np.meshgrid(size, size)
        weight = np.multiply.outer(np.gradient(size), np.gradient(size)).ravel()
        c = (real + 1j * imaginary).ravel() * ACROSS_STD_RAD / np.sqrt(self.square[0])
        squares = np.stack([np.abs(c) ** 2, (c**2).real, (c**2).imag])
        cost = 0.5 * np.sum(squares * (information @ squares), axis=0) - pull @ squares
        cost += 0.5 * (real**2 + imaginary**2).ravel()
        weight = weight * np.exp(np.min(cost) - cost)
        values, axes = np.linalg.eigh(squares * weight @ squares.T / np.sum(weight))
        return np.asarray(axes * np.sqrt(np.maximum(values, 0.0)))

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

    def small(self) -> tuple[FloatArray, FloatArray]:
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

    def added(self, p: FloatArray) -> FloatArray:
        """Return what the sway across adds to the way, shape (n, k)."""
        return np.asarray(((self.factors(p)[0] - 1) * self.plane[:, None]).real, dtype=float)

    def without(self, p: FloatArray) -> FloatArray:
        """Return the way along the arc without it, shape (n, k)."""
        return np.asarray(p[RADIUS] * self.direction(p) - self.added(p), dtype=float)


def inform(rows: FloatArray, columns: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the information on the sizes of columns, and its pull, where the sizes of rows are free."""
    basis = np.linalg.qr(rows)[0]
    outside = columns - basis @ (basis.T @ columns)
    return outside.T @ outside, outside.T @ np.clip(left, -4, 4)


def _find_centre(s: FloatArray, v: FloatArray, way: FloatArray, noise: FloatArray) -> tuple[float, tuple[float, float]]:
    """Return the side on which the sway's own circle has its centre, and that centre, in units of its radius."""
    centres = {side: float(np.median(v + side * np.cos(way))) for side in (1.0, -1.0)}

    def misfit(side: float) -> float:
        # A spike counts no more than a few standard errors, the same on either side.
        return float(np.sum(np.minimum(np.abs(v + side * np.cos(way) - centres[side]) / noise, 6.0)))

    side = min(centres, key=misfit)
    return side, (float(np.median(s - np.sin(way))), centres[side])


def _plane_decay(time_s: FloatArray, fit: DecayFit) -> FloatArray:
    """Return w, of which the fit's first mode is the real part, but for its overtones."""
    terms = replace(fit.terms, further=0, slope=False, driven=False)
    rows = predict(time_s, fit.parameters[:PLACES], terms)[1]
    cosine, sine = fit.parameters[[COSINE, SINE]]
    z = complex(cosine, -sine)
    return np.asarray(z * (rows[:, COSINE] + 1j * rows[:, SINE]))
