"""The free decay of a pendulum: frequency and damping that depend on the amplitude, in closed form.

With E the amplitude over that at t = 0,

    E' = -α E - β E² (1 - 0.35 σ E²) - γ (1 + 5/12 σ E²)    viscous damping, drag and Coulomb friction
    θ' = ω_d (1 - σ E² - ... - retarding(E))                softening, and what damping does to the frequency
    u  = Re w (1 + p σ E² + ...) + Re |Z| (w / |w|)³ (h σ E³ + ...) + drift + v + further modes,      w = Z E e^{iθ}

where σ is the fraction by which the frequency is lower at t = 0 than for a small swing, to first order. The constants
follow from the action, which decays as e^{-2αt}: p = 1/2 and h = -1/12 for the arc r q, whatever spring helps gravity.
The projection r sin q takes q0²/8 from p σ and q0²/24 from h σ, which is 2 σ and 2/3 σ under gravity alone. Drag and
friction change the frequency in the second order only, by what averaging to that order gives [1]_. v is what the
measured motion of the point of suspension adds, and each further mode is a linear decay with a pole of its own.

References
----------
.. [1] N. N. Bogoliubov and Y. A. Mitropolsky, Asymptotic Methods in the Theory of Non-Linear Oscillations (1961), §2.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from tagsway.model import FloatArray

ARC = np.array([[0.5, 0.0, 1.0426, -0.0207, 0.0], [-1 / 12, 0.0, -0.268, 0.00516, 0.0]])
PROJECTION = np.array([[0.5, -1 / 8, 1.0426, -0.1978, 1 / 192], [-1 / 12, -1 / 24, -0.268, -0.0365, 1 / 384]])
"""What σ, q0², σ², σ q0² and q0⁴ add to the first mode, and to its overtone."""

_NODES = np.array([-1.0, 1.0]) / np.sqrt(12) + 0.5
"""Gauss', of a step: half of its length is the weight of each."""

STEEPEST = 0.3
"""Friction's loss over the amplitude, over ω_d, up to which the second order is one: just before it ends the motion."""

WIDEST = 30.0
"""Relative amplitude, and square of a swing in rad, beyond which nothing is fitted: the expansion ends there."""

OMEGA, ALPHA, COSINE, SINE, OFFSET, SOFTENING, DRAG, SLOPE, FRICTION, GAIN, SQUARE = range(11)
"""Places of the parameters: rad/s, 1/s, length, length, length, 1, 1/s, length/s, 1/s, 1, rad².

Each further mode has four more behind them: rad/s, 1/s, length, length.
"""

PLACES = 11
"""How many parameters a single mode has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What a decay is made of, beside ω_d, α, an amplitude, a phase and an offset.

    `curvature` is that of the path, in 1 / length: the swing in radians is the amplitude times it. At 0 it is taken
    from the softening, as if nothing but gravity pulled, unless its `square` is a parameter of its own: the overtone of
    a projection tells it.
    """

    softening: bool = False
    drag: bool = False
    slope: bool = False
    friction: bool = False
    driven: bool = False
    square: bool = False
    further: int = 0
    projected: bool = False
    curvature: float = 0.0

    @property
    def free(self) -> list[int]:
        """Places of the parameters that are fitted."""
        extra = (
            (self.softening, SOFTENING),
            (self.drag, DRAG),
            (self.slope, SLOPE),
            (self.friction, FRICTION),
            (self.driven, GAIN),
            (self.square, SQUARE),
        )
        single = [OMEGA, ALPHA, COSINE, SINE, OFFSET, *(place for used, place in extra if used)]
        return single + list(range(PLACES, PLACES + 4 * self.further))

    def with_place(self, place: int) -> Self:
        """Return the terms with the one whose parameter is at this place."""
        return replace(
            self,
            softening=self.softening or place == SOFTENING,
            drag=self.drag or place == DRAG,
            slope=self.slope or place == SLOPE,
            friction=self.friction or place == FRICTION,
            driven=self.driven or place == GAIN,
            square=self.square or place == SQUARE,
        )

    def without_place(self, place: int) -> Self:
        """Return the terms without the one whose parameter is at this place."""
        return replace(
            self,
            softening=self.softening and place != SOFTENING,
            drag=self.drag and place != DRAG,
            slope=self.slope and place != SLOPE,
            friction=self.friction and place != FRICTION,
            driven=self.driven and place != GAIN,
            square=self.square and place != SQUARE,
        )

    @property
    def shared(self) -> list[int]:
        """Places of the free parameters that belong to the vibration, whatever is measured of it."""
        own = {COSINE, SINE, OFFSET, SLOPE, GAIN, SQUARE}
        return [k for k in self.free if k not in own and (k < PLACES or (k - PLACES) % 4 < 2)]


def envelope(
    time_s: FloatArray, alpha: float, drag: float, friction: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return E and its derivatives by α, β and γ.

    Parameters
    ----------
    time_s : ndarray, any shape
        From the start.
    alpha, drag, friction : float
        α, β and γ in 1/s.

    Returns
    -------
    tuple of ndarray
        E, and ∂E/∂α, ∂E/∂β and ∂E/∂γ in s. Friction ends the motion: E is 0 from then on.

    Notes
    -----
    With d² = α² - 4 β γ, C = cosh(d t / 2) and S = sinh(d t / 2) / d, E = (C - (α + 2 γ) S) / (C + (α + 2 β) S).
    """
    square = alpha**2 - 4 * drag * friction
    c, s, bent = _hyperbolic(time_s, square)
    above, below = c - (alpha + 2 * friction) * s, np.maximum(c + (alpha + 2 * drag) * s, 1e-6 * np.abs(c) + 1e-300)
    value = above / below
    # Both C and S depend on d² alone: ∂C/∂d² = t S / 4.
    rise = (0.25 * time_s * s - (alpha + 2 * friction) * bent) - value * (0.25 * time_s * s + (alpha + 2 * drag) * bent)
    by_alpha = (2 * alpha * rise - s - value * s) / below
    by_drag = (-4 * friction * rise - 2 * value * s) / below
    by_friction = (-4 * drag * rise - 2 * s) / below
    moving = value > 0
    return tuple(np.where(moving, x, 0.0) for x in (value, by_alpha, by_drag, by_friction))  # type: ignore[return-value]


def _hyperbolic(time_s: FloatArray, square: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return cosh(d t/2), sinh(d t/2) / d and the latter's derivative by d², of d²; all are smooth through d = 0."""
    root = np.sqrt(abs(square))
    x = np.clip(0.5 * root * time_s, -150.0, 150.0)
    c, s = (np.cosh(x), np.sinh(x)) if square >= 0 else (np.cos(x), np.sin(x))
    half = 0.5 * time_s
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, square)
    over = np.where(small, half * (1 + square * half**2 / 6), s / (root or 1.0))
    bent = np.where(small, half**3 / 6 * (1 + square * half**2 / 10), 0.5 * (half * c - over) / safe)
    return c, over, bent


def predict(
    time_s: FloatArray, p: FloatArray, terms: Terms, drive: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the decay and its derivatives by all parameters.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        From the start, rising, not negative.
    p : ndarray, shape (11 + 4 k,)
        Parameters in the order of this module's places; k further modes.
    terms : Terms
        Its shape; a term that is not used has its parameter at 0.
    drive : ndarray, shape (n,), optional
        Position of the point of suspension at these times.

    Returns
    -------
    value : ndarray, shape (n,)
    jacobian : ndarray, shape (n, 11 + 4 k)
    """
    jacobian = np.zeros((len(time_s), len(p)))
    if terms.softening or terms.drag or terms.friction or terms.square:
        total = _add_swing(time_s, p, terms, jacobian)
    else:
        first, rows = [OMEGA, ALPHA, COSINE, SINE], np.empty((len(time_s), 4))
        total = _add_mode(time_s, p[first], rows)
        jacobian[:, first] = rows
    jacobian[:, OFFSET] = 1.0
    jacobian[:, SLOPE] = time_s
    total = total + p[OFFSET] + p[SLOPE] * time_s
    if drive is not None:
        swung, by_omega, by_rate = respond(time_s, drive, p[OMEGA], p[ALPHA])
        total += p[GAIN] * swung
        jacobian[:, GAIN] = swung
        jacobian[:, OMEGA] += p[GAIN] * by_omega
        jacobian[:, ALPHA] += p[GAIN] * by_rate
    for k in range(PLACES, len(p), 4):
        total += _add_mode(time_s, p[k : k + 4], jacobian[:, k : k + 4])
    return total, jacobian


def _add_swing(time_s: FloatArray, p: FloatArray, terms: Terms, jacobian: FloatArray) -> FloatArray:
    """Return the first mode, whose frequency and damping depend on its amplitude, and write its derivatives.

    u = Re F(Z, E, θ), of which those by E that a softening's part in the drag makes are left out.
    """
    omega, alpha, drag, friction = p[[OMEGA, ALPHA, DRAG, FRICTION]]
    value, by_alpha, by_drag, by_friction = envelope(time_s, alpha, drag, friction)
    soft, angle = _swing_size(p, terms)
    lag = _find_lag(time_s, p, soft, angle)
    moving = value > 0
    value = np.minimum(value - (alpha * value + drag * value**2 + friction * moving) * lag[6], WIDEST)
    z = complex(p[COSINE], -p[SINE])
    size = max(abs(z), 1e-300)
    turn = np.exp(1j * omega * (time_s - lag[0]))
    shape = PROJECTION if terms.projected else ARC
    (bulge, overtone), (bulge_2, overtone_2) = (
        shape[:, :2] @ [soft, angle],
        shape[:, 2:] @ [soft**2, soft * angle, angle**2],
    )
    square = value**2
    triple = size * (z / size * turn) ** 3
    squares = moving * (drag * square / 20 - friction / 12) / omega
    w = z * value * turn
    cube = triple * (overtone * value**3 + overtone_2 * value**5 - 1j * squares)
    along = w * (1 + bulge * square + bulge_2 * square**2) + 3 * cube
    by_value = (z * turn * (1 + 3 * bulge * square + 5 * bulge_2 * square**2)).real
    by_value += (triple * (3 * overtone * square + 5 * overtone_2 * square**2 - 0.1j * drag * value / omega)).real
    turned = -along.imag
    jacobian[:, OMEGA] = turned * (time_s - lag[0] + 2 * lag[1]) - triple.imag * squares / omega
    for place, by, late in ((ALPHA, by_alpha, lag[2]), (DRAG, by_drag, lag[3]), (FRICTION, by_friction, lag[4])):
        jacobian[:, place] = by_value * by - turned * omega * late
    jacobian[:, DRAG] += triple.imag * square / (20 * omega)
    jacobian[:, FRICTION] -= triple.imag * moving / (12 * omega)
    by_size = np.stack([(square * w).real, (value**3 * triple).real, (square**2 * w).real, (value**5 * triple).real])
    by_soft = [*shape[:, 0], *shape[:, 2:] @ [2 * soft, angle, 0.0]] @ by_size - turned * omega * lag[5]
    by_angle = [*shape[:, 1], *shape[:, 2:] @ [0.0, soft, 2 * angle]] @ by_size
    jacobian[:, SOFTENING] = by_soft + (0.0 if terms.curvature > 0 or terms.square else 16 * by_angle)
    jacobian[:, SQUARE] = by_angle
    by_z = along / z if z else turn * value
    jacobian[:, COSINE] = by_z.real - 2 * cube.real * z.real / size**2
    jacobian[:, SINE] = by_z.imag + 2 * cube.real * z.imag / size**2
    return np.asarray((along - 2 * cube).real, dtype=float)


def _add_mode(time_s: FloatArray, p: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return a linear mode, and write its derivatives into `jacobian`."""
    turn = np.exp(np.clip(-p[1] * time_s, -300, 30) + 1j * p[0] * time_s)
    w = complex(p[2], -p[3]) * turn
    jacobian[:, 0], jacobian[:, 1] = -time_s * w.imag, -time_s * w.real
    jacobian[:, 2], jacobian[:, 3] = turn.real, turn.imag
    return np.asarray(w.real, dtype=float)


def respond(
    time_s: FloatArray, drive: FloatArray, omega: float, alpha: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what a moving suspension adds to the sway, and its derivatives by ω_d and α.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Rising; gaps are bridged by straight lines.
    drive : ndarray, shape (n,)
        X, its position along the axis of the sway.
    omega, alpha : float
        The pole λ = -α + i ω_d.

    Returns
    -------
    tuple of ndarray
        v in the unit of the drive, ∂v/∂ω_d and ∂v/∂α.

    Notes
    -----
    v'' + 2 α v' + ω_n² v = -X'' without any derivative of what was measured:
    v = -X + 2 Re R ∫ e^{λ(t-τ)} X dτ with R = -λ² / (2 i ω_d).
    """
    pole, steps = complex(-alpha, omega), np.diff(time_s)
    back = np.exp(np.clip(alpha * time_s, -30, 300) - 1j * omega * time_s)
    inside = back * drive
    both = np.stack([inside, time_s * inside])
    whole, moment = np.concatenate(
        [np.zeros((2, 1)), np.cumsum(0.5 * (both[:, 1:] + both[:, :-1]) * steps, axis=1)], axis=1
    )
    residue, slope = 0.5j * pole**2 / omega, 1j * pole / omega
    swung, later = whole / back, (time_s * whole - moment) / back
    by_pole = 2 * (slope * swung + residue * later)
    return (
        -drive + 2 * (residue * swung).real,
        (1j * by_pole).real - 2 * (residue * swung).real / omega,
        -by_pole.real,
    )


def _swing_size(p: FloatArray, terms: Terms) -> tuple[float, float]:
    """Return σ, kept where the expansion may say something, and q0², the first amplitude's angle squared, in rad²."""
    soft = float(np.clip(p[SOFTENING], -1.0, 1.0))
    if terms.square:
        return soft, float(np.clip(p[SQUARE], -WIDEST, WIDEST))
    if terms.curvature > 0:
        return soft, min(terms.curvature**2 * float(p[COSINE] ** 2 + p[SINE] ** 2), WIDEST)
    return soft, 16 * soft


def slowed_by(p: FloatArray, terms: Terms, square: float) -> tuple[float, float]:
    """Return by which fraction a swing of E² is slower than a small one, and its derivative by σ."""
    slowed, _, by_soft = _soften(np.array(square), *_swing_size(p, terms))
    return float(slowed), float(by_soft)


def _soften(square: FloatArray, soft: float, angle: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return by which fraction a swing is slower than a small one, and its derivatives by E² and by σ.

    Parameters
    ----------
    square : ndarray
        E².
    soft : float
        σ, which is κ q0² / 16 for a share κ of gravity in ω_n².
    angle : float
        q0² in rad², which is held.

    Returns
    -------
    tuple of ndarray

    Notes
    -----
    1 - ω(I) / ω_n of H = p²/2 + (1 - κ) q²/2 + κ (1 - cos q) in powers of the action I = q0² E² / 2, to the third.
    """
    x = square
    second = 17 / 12 * soft**2 - soft * angle / 24
    third = 3.472 * soft**3 - 0.1528 * soft**2 * angle + 8.68e-4 * soft * angle**2
    by_soft = x + x**2 * (17 / 6 * soft - angle / 24)
    by_soft = by_soft + x**3 * (10.416 * soft**2 - 0.3056 * soft * angle + 8.68e-4 * angle**2)
    return soft * x + second * x**2 + third * x**3, soft + 2 * second * x + 3 * third * x**2, by_soft


def _find_lag(time_s: FloatArray, p: FloatArray, soft: float, angle: float) -> FloatArray:
    """Return ∫(softening + retarding), the latter alone, and the whole's by α, β, γ and σ; shape (7, n), in s.

    Averaged to the second order, drag and friction retard by
    (3/2 (α + γ/E) γ/E + α β E / 2 + 2 β γ / 3 + 0.0919 β² E²) / ω². The last row is by how much sooner, in s, the plain
    envelope has its amplitude than the one of which a softening changes the drag: E' solves the equation of its change.
    """
    omega, alpha, drag, friction = abs(p[OMEGA]), *p[[ALPHA, DRAG, FRICTION]]
    steps = np.diff(time_s, prepend=0.0)
    value, *slopes = envelope((time_s - steps)[:, None] + steps[:, None] * _NODES, alpha, drag, friction)
    low = STEEPEST * value * omega < abs(friction)
    over = np.where(low, 0.0, 1 / np.maximum(value, 1e-6))
    loss = np.where(low, np.sign(friction) * STEEPEST * omega, friction * over)
    rate = alpha * value + drag * value**2 + friction
    changed = soft * value**2 * (5 / 12 * friction - 0.35 * drag * value**2)
    late = np.where(low, 0.0, changed / np.where(np.abs(rate) > 1e-9 * omega, rate, np.inf)).mean(axis=1) * steps
    whole = np.cumsum(late)
    bent = value - rate * ((whole - late)[:, None] + late[:, None] * _NODES)
    slowed, by_square, by_soft = _soften(np.minimum(bent, WIDEST) ** 2, soft, angle)
    retard = 1.5 * (alpha + loss) * loss + drag * (0.5 * alpha * value + friction / 1.5 + 0.0919 * drag * value**2)
    by_value = -1.5 * (alpha + 2 * loss) * loss * over + drag * (0.5 * alpha + 0.1838 * drag * value)
    direct = (
        1.5 * loss + 0.5 * drag * value,
        0.5 * alpha * value + friction / 1.5 + 0.1838 * drag * value**2,
        1.5 * (alpha + 2 * loss) * over + drag / 1.5,
    )
    by_value = 2 * value * by_square + by_value / omega**2
    rows = [slowed + retard / omega**2, retard / omega**2]
    rows += [by_value * slope + one / omega**2 for slope, one in zip(slopes, direct, strict=True)]
    return np.vstack([np.cumsum(np.stack([*rows, by_soft]).mean(axis=2) * steps, axis=1), whole])
