"""A smoothing spline that chooses its own bandwidth and knows its errors."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PPoly, make_interp_spline
from scipy.linalg import LinAlgError, cho_solve_banded
from scipy.optimize import minimize_scalar

from tagsway.errors import InputError
from tagsway.filters.contrasts import ORDER, Contrasts
from tagsway.filters.posterior import STENCIL, draw_process, factor, posterior_variance
from tagsway.model import FloatArray

LEAST_SAMPLES = STENCIL
"""Below this many samples there is nothing to choose a bandwidth from."""

SHORTEST_MEMORY = 1 / math.pi
"""Smoothing time constant in samples at which the bandwidth is half the sampling rate."""

LONGEST_MEMORY = 50.0
"""Smoothing time constant in samples beyond which the banded system loses digits and nothing is gained."""

DEGREE = 2 * ORDER - 1
"""Of the spline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothingSpline:
    """Posterior of a path with random-walk acceleration, given noisy samples of it.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the samples that were used.
    mean : BSpline
        The posterior's mean over time: a natural quintic spline.
    sample_std : ndarray, shape (n,)
        Standard deviation of each sample's noise as it was used, in the unit of the values.
    intensity : float
        q in x''' = √q w, w white noise of unit density: in the values' unit squared per s⁵.
    bandwidth_hz : float
        Where the smoothing halves an oscillation's amplitude; its gain is 1 / (1 + (f / bandwidth)⁶).

    Notes
    -----
    Outside the samples everything is NaN: a path is not guessed where it was not seen. Inside a gap the mean is the
    spline's, and the standard error says what that is worth.
    """

    time_s: FloatArray
    mean: BSpline
    sample_std: FloatArray
    intensity: float
    bandwidth_hz: float

    @property
    def noise_std(self) -> float:
        """Standard deviation of a typical sample's noise."""
        return float(np.median(self.sample_std))

    def __call__(self, time_s: FloatArray | float, order: int = 0) -> FloatArray:
        """Return the path, or its derivative of an order up to 4, at any times; shape of the times."""
        return np.asarray(self.mean(time_s, nu=order), dtype=float)

    def std(self, time_s: FloatArray | float, order: int = 0) -> FloatArray:
        """Return the standard error of position, velocity or acceleration (order 0, 1, 2); shape of the times.

        It holds for a path that is as rough everywhere as it is on the whole; around a jump of the acceleration the
        error is larger, in between it is smaller.
        """
        if order not in (0, 1, 2):
            raise ValueError(f"the acceleration itself is a random walk: no error of order {order}, only of 0, 1, 2")
        time = np.asarray(time_s, dtype=float)
        flat = time.ravel()
        inside = np.flatnonzero((flat >= self.time_s[0]) & (flat <= self.time_s[-1]))
        rising = inside[np.argsort(flat[inside], kind="stable")]
        step, units = _units(self.time_s)
        variance = posterior_variance(
            Contrasts.of(units),
            self.intensity * step**DEGREE,
            self.sample_std**2,
            (flat[rising] - self.time_s[0]) / step,
            order=order,
        )
        result = np.full(flat.shape, np.nan)
        result[rising] = np.sqrt(variance) / step**order
        return result.reshape(time.shape)

    def draw(self, rng: np.random.Generator, count: int) -> PPoly:
        """Draw paths from the posterior: each could have made the samples.

        Parameters
        ----------
        rng : Generator
            Source of randomness.
        count : int
            How many.

        Returns
        -------
        PPoly
            ``paths(time_s, order)`` has the shape of the times with one more axis of length `count`; NaN outside.

        Notes
        -----
        Matheron's rule: a path of the prior, less what the smoother makes of its noisy samples, plus the mean. Exact in
        position, velocity and acceleration at the samples; between them a quintic joins the states.
        """
        step, units = _units(self.time_s)
        contrasts = Contrasts.of(units)
        intensity = self.intensity * step**DEGREE
        states = draw_process(units, intensity, rng, count)
        noise = self.sample_std[:, None] * rng.standard_normal((len(units), count))
        smooth = _smooth(contrasts, intensity, self.sample_std**2, states[0] + noise)
        spline = _interpolate(units, smooth)
        for order in range(ORDER):
            mean = self.mean(self.time_s, nu=order) * step**order
            states[order] += mean[:, None] - spline(units, nu=order)
        coefficients = _hermite(np.diff(units), states)
        powers = step ** -np.arange(DEGREE, -1, -1.0)
        return PPoly(coefficients * powers[:, None, None], self.time_s, extrapolate=False)


def fit_smoothing_spline(
    time_s: FloatArray,
    values: FloatArray,
    std: FloatArray | float | None = None,
    *,
    bandwidth_hz: float | None = None,
    intensity: float | None = None,
) -> SmoothingSpline:
    """Fit a smoothing spline to one channel; its bandwidth and the noise are chosen by restricted likelihood.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, at any distances.
    values : ndarray, shape (n,)
        In any unit; NaN where nothing was seen: those samples are left out, never filled in. Free of spikes.
    std : ndarray, shape (n,), float or None
        Standard errors of the values: their ratios are believed, and the noise is taken to be at least this large.
        None (or NaN) where nothing is known of it.
    bandwidth_hz : float, optional
        To use, instead of the one that the data choose.
    intensity : float, optional
        q, to use instead; the standard errors are then believed as they are.

    Returns
    -------
    SmoothingSpline
        The path with its derivatives and their errors.

    Raises
    ------
    InputError
        Fewer than 9 samples, or times that do not rise.

    Notes
    -----
    The prior is a random walk of the acceleration, x''' = √q w; the posterior's mean is the quintic spline that
    minimises Σ (y - x)² / σ² + ∫ x'''² dt / q [1]_. q and the factor on σ maximise the likelihood of the third divided
    differences, which no parabola changes. The bandwidth is kept between half the sampling rate and 1 / (100 π) of it.
    The smoothed values solve a banded system in n unknowns: O(n) time.

    Not for a path whose roughness changes a lot over the record: one q stands for the whole.

    References
    ----------
    .. [1] G. Wahba, J. R. Stat. Soc. B 40 (1978) 364-372.
    """
    time, path, sigma = _usable(time_s, values, std)
    step, units = _units(time)
    contrasts = Contrasts.of(units)
    level = 1 / math.sqrt(float(np.mean(sigma**-2)))
    data, noise = contrasts.apply(path / level), contrasts.noise((sigma / level) ** 2)
    if intensity is None:
        fixed = None if bandwidth_hz is None else _memory(bandwidth_hz, step)
        memory, process = _choose(contrasts.process, noise, data, memory=fixed)
    else:
        process = intensity * step**DEGREE / level**2
        memory = process ** (-1 / (2 * ORDER))
    factor_on_std = math.sqrt(process * memory ** (2 * ORDER))
    smooth = _smooth(contrasts, process * level**2, (factor_on_std * sigma) ** 2, path)
    unit_spline = _interpolate(units, smooth)
    knots = np.concatenate([np.repeat(time[0], DEGREE), time, np.repeat(time[-1], DEGREE)])
    return SmoothingSpline(
        time_s=time,
        mean=BSpline(knots, unit_spline.c, DEGREE, extrapolate=False),
        sample_std=factor_on_std * sigma,
        intensity=process * level**2 / step**DEGREE,
        bandwidth_hz=1 / (2 * math.pi * memory * step),
    )


def _usable(
    time_s: FloatArray, values: FloatArray, std: FloatArray | float | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times, values and positive standard errors of the samples that exist."""
    seen = np.isfinite(values)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        raise InputError(f"{np.count_nonzero(seen)} samples cannot be smoothed: expected at least {LEAST_SAMPLES}")
    time, path = np.asarray(time_s, dtype=float)[seen], np.asarray(values, dtype=float)[seen]
    if not np.all(np.diff(time) > 0):
        raise InputError("the times of a track must rise from sample to sample: sort it and drop repeated rows")
    given = np.broadcast_to(np.asarray(np.nan if std is None else std, dtype=float), seen.shape)[seen]
    known = np.isfinite(given) & (given > 0)
    least = 1e-9 * (float(np.ptp(path)) or max(abs(float(path[0])), 1e-6))
    typical = float(np.median(given[known])) if known.any() else least
    return time, path, np.maximum(np.where(known, given, typical), least)


def _units(time_s: FloatArray) -> tuple[float, FloatArray]:
    """Return the median step, and the times counted in it from the first."""
    step = float(np.median(np.diff(time_s)))
    return step, (time_s - time_s[0]) / step


def _memory(bandwidth_hz: float, step: float) -> float:
    """Return the time constant in samples whose smoothing halves the amplitude at this frequency."""
    if not bandwidth_hz > 0:
        raise InputError(f"a bandwidth must be positive, not {bandwidth_hz:g} Hz")
    return float(np.clip(1 / (2 * math.pi * bandwidth_hz * step), SHORTEST_MEMORY, LONGEST_MEMORY))


def _choose(process: FloatArray, noise: FloatArray, data: FloatArray, *, memory: float | None) -> tuple[float, float]:
    """Return the time constant in samples and the intensity that maximise the restricted likelihood."""

    def score(log_memory: float) -> tuple[float, float]:
        ratio = math.exp(2 * ORDER * log_memory)
        try:
            lower, _ = factor(process + ratio * noise)
        except LinAlgError:
            return math.inf, 1 / ratio
        square = float(data @ cho_solve_banded((lower, False), data, check_finite=False)) / len(data)
        # For this ratio the likelihood has one maximum in q, at `square`; the noise factor q ratio must reach 1.
        intensity = max(square, 1 / ratio)
        log_det = 2 * float(np.mean(np.log(lower[-1])))
        return math.log(intensity) + log_det + square / intensity, intensity

    if memory is not None:
        return memory, score(math.log(memory))[1]
    grid = np.linspace(math.log(SHORTEST_MEMORY), math.log(LONGEST_MEMORY), 16)
    best = int(np.argmin([score(value)[0] for value in grid]))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    found = minimize_scalar(lambda value: score(value)[0], bounds=bounds, method="bounded", options={"xatol": 1e-3})
    return math.exp(found.x), score(found.x)[1]


def _smooth(contrasts: Contrasts, intensity: float, variance: FloatArray, values: FloatArray) -> FloatArray:
    """Return the posterior's mean at the samples, x = y - Σ C M⁻¹ Cᵀ y, for values of shape (n, ...)."""
    bands = intensity * contrasts.process + contrasts.noise(variance)
    dual = cho_solve_banded(factor(bands), contrasts.apply(values), check_finite=False)
    return values - variance.reshape(-1, *(1,) * (values.ndim - 1)) * contrasts.spread(dual)


def _interpolate(units: FloatArray, values: FloatArray) -> BSpline:
    """Return the natural quintic spline through values at the samples."""
    zero = np.zeros(values.shape[1:])
    natural = [(order, zero) for order in range(ORDER, DEGREE)]
    ends = (natural, natural)
    return make_interp_spline(units, values, k=DEGREE, bc_type=ends, check_finite=False)  # type: ignore[arg-type] # stubs


def _hermite(step: FloatArray, states: FloatArray) -> FloatArray:
    """Return coefficients, of falling powers, of the quintics that join states of shape (3, n, count)."""
    step = step[:, None]
    x, v, a = states[:, :-1]
    # What position, velocity and acceleration still lack at the end of the step, each scaled to a length.
    lack = states[0, 1:] - (x + v * step + a * step**2 / 2)
    lack_v = (states[1, 1:] - (v + a * step)) * step
    lack_a = (states[2, 1:] - a) * step**2
    cubic = (10 * lack - 4 * lack_v + lack_a / 2) / step**3
    quartic = (-15 * lack + 7 * lack_v - lack_a) / step**4
    quintic = (6 * lack - 3 * lack_v + lack_a / 2) / step**5
    return np.stack([quintic, quartic, cubic, a / 2, v, x])
