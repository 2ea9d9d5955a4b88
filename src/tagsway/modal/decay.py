"""The free decay of a pendulum: frequency and damping that depend on the amplitude, in closed form.

With E the amplitude over that at t = 0,

    E' = -α E - β E²                                        viscous damping and drag
    θ' = ω_d (1 - σ E² - ¾ σ² E⁴)                           softening
    u  = Re w (1 + p σ E² + s σ² E⁴) + h σ Re w³ / |Z|² + drift,      w = Z E e^{iθ}

where σ is the fraction by which the frequency is lower at t = 0 than for a small swing. The constants follow from the
action, which decays as e^{-2αt}: p = 1/2, s = 0.7, h = -1/12 for the arc r q, whatever spring helps gravity;
p = -3/2, s = -0.77, h = -3/4 for the projection r sin q under gravity alone.
"""

from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray

ARC = (0.5, 0.7, -1 / 12)
PROJECTION = (-1.5, -0.77, -0.75)

_NODES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)]) / 2 + 0.5
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18

OMEGA, ALPHA, COSINE, SINE, OFFSET, SOFTENING, DRAG, SLOPE = range(8)
"""Places of the parameters: rad/s, 1/s, length, length, length, 1, 1/s, length/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What a decay is made of, beside ω_d, α, an amplitude, a phase and an offset."""

    softening: bool = False
    drag: bool = False
    slope: bool = False
    shape: tuple[float, float, float] = ARC

    @property
    def free(self) -> list[int]:
        """Places of the parameters that are fitted."""
        extra = ((self.softening, SOFTENING), (self.drag, DRAG), (self.slope, SLOPE))
        return [OMEGA, ALPHA, COSINE, SINE, OFFSET, *(place for used, place in extra if used)]


def envelope(time_s: FloatArray, alpha: float, drag: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return E and its derivatives by α and β.

    Parameters
    ----------
    time_s : ndarray, any shape
        From the start.
    alpha, drag : float
        α and β in 1/s.

    Returns
    -------
    tuple of ndarray
        E, ∂E/∂α in s and ∂E/∂β in s.
    """
    x = np.clip(alpha * time_s, -30.0, 300.0)
    exponential = np.exp(-x)
    small = np.abs(x) < 1e-5
    safe = np.where(small, 1.0, x)
    grown = time_s * np.where(small, 1 - x / 2, -np.expm1(-safe) / safe)
    bent = time_s**2 * np.where(small, -0.5 + x / 3, (safe * exponential + np.expm1(-safe)) / safe**2)
    below = np.maximum(1 + drag * grown, 1e-3)
    value = exponential / below
    return value, -value * (time_s + drag * bent / below), -value * grown / below


def predict(time_s: FloatArray, p: FloatArray, terms: Terms) -> tuple[FloatArray, FloatArray]:
    """Return the decay and its derivatives by all eight parameters.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        From the start, rising, not negative.
    p : ndarray, shape (8,)
        Parameters in the order of this module's places.
    terms : Terms
        Its shape; a term that is not used has its parameter at 0.

    Returns
    -------
    value : ndarray, shape (n,)
    jacobian : ndarray, shape (n, 8)
    """
    value, by_alpha, by_drag = envelope(time_s, p[ALPHA], p[DRAG])
    omega, soft = p[OMEGA], p[SOFTENING]
    slowed = np.zeros((3, 2, len(time_s)))
    if terms.softening:
        slowed = _integrals(time_s, p[ALPHA], p[DRAG])
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
    jacobian = np.empty((len(time_s), 8))
    jacobian[:, OMEGA] = turned * (time_s - lag[0])
    jacobian[:, ALPHA] = by_envelope * by_alpha - turned * omega * lag[1]
    jacobian[:, DRAG] = by_envelope * by_drag - turned * omega * lag[2]
    jacobian[:, SOFTENING] = (
        (bulge + 2 * second_bulge * lowered) * value**2 * w + overtone * (w / size) ** 2 * w
    ).real - turned * omega * second
    jacobian[:, COSINE] = (along / z if z else turn * value).real - 2 * cube.real * z.real / size**2
    jacobian[:, SINE] = (-1j * (along / z if z else turn * value)).real + 2 * cube.real * z.imag / size**2
    jacobian[:, OFFSET] = 1.0
    jacobian[:, SLOPE] = time_s
    return (w * swell + cube).real + p[OFFSET] + p[SLOPE] * time_s, jacobian


def _integrals(time_s: FloatArray, alpha: float, drag: float) -> FloatArray:
    """Return ∫E² and ∫E⁴ from 0 to each time, then both by α and by β; shape (3, 2, n)."""
    steps = np.diff(time_s, prepend=0.0)
    nodes = (time_s - steps)[:, None] + steps[:, None] * _NODES
    value, by_alpha, by_drag = envelope(nodes, alpha, drag)
    square, cube = value**2, value**3
    rows = [square, square**2, 2 * value * by_alpha, 4 * cube * by_alpha, 2 * value * by_drag, 4 * cube * by_drag]
    return np.cumsum(np.stack(rows) @ _WEIGHTS * steps, axis=1).reshape(3, 2, -1)
