"""The sway that a second video shows after a shaped move, and the pendulum that explains it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.errors import NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, Estimate, FloatArray, Mode

SEARCHED_PERCENT = 30.0
"""How far from the design's frequency the fit looks: beyond it the payload is another one."""

STARTS = 25
STEP_S = 4e-3
FEWEST_SAMPLES = 20
MOST_DECAY_S = 3.0
"""After the move; more says little of how the swing began."""

DAMPING_STD, DRAG_STD_PER_RAD, GAIN_STD = 0.05, 0.05, 0.1
"""Priors of ζ, of drag around none, and of r around its nominal value: a small residual says little of them."""

SIGNIFICANT = 4.0
"""A residual below so many standard errors is none: noise alone passes it once in 3000 times."""

PASSES = 2
"""The second weighs the samples by what the first could not explain, so that priors keep their weight."""

DIFFERENCE = 1e-5
LOG_F, DAMPING, LOG_LENGTH, DRAG, GAIN, OFFSET = range(6)

PivotVelocity = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorPayload:
    """The payload as it was thought to be.

    Parameters
    ----------
    mode : Mode
        Of a small swing, where the search begins.
    length_m : Estimate
        Equivalent length l; with the frequency it says how much of it is gravity's, and how much a spring's.
    tag_radius_m : float
        r, from the pivot to the product's tag.
    """

    mode: Mode
    length_m: Estimate
    tag_radius_m: float


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
class ResidualFit:
    """The pendulum behind a residual.

    Parameters
    ----------
    parameters : ndarray, shape (6,)
        ln f_n, ζ, ln l, drag, gain (r over its nominal value) and the offset in m.
    covariance : ndarray, shape (6, 6)
        With what the pendulum could not explain in it.
    amplitude_m, phase_rad : float
        Of the residual at the end of the move.
    error_m : float
        Standard error of the amplitude.
    largest_m, unexplained_m : float
        Largest residual of the fitted pendulum, and the amplitude of what it leaves beside noise.
    """

    parameters: FloatArray
    covariance: FloatArray
    amplitude_m: float
    phase_rad: float
    error_m: float
    largest_m: float
    unexplained_m: float

    @property
    def natural_frequency_hz(self) -> Estimate:
        """Of a small swing."""
        frequency = math.exp(self.parameters[LOG_F])
        return Estimate.normal(frequency, frequency * math.sqrt(self.covariance[LOG_F, LOG_F]), low=0.0)

    @property
    def damping_ratio(self) -> Estimate:
        """Of a small swing."""
        return Estimate.normal(self.parameters[DAMPING], math.sqrt(self.covariance[DAMPING, DAMPING]), low=0.0)

    def draw(self, count: int, *, rng: np.random.Generator) -> FloatArray:
        """Return parameters that the errors leave possible, shape (count, 6)."""
        drawn: FloatArray = rng.multivariate_normal(self.parameters, self.covariance, size=count)
        drawn[:, DAMPING] = np.clip(drawn[:, DAMPING], 0.0, 0.9)
        drawn[:, DRAG] = np.maximum(drawn[:, DRAG], 0.0)
        return drawn


def fit_residual(record: ResidualRecord, prior: PriorPayload) -> ResidualFit:
    """Fit a pendulum to the sway after a move.

    Parameters
    ----------
    record : ResidualRecord
        Of the second video.
    prior : PriorPayload
        What was thought of the payload.

    Raises
    ------
    NotIdentifiableError
        Where too little was seen after the move, or nothing but noise is left.

    Notes
    -----
    The pendulum's equation of motion is driven by the move; f_n, ζ, l, drag, r and an offset are fitted to the sway
    *after* it, all but the first and the last with a prior. Amplitude and phase at the end of the move tell how far,
    and to which side, the frequency was off, even where the residual itself is too small to be timed.
    """
    time, sway, nodes = _cut(record, prior)
    noise = max(float(np.median(np.abs(np.diff(sway, 2)))) / 0.6745 / math.sqrt(6), 1e-6)
    at, inflation = _best_start(record, prior, nodes, time, sway), 1.0
    for _ in range(PASSES):
        fit = _Misfit(record.velocity, nodes, prior, time, sway, noise * math.sqrt(inflation))
        low, high = [at[LOG_F] - 0.3, 0.0, *[-np.inf] * 4], [at[LOG_F] + 0.3, 0.9, *[np.inf] * 4]
        scale = [0.02, 0.02, 0.1, 0.05, 0.1, 1e-3]
        found = least_squares(fit.value, at, jac=fit.slopes, bounds=(low, high), x_scale=scale, xtol=1e-7)
        at = found.x
        left = found.fun[: len(time)] * math.sqrt(inflation)
        inflation = _inflation(left)
    slopes = np.asarray(found.jac)
    log_f, damping, offset = float(at[LOG_F]), float(at[DAMPING]), float(at[OFFSET])
    amplitude, phase, share = find_phasor(time - record.end_s, sway - offset, math.exp(log_f), damping)
    error = noise * math.sqrt(inflation) * share
    if not amplitude > SIGNIFICANT * error:
        raise NotIdentifiableError(
            f"the residual of {1e3 * amplitude:.2g} mm is within its error of {1e3 * error:.2g} mm: there is nothing "
            "left to tune; keep the shaper"
        )
    return ResidualFit(
        parameters=at,
        covariance=np.linalg.pinv(slopes.T @ slopes),
        amplitude_m=amplitude,
        phase_rad=phase,
        error_m=error,
        largest_m=float(np.abs(sway + noise * left - offset).max()),
        unexplained_m=noise * math.sqrt(2 * max(float(np.mean(left**2)) - 1, 0.0)),
    )


def simulate_sways(
    velocity: PivotVelocity, nodes: FloatArray, parameters: FloatArray, prior: PriorPayload, time_s: FloatArray
) -> FloatArray:
    """Return the sway in m at some times for m sets of parameters, shape (m, 6), as an array of shape (n, m).

    Infinite where a pendulum flies off, as one with a drag below zero does.
    """
    omega = 2 * math.pi * np.exp(parameters[:, LOG_F])
    length = np.exp(parameters[:, LOG_LENGTH])
    ensemble = PendulumEnsemble(
        length_m=length,
        stiffness_over_inertia_rad2_s2=omega**2 - GRAVITY_M_S2 / length,
        damping_over_inertia_rad_s=2 * parameters[:, DAMPING] * omega,
        quadratic_drag_per_rad=parameters[:, DRAG],
        coulomb_friction_rad_s2=np.zeros_like(omega),
    )
    halves = np.empty(2 * len(nodes) - 1)
    halves[::2], halves[1::2] = nodes, (nodes[1:] + nodes[:-1]) / 2
    with np.errstate(all="ignore"):  # a trial step may fly off; the search turns back from what is not finite
        q, _ = simulate_sway(ensemble, nodes, velocity(halves))
    stays = np.all(np.isfinite(q), axis=0)
    sway = CubicSpline(nodes, prior.tag_radius_m * np.sin(np.where(stays, q, 0.0)))(time_s)
    found: FloatArray = np.where(stays, parameters[:, GAIN] * sway + parameters[:, OFFSET], np.inf)
    return found


def lay_nodes(start_s: float, end_s: float) -> FloatArray:
    """Return the nodes of a simulation."""
    return np.linspace(start_s, end_s, max(math.ceil((end_s - start_s) / STEP_S), 2) + 1)


def find_phasor(
    time_s: FloatArray, sway_m: FloatArray, frequency_hz: float, damping_ratio: float
) -> tuple[float, float, float]:
    """Return amplitude and phase at time 0 of a decay, and the amplitude's error over that of a sample."""
    omega = 2 * math.pi * frequency_hz
    decay = np.exp(-damping_ratio * omega * time_s)
    phase = omega * math.sqrt(1 - damping_ratio**2) * time_s
    columns = np.column_stack([decay * np.cos(phase), -decay * np.sin(phase)])
    c, s = np.linalg.lstsq(columns, sway_m, rcond=None)[0].tolist()
    share = math.sqrt(float(np.trace(np.linalg.inv(columns.T @ columns))) / 2)
    return math.hypot(c, s), math.atan2(s, c), share


def _cut(record: ResidualRecord, prior: PriorPayload) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times and sway after the move, and the nodes of a simulation that reaches as far."""
    last = min(record.end_s + MOST_DECAY_S, float(record.time_s[-1]))
    used = np.isfinite(record.sway_m) & (record.time_s >= record.end_s) & (record.time_s <= last)
    period = prior.mode.damped_period_s
    if np.count_nonzero(used) < FEWEST_SAMPLES or not np.ptp(record.time_s[used]) >= period / 2:
        raise NotIdentifiableError(
            f"the product was seen in {np.count_nonzero(used)} frames after the move: expected half a period of "
            f"{period:.3g} s; film on after the tool stands"
        )
    return record.time_s[used], record.sway_m[used], lay_nodes(record.start_s, last)


def _nominal(prior: PriorPayload) -> FloatArray:
    mode = prior.mode
    return np.array(
        [math.log(mode.natural_frequency_hz), mode.damping_ratio, math.log(prior.length_m.value), 0.0, 1.0, 0.0]
    )


def _best_start(
    record: ResidualRecord, prior: PriorPayload, nodes: FloatArray, time: FloatArray, sway: FloatArray
) -> FloatArray:
    """Return the best of many frequencies, simulated side by side."""
    starts = np.tile(_nominal(prior), (STARTS, 1))
    starts[:, LOG_F] += np.log(np.linspace(1 - SEARCHED_PERCENT / 100, 1 + SEARCHED_PERCENT / 100, STARTS))
    starts[:, DAMPING] = max(prior.mode.damping_ratio, 1e-4)
    starts[:, OFFSET] = float(np.mean(sway))
    models = simulate_sways(record.velocity, nodes, starts, prior, time)
    misfits = np.sum((models - models.mean(axis=0) - (sway - np.mean(sway))[:, None]) ** 2, axis=0)
    best: FloatArray = starts[int(np.argmin(misfits))]
    return best


class _Misfit:
    """What the model misses, over the noise, and its slopes: from one run of a few payloads side by side."""

    def __init__(
        self,
        velocity: PivotVelocity,
        nodes: FloatArray,
        prior: PriorPayload,
        time: FloatArray,
        sway: FloatArray,
        noise: float,
    ) -> None:
        self.velocity, self.nodes, self.prior, self.time = velocity, nodes, prior, time
        self.sway, self.noise = sway, noise
        self.nominal = _nominal(prior)
        length = prior.length_m
        self.weights = np.array([0, 1 / DAMPING_STD, length.value / length.std, 1 / DRAG_STD_PER_RAD, 1 / GAIN_STD, 0])
        self.at: FloatArray | None = None
        self.models = np.empty((0, 1))

    def _models(self, parameters: FloatArray) -> FloatArray:
        if self.at is None or not np.array_equal(self.at, parameters):
            beside = np.vstack([parameters, parameters + DIFFERENCE * np.eye(len(parameters))])
            self.models = simulate_sways(self.velocity, self.nodes, beside, self.prior, self.time)
            self.at = parameters.copy()
        return self.models

    def value(self, parameters: FloatArray) -> FloatArray:
        left = (self._models(parameters)[:, 0] - self.sway) / self.noise
        return np.append(left, self.weights * (parameters - self.nominal))

    def slopes(self, parameters: FloatArray) -> FloatArray:
        models = self._models(parameters)
        return np.vstack([(models[:, 1:] - models[:, :1]) / DIFFERENCE / self.noise, np.diag(self.weights)])


def _inflation(left: FloatArray) -> float:
    """Return by how much coloured residuals widen the errors: their variance, and their correlation's length."""
    variance = float(np.mean(left**2))
    correlation = float(np.clip(np.sum(left[1:] * left[:-1]) / max(np.sum(left**2), 1e-300), 0.0, 0.98))
    return max(variance, 1.0) * (1 + correlation) / (1 - correlation)
