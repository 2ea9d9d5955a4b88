"""What a second video shows that a shaper left, and what that says of the mode it was designed for."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from tagsway.design.motion import TAIL_PERIODS
from tagsway.design.payload import PayloadSpread, make_payloads
from tagsway.dynamics import simulate_sway
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, DesignMode, Estimate, FloatArray, Mode, Shaper, Spread
from tagsway.shapers import IMPULSE_TYPES, SHAPER_TYPES, design_shaper, residual_vibration

SEARCHED_PERCENT = 30.0
"""How far from the design's frequency the fit looks: beyond it the payload is another one."""

STARTS = 25
STEP_S = 4e-3
FEWEST_SAMPLES = 20
MOST_DECAY_S = 3.0
"""After the move; more says little of how the swing began."""

GAIN_STD = 0.1
"""Of r/l, whose nominal value is the payload's."""

DAMPING_STD = 0.05
"""Of ζ, a prior: a small residual says little of it."""

SIGNIFICANT = 4.0
"""A residual below so many standard errors is none: noise alone passes it once in 3000 times."""

DRAWS = 200
DIFFERENCE = 1e-5

PivotVelocity = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualRecord:
    """The sway after a shaped move, and the motion of the pivot that made it.

    Parameters
    ----------
    time_s, sway_m : ndarray, shape (n,)
        Product minus tool along the way; NaN where not seen. From the end of the move on it is fitted.
    start_s, end_s : float
        Of the tool's motion.
    velocity : callable
        Of times, the pivot's velocity along the way and upward in m/s, shape (n, 2).
    """

    time_s: FloatArray
    sway_m: FloatArray
    start_s: float
    end_s: float
    velocity: PivotVelocity


@dataclass(frozen=True, slots=True, kw_only=True)
class Retuned:
    """A corrected shaper, and what it should gain.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : Estimate
        Of a small swing, as the residual tells them.
    amplitude_m, phase_rad : Estimate
        Of the residual at the end of the move: sway = A cos(φ + ω_d (t - end)) while it is small.
    shaper : Shaper
        Designed anew, for the same operating amplitude.
    residual_m, expected_m : Estimate
        Largest residual with the old shaper, and what is expected with the new one for the same payload.
    """

    natural_frequency_hz: Estimate
    damping_ratio: Estimate
    amplitude_m: Estimate
    phase_rad: Estimate
    shaper: Shaper
    residual_m: Estimate
    expected_m: Estimate

    @property
    def gain(self) -> Estimate:
        """Share of the residual that is expected to go, with its error."""
        now, then = self.residual_m, self.expected_m
        share = then.value / now.value
        std = share * math.hypot(now.std / now.value, then.std / max(then.value, 1e-12))
        return Estimate.normal(1 - share, std, high=1.0)


def retune_shaper(
    record: ResidualRecord,
    shaper: Shaper,
    spread: PayloadSpread,
    *,
    spread_percent: float | None = None,
    replan: Callable[[Shaper], tuple[PivotVelocity, float]] | None = None,
    rng: np.random.Generator,
) -> Retuned:
    """Correct a shaper's frequency and damping by the residual that it left.

    Parameters
    ----------
    record : ResidualRecord
        Of the second video.
    shaper : Shaper
        That was used; designed for one mode.
    spread : PayloadSpread
        The payload as it was thought to be: its lengths, and where the search begins.
    spread_percent : float, optional
        Standard deviation of the frequency between repeats, for the new shaper's residual.
    replan : callable, optional
        Of a shaper, the velocity and the duration of the move with it: then the residual that is expected is simulated;
        without it the residual scales with V.
    rng : numpy.random.Generator
        Draws the payloads that the errors leave possible.

    Raises
    ------
    InputError
        For a shaper of several modes, or by hand.
    NotIdentifiableError
        Where too little of the residual was seen, or nothing but noise is left.

    Notes
    -----
    The pendulum's equation of motion is driven by the shaped move; f_n, ζ, the gain r/l and an offset are fitted to the
    sway *after* the move. Amplitude and phase at its end tell how far, and to which side, the shaper's frequency was
    off, even where the residual itself is too small to be timed.
    """
    if len(shaper.modes) != 1 or shaper.type not in {*SHAPER_TYPES, *IMPULSE_TYPES}:
        raise InputError(
            f"a shaper of type {shaper.type!r} and {len(shaper.modes)} modes cannot be designed anew: expected one of "
            f"{', '.join(SHAPER_TYPES)} for one mode"
        )
    fit = _fit(record, spread)
    design = shaper.modes[0]
    softening = _softening(design, spread)
    mode = DesignMode(
        frequency_hz=fit.frequency_hz * softening, damping_ratio=fit.damping_ratio, amplitude_m=design.amplitude_m
    )
    between = None
    if spread_percent is not None:
        between = Spread(source="--frequency-spread", natural_frequency_std_percent=spread_percent, n=None)
    corrected = design_shaper(shaper.type, mode, spread=between, source="retuned")
    draws = fit.draw(DRAWS, rng)
    if replan is None:
        old, new = (_residuals(s, draws * [softening, 1.0]) for s in (shaper, corrected))
        expected = new / np.maximum(old, 1e-6) * fit.largest_m
    else:
        expected = _simulated_residual(*replan(corrected), draws, spread, fit.gain)
    std = fit.covariance[:2, :2].diagonal() ** 0.5
    return Retuned(
        natural_frequency_hz=Estimate.normal(fit.frequency_hz, float(std[0]), low=0.0),
        damping_ratio=Estimate.normal(fit.damping_ratio, float(std[1]), low=0.0),
        amplitude_m=Estimate.normal(fit.amplitude_m, fit.noise_m, low=0.0),
        phase_rad=Estimate.normal(fit.phase_rad, fit.noise_m / fit.amplitude_m),
        shaper=corrected,
        residual_m=Estimate.normal(fit.largest_m, fit.noise_m, low=0.0),
        expected_m=Estimate.normal(float(np.mean(expected)), float(np.std(expected)), low=0.0),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    frequency_hz: float
    damping_ratio: float
    gain: float
    covariance: FloatArray
    amplitude_m: float
    phase_rad: float
    noise_m: float
    largest_m: float

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return frequencies and damping ratios that the errors leave possible, shape (count, 2)."""
        found = rng.multivariate_normal([self.frequency_hz, self.damping_ratio], self.covariance[:2, :2], size=count)
        return np.column_stack([np.maximum(found[:, 0], 1e-3), np.clip(found[:, 1], 0.0, 0.9)])


def _fit(record: ResidualRecord, spread: PayloadSpread) -> _Fit:
    last = min(record.end_s + MOST_DECAY_S, float(record.time_s[-1]))
    used = np.isfinite(record.sway_m) & (record.time_s >= record.end_s) & (record.time_s <= last)
    period = spread.mode.damped_period_s
    if np.count_nonzero(used) < FEWEST_SAMPLES or not np.ptp(record.time_s[used]) >= period / 2:
        raise NotIdentifiableError(
            f"the product was seen in {np.count_nonzero(used)} frames after the move: expected half a period of "
            f"{period:.3g} s; film on after the tool stands"
        )
    time, sway = record.time_s[used], record.sway_m[used]
    nodes = _nodes(record.start_s, last)
    start = _best_start(record, spread, nodes, time, sway)

    noise = max(float(np.median(np.abs(np.diff(sway, 2)))) / 0.6745 / math.sqrt(6), 1e-6)
    fit = _Misfit(record.velocity, nodes, spread, time, sway, noise)
    low, high = [start[0] - 0.3, 0.0, 0.3, -np.inf], [start[0] + 0.3, 0.9, 3.0, np.inf]
    found = least_squares(
        fit.value, start, jac=fit.slopes, bounds=(low, high), x_scale=[0.02, 0.02, 0.1, 1e-3], xtol=1e-7
    )
    left = found.fun[: len(time)]
    inflation = _inflation(left)
    slopes = np.asarray(found.jac)
    covariance = np.linalg.pinv(slopes.T @ slopes) * inflation
    log_f, damping, gain, offset = (float(value) for value in found.x)
    frequency = math.exp(log_f)
    scale = np.array([frequency, 1.0, 1.0, 1.0])
    amplitude, phase, share = _phasor(time - record.end_s, sway - offset, frequency, damping)
    error = noise * math.sqrt(inflation) * share
    if not amplitude > SIGNIFICANT * error:
        raise NotIdentifiableError(
            f"the residual of {1e3 * amplitude:.2g} mm is within its error of {1e3 * error:.2g} mm: there is nothing "
            "left to tune; keep the shaper"
        )
    return _Fit(
        frequency_hz=frequency,
        damping_ratio=damping,
        gain=gain,
        covariance=covariance * np.outer(scale, scale),
        amplitude_m=amplitude,
        phase_rad=phase,
        noise_m=error,
        largest_m=float(np.abs(sway - offset).max()),
    )


def _best_start(
    record: ResidualRecord, spread: PayloadSpread, nodes: FloatArray, time: FloatArray, sway: FloatArray
) -> FloatArray:
    """Return log f, ζ, gain and offset of the best of many frequencies, simulated side by side."""
    middle = spread.mode.natural_frequency_hz
    frequency = middle * np.linspace(1 - SEARCHED_PERCENT / 100, 1 + SEARCHED_PERCENT / 100, STARTS)
    damping = np.full(STARTS, spread.mode.damping_ratio)
    models = _sway(record.velocity, nodes, spread, frequency, damping, time)
    offset = float(np.mean(sway))
    best = int(np.argmin(np.sum((models - models.mean(axis=0) - (sway - offset)[:, None]) ** 2, axis=0)))
    return np.array([math.log(frequency[best]), max(damping[best], 1e-4), 1.0, offset])


def _sway(
    velocity: PivotVelocity,
    nodes: FloatArray,
    spread: PayloadSpread,
    frequency_hz: FloatArray,
    damping: FloatArray,
    time: FloatArray,
) -> FloatArray:
    """Return the sway in m at some times for m payloads, shape (n, m)."""
    payloads = make_payloads(spread, frequency_hz, damping)
    halves = np.empty(2 * len(nodes) - 1)
    halves[::2], halves[1::2] = nodes, (nodes[1:] + nodes[:-1]) / 2
    q, _ = simulate_sway(payloads.ensemble, nodes, velocity(halves))
    sway = payloads.tag_radius_m * np.sin(q)
    return np.stack([_interpolate(time, nodes, column) for column in sway.T], axis=1)


def _interpolate(time: FloatArray, nodes: FloatArray, values: FloatArray) -> FloatArray:
    result: FloatArray = CubicSpline(nodes, values)(time)
    return result


def _nodes(start: float, end: float) -> FloatArray:
    return np.linspace(start, end, max(math.ceil((end - start) / STEP_S), 2) + 1)


class _Misfit:
    """What the model misses, over the noise, and its slopes: from one run of three payloads side by side."""

    def __init__(
        self,
        velocity: PivotVelocity,
        nodes: FloatArray,
        spread: PayloadSpread,
        time: FloatArray,
        sway: FloatArray,
        noise: float,
    ) -> None:
        self.velocity, self.nodes, self.spread, self.time = velocity, nodes, spread, time
        self.sway, self.noise, self.damping = sway, noise, spread.mode.damping_ratio
        self.at: FloatArray | None = None
        self.models = np.empty((0, 3))

    def _models(self, parameters: FloatArray) -> FloatArray:
        if self.at is None or not np.array_equal(self.at, parameters[:2]):
            log_f, damping = parameters[:2]
            frequency = np.exp([log_f, log_f + DIFFERENCE, log_f])
            dampings = np.array([damping, damping, damping + DIFFERENCE])
            self.models = _sway(self.velocity, self.nodes, self.spread, frequency, dampings, self.time)
            self.at = parameters[:2].copy()
        return self.models

    def value(self, parameters: FloatArray) -> FloatArray:
        _, damping, gain, offset = parameters
        left = (gain * self._models(parameters)[:, 0] + offset - self.sway) / self.noise
        return np.append(left, [(gain - 1) / GAIN_STD, (damping - self.damping) / DAMPING_STD])

    def slopes(self, parameters: FloatArray) -> FloatArray:
        models, gain = self._models(parameters), parameters[2]
        turned = gain * (models[:, 1:] - models[:, :1]) / DIFFERENCE
        rows = np.column_stack([turned, models[:, 0], np.ones(len(models))]) / self.noise
        priors = np.array([[0, 0, 1 / GAIN_STD, 0], [0, 1 / DAMPING_STD, 0, 0]])
        return np.concatenate([rows, priors])


def _phasor(time: FloatArray, sway: FloatArray, frequency: float, damping: float) -> tuple[float, float, float]:
    """Return amplitude and phase at time 0 of a decay, and the amplitude's error over that of a sample."""
    omega = 2 * math.pi * frequency
    decay = np.exp(-damping * omega * time)
    phase = omega * math.sqrt(1 - damping**2) * time
    columns = np.column_stack([decay * np.cos(phase), -decay * np.sin(phase)])
    c, s = np.linalg.lstsq(columns, sway, rcond=None)[0].tolist()
    share = math.sqrt(float(np.trace(np.linalg.inv(columns.T @ columns))) / 2)
    return math.hypot(c, s), math.atan2(s, c), share


def _inflation(left: FloatArray) -> float:
    """Return by how much coloured residuals widen the errors: their variance, and their correlation's length."""
    variance = float(np.mean(left**2))
    correlation = float(np.clip(np.sum(left[1:] * left[:-1]) / max(np.sum(left**2), 1e-300), 0.0, 0.98))
    return max(variance, 1.0) * (1 + correlation) / (1 - correlation)


def _softening(design: DesignMode, spread: PayloadSpread) -> float:
    """Return f at the design's amplitude over f of a small swing: 1 - q0²/16 times gravity's share of ω²."""
    if design.amplitude_m is None:
        return 1.0
    swing = min(design.amplitude_m / spread.tag_radius_m, 1.0)
    share = GRAVITY_M_S2 / spread.length_m / spread.mode.angular_frequency_rad_s**2
    return 1 - min(share, 1.0) * swing**2 / 16


def _residuals(shaper: Shaper, draws: FloatArray) -> FloatArray:
    return np.array(
        [residual_vibration(shaper, Mode(natural_frequency_hz=f, damping_ratio=z)) for f, z in draws.tolist()]
    )


def _simulated_residual(
    velocity: PivotVelocity, duration: float, draws: FloatArray, spread: PayloadSpread, gain: float
) -> FloatArray:
    tail = TAIL_PERIODS / float(draws[:, 0].min())
    nodes = _nodes(0.0, duration + tail)
    time = nodes[nodes >= duration]
    sway = _sway(velocity, nodes, spread, draws[:, 0], draws[:, 1], time)
    largest: FloatArray = gain * np.abs(sway).max(axis=0)
    return largest
