"""The payload that a move is designed for: not one pendulum but all that the next pick may be."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import qmc
from scipy.stats import t as student_t

from tagsway.dynamics import LightBody, PendulumEnsemble
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, NORMAL_95, FloatArray, Mode

LOWEST_SHARE = 0.2
"""Of the nominal frequency: a normal distribution's tail below it is no payload."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherMode:
    """A mode beyond the first: a light body that the first one carries at the product's tag, and drives.

    Parameters
    ----------
    mode : Mode
        Its own frequency and damping ratio.
    frequency_percent : float
        Of its frequency between picks, as the first mode's and of the same shape; it varies independently.
    gain : float
        How far it moves the tag per acceleration of its support, against a point mass on a string.
    """

    mode: Mode
    frequency_percent: float
    gain: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.frequency_percent < 100:
            raise InputError(
                f"the spread of a further mode is {self.frequency_percent:g} %: expected more than 0 and less than 100"
            )
        if not math.isfinite(self.gain):
            raise InputError(f"the gain of a further mode is {self.gain:g}: expected a number, such as 0.1")


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadSpread:
    """How frequency and damping of a payload vary from pick to pick.

    Parameters
    ----------
    mode : Mode
        Small-swing natural frequency and damping ratio in the middle.
    frequency_percent, damping_low, damping_high : float
        Of a normal spread: the standard deviation of f_n in percent, and the central 68 % of ζ. Of a uniform one: half
        the width of f_n in percent, and the two ends of ζ.
    length_m, tag_radius_m : float
        Equivalent length l at the middle, and r from the pivot to the product's tag.
    shape : {"normal", "uniform"}
        Of the distribution.
    n : int or None
        How many measurements the normal spread is known from: the next pick is drawn from Student's t with n - 1
        degrees of freedom, √(1 + 1/n) wider; None for a stated one.
    source : str
        Where all that is known from.
    further : tuple of FurtherMode
        Modes beyond the first.

    Notes
    -----
    f_n varies by l at fixed k/m, as goods that hang lower or higher in the same gripper: ω² = g/l + κ/l² with κ = k/m
    of a point mass. A payload of ω² < g/l would need a negative spring and is refused.
    """

    mode: Mode
    frequency_percent: float
    damping_low: float
    damping_high: float
    length_m: float
    tag_radius_m: float
    shape: Literal["normal", "uniform"] = "normal"
    n: int | None = None
    source: str = "given"
    further: tuple[FurtherMode, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.frequency_percent < 100:
            raise InputError(
                f"the frequency's spread is {self.frequency_percent:g} %: expected more than 0 and less than 100; a "
                "spread of nothing says nothing of the next pick"
            )
        if not 0 <= self.damping_low <= self.damping_high < 1:
            raise InputError(
                f"the damping's spread is {self.damping_low:g} to {self.damping_high:g}: expected two rising ratios "
                "in [0, 1)"
            )
        if not (self.length_m > 0 and self.tag_radius_m > 0):
            raise InputError(
                f"the payload's lengths are {1e3 * self.length_m:g} and {1e3 * self.tag_radius_m:g} mm: expected > 0"
            )
        if not self.spring_m2_s2 >= -1e-6 * self.mode.angular_frequency_rad_s**2 * self.length_m**2:
            shortest = 1e3 * GRAVITY_M_S2 / self.mode.angular_frequency_rad_s**2
            raise InputError(
                f"a pendulum of {1e3 * self.length_m:g} mm cannot swing at {self.mode.natural_frequency_hz:g} Hz "
                f"without a negative spring: expected a length of {shortest:.4g} mm or more"
            )

    @property
    def spring_m2_s2(self) -> float:
        """κ = k/m = (ω² - g/l) l², in m²/s²."""
        return (self.mode.angular_frequency_rad_s**2 - GRAVITY_M_S2 / self.length_m) * self.length_m**2

    @property
    def band_percent(self) -> float:
        """Half the width, in percent of f_n, that holds all of a uniform spread and 95 % of a normal one."""
        return self.frequency_percent * (1.0 if self.shape == "uniform" else NORMAL_95)

    @property
    def words(self) -> str:
        """The spread in words."""
        if self.shape == "uniform":
            band = f"f_n uniform within ±{self.frequency_percent:g} %"
        else:
            band = f"f_n with a standard deviation of {self.frequency_percent:.3g} %"
            band += "" if self.n is None else f" between {self.n} measurements"
        return f"{band}, ζ {self.damping_low:.3g} to {self.damping_high:.3g} ({self.source})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Payloads:
    """Some of those payloads side by side, arrays of shape (m,); `further` holds a body for each further mode."""

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    tag_radius_m: FloatArray
    ensemble: PendulumEnsemble
    further: tuple[LightBody, ...] = ()

    def __len__(self) -> int:
        return len(self.frequency_hz)

    @property
    def longest_period_s(self) -> float:
        """Of a small swing."""
        return 1 / float(self.frequency_hz.min())

    @property
    def fastest_hz(self) -> float:
        """Of all modes."""
        others = [float(body.angular_frequency_rad_s.max()) / (2 * math.pi) for body in self.further]
        return max(float(self.frequency_hz.max()), *others, 0.0)


def make_payloads(
    spread: PayloadSpread,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    further_hz: FloatArray | None = None,
) -> Payloads:
    """Return the payloads of these frequencies and damping ratios, both of shape (m,).

    The length follows from f_n at fixed κ, and r keeps its distance from l. `further_hz`, shape (modes, m), are the
    frequencies of the further modes; by default those in the middle.
    """
    omega = 2 * math.pi * np.asarray(frequency_hz, dtype=float)
    spring = max(spread.spring_m2_s2, 0.0)
    # κ u² + g u - ω² = 0 in u = 1/l, in the form that holds for κ = 0 too.
    length = (GRAVITY_M_S2 + np.sqrt(GRAVITY_M_S2**2 + 4 * spring * omega**2)) / (2 * omega**2)
    zero = np.zeros_like(length)
    radius = np.maximum(length + (spread.tag_radius_m - spread.length_m), 1e-3)
    if further_hz is None:
        further_hz = np.array([zero + each.mode.natural_frequency_hz for each in spread.further])
    return Payloads(
        frequency_hz=omega / (2 * math.pi),
        damping_ratio=np.asarray(damping_ratio, dtype=float),
        tag_radius_m=radius,
        further=tuple(
            LightBody(
                carried_at_m=radius,
                angular_frequency_rad_s=2 * math.pi * hertz,
                damping_ratio=zero + each.mode.damping_ratio,
                gain=zero + each.gain,
            )
            for each, hertz in zip(spread.further, further_hz, strict=True)
        ),
        ensemble=PendulumEnsemble(
            length_m=length,
            stiffness_over_inertia_rad2_s2=spring / length**2,
            damping_over_inertia_rad_s=2 * damping_ratio * omega,
            quadratic_drag_per_rad=zero,
            coulomb_friction_rad_s2=zero,
        ),
    )


def sample_payloads(spread: PayloadSpread, count: int, *, rng: np.random.Generator) -> Payloads:
    """Draw payloads from a spread: scrambled Sobol points, which fill it more evenly than independent draws."""
    power = math.ceil(math.log2(max(count, 2)))
    points = qmc.Sobol(2 + len(spread.further), rng=rng).random_base2(power)[:count]
    return _at_quantiles(spread, points.T)


def draw_payloads(spread: PayloadSpread, count: int, *, rng: np.random.Generator) -> Payloads:
    """Draw independent payloads: the share of them that keeps a limit has a binomial error."""
    return _at_quantiles(spread, rng.random((2 + len(spread.further), count)))


def corner_payloads(
    spread: PayloadSpread,
    *,
    frequencies: int,
    dampings: int,
    further: int = 3,
    shares: tuple[float, float] = (1.0, 1.0),
) -> Payloads:
    """Return a grid over the middle of the spread, its edges included, for a worst case.

    `shares` are those of the frequencies and of the damping ratios that lie inside; a normal spread has no edges, and
    ends at 97.5 %. Each further mode takes `further` frequencies of its own spread.
    """
    most = 1.0 if spread.shape == "uniform" else 0.975
    sizes = (frequencies, dampings, *[further] * len(spread.further))
    inside = [min(share, most) for share in (*shares, *[shares[0]] * len(spread.further))]
    axes = [np.linspace((1 - share) / 2, (1 + share) / 2, n) for share, n in zip(inside, sizes, strict=True)]
    return _at_quantiles(spread, np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")]))


def _at_quantiles(spread: PayloadSpread, quantiles: FloatArray) -> Payloads:
    """Return payloads at quantiles of f_n, ζ and each further mode's frequency, shape (2 + modes, m)."""
    if spread.shape == "uniform":
        deviates = 2 * quantiles - 1
    else:
        freedom, widening = (np.inf, 1.0) if spread.n is None else (spread.n - 1, math.sqrt(1 + 1 / spread.n))
        deviates = widening * student_t.ppf(np.clip(quantiles, 1e-6, 1 - 1e-6), freedom)
    low, high = spread.damping_low, spread.damping_high
    damping = np.clip((low + high) / 2 + (high - low) / 2 * deviates[1], 0.0, 0.95)
    first, *others = (
        mode.natural_frequency_hz * np.maximum(1 + percent / 100 * deviate, LOWEST_SHARE)
        for mode, percent, deviate in zip(
            [spread.mode, *(each.mode for each in spread.further)],
            [spread.frequency_percent, *(each.frequency_percent for each in spread.further)],
            [deviates[0], *deviates[2:]],
            strict=True,
        )
    )
    return make_payloads(spread, first, damping, np.array(others))
