"""The free decay of a pendulum: frequency and damping that depend on the amplitude, in closed form.

With E the amplitude over that at t = 0,

    E' = -α E - β E² - γ                                    viscous damping, drag and Coulomb friction
    θ' = ω_d (1 - σ E² - ¾ σ² E⁴)                           softening
    u  = Re w (1 + p σ E² + s σ² E⁴) + h σ Re w³ / |Z|² + drift + v + further modes,      w = Z E e^{iθ}

where σ is the fraction by which the frequency is lower at t = 0 than for a small swing. The constants follow from the
action, which decays as e^{-2αt}: p = 1/2, s = 0.7, h = -1/12 for the arc r q, whatever spring helps gravity;
p = -3/2, s = -0.77, h = -3/4 for the projection r sin q under gravity alone. v is what the measured motion of the
point of suspension adds, and each further mode is a linear decay with a pole of its own.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from tagsway.model import FloatArray

ARC = (0.5, 0.7, -1 / 12)
PROJECTION = (-1.5, -0.77, -0.75)

_NODES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)]) / 2 + 0.5
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18

OMEGA, ALPHA, COSINE, SINE, OFFSET, SOFTENING, DRAG, SLOPE, FRICTION, GAIN = range(10)
"""Places of the parameters: rad/s, 1/s, length, length, length, 1, 1/s, length/s, 1/s, 1.

Each further mode has four more behind them: rad/s, 1/s, length, length.
"""

PLACES = 10
"""How many parameters a single mode has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What a decay is made of, beside ω_d, α, an amplitude, a phase and an offset."""

    softening: bool = False
    drag: bool = False
    slope: bool = False
    friction: bool = False
    driven: bool = False
    further: int = 0
    shape: tuple[float, float, float] = ARC

    @property
    def free(self) -> list[int]:
        """Places of the parameters that are fitted."""
        extra = (
            (self.softening, SOFTENING),
            (self.drag, DRAG),
            (self.slope, SLOPE),
            (self.friction, FRICTION),
            (self.driven, GAIN),
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
        )

    @property
    def shared(self) -> list[int]:
        """Places of the free parameters that belong to the vibration, whatever is measured of it."""
        own = {COSINE, SINE, OFFSET, SLOPE, GAIN}
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
    p : ndarray, shape (10 + 4 k,)
        Parameters in the order of this module's places; k further modes.
    terms : Terms
        Its shape; a term that is not used has its parameter at 0.
    drive : ndarray, shape (n,), optional
        Position of the point of suspension at these times.

    Returns
    -------
    value : ndarray, shape (n,)
    jacobian : ndarray, shape (n, 10 + 4 k)
    """
    value, by_alpha, by_drag, by_friction = envelope(time_s, p[ALPHA], p[DRAG], p[FRICTION])
    omega, soft = p[OMEGA], p[SOFTENING]
    slowed = np.zeros((4, 2, len(time_s)))
    if terms.softening:
        slowed = _integrals(time_s, p[ALPHA], p[DRAG], p[FRICTION])
    lag, second = soft * slowed[:, 0] + 0.75 * soft**2 * slowed[:, 1], slowed[0, 0] + 1.5 * soft * slowed[0, 1]
    z = complex(p[COSINE], -p[SINE])
    size = max(abs(z), 1e-300)
    turn = np.exp(1j * omega * (time_s - lag[0]))
    w = z * value * turn
    bulge, second_bulge, overtone = terms.shape
    # u = Re F(Z, E, θ): the derivatives of F by ln w and by E² at fixed w.
    cube = overtone * soft * (w / size) ** 2 * w
    lowered = soft * value**2
    swell = 1 + bulge * lowered + second_bulge * lowered**2
    along = w * swell + 3 * cube
    by_envelope = (along + (2 * bulge * lowered + 4 * second_bulge * lowered**2) * w).real / np.maximum(value, 1e-300)
    turned = -along.imag
    jacobian = np.zeros((len(time_s), len(p)))
    jacobian[:, OMEGA] = turned * (time_s - lag[0])
    for place, by, late in ((ALPHA, by_alpha, lag[1]), (DRAG, by_drag, lag[2]), (FRICTION, by_friction, lag[3])):
        jacobian[:, place] = by_envelope * by - turned * omega * late
    jacobian[:, SOFTENING] = (
        (bulge + 2 * second_bulge * lowered) * value**2 * w + overtone * (w / size) ** 2 * w
    ).real - turned * omega * second
    jacobian[:, COSINE] = (along / z if z else turn * value).real - 2 * cube.real * z.real / size**2
    jacobian[:, SINE] = (-1j * (along / z if z else turn * value)).real + 2 * cube.real * z.imag / size**2
    jacobian[:, OFFSET] = 1.0
    jacobian[:, SLOPE] = time_s
    total = (w * swell + cube).real + p[OFFSET] + p[SLOPE] * time_s
    if drive is not None:
        swung, by_omega, by_rate = respond(time_s, drive, omega, p[ALPHA])
        total += p[GAIN] * swung
        jacobian[:, GAIN] = swung
        jacobian[:, OMEGA] += p[GAIN] * by_omega
        jacobian[:, ALPHA] += p[GAIN] * by_rate
    for k in range(PLACES, len(p), 4):
        total += _add_mode(time_s, p[k : k + 4], jacobian[:, k : k + 4])
    return total, jacobian


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


def _integrals(time_s: FloatArray, alpha: float, drag: float, friction: float) -> FloatArray:
    """Return ∫E² and ∫E⁴ from 0 to each time, then both by α, by β and by γ; shape (4, 2, n)."""
    steps = np.diff(time_s, prepend=0.0)
    nodes = (time_s - steps)[:, None] + steps[:, None] * _NODES
    value, *slopes = envelope(nodes, alpha, drag, friction)
    square, cube = value**2, value**3
    rows = [square, square**2]
    for by in slopes:
        rows += [2 * value * by, 4 * cube * by]
    return np.cumsum(np.stack(rows) @ _WEIGHTS * steps, axis=1).reshape(4, 2, -1)
