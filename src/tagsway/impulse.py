"""The robot's own first frequency, from what its joints answer to a hammer."""

import itertools

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Blow, BlowResult, Estimate, FloatArray, ImpulseSpectra

ENVELOPE_S = 0.01
"""Over this the largest value stands for the envelope: a third of a period at 30 Hz, both signs taken."""

LOUD, RISE = 0.2, 3.0
"""A blow reaches this share of the loudest, and rises by this factor above the quiet before it."""

ABOVE = 4.0
"""Least height of a blow over the noise, both as envelopes: the largest of a record of noise alone is 3.4 times its
5th percentile."""

APART_S = 0.15
"""A hammer that bounces strikes again sooner."""

LONGEST_S = 1.0
"""Beyond it a robot's answer is noise; the thesis' records last 0.5 to 1 s."""

LEAST_SAMPLES = 32
BIN_HZ = 0.1
"""Largest step of the zero-padded spectrum."""

LEAST_CYCLES = 3.0
"""A peak below so many periods in the record is drift."""

SIGNIFICANT = 0.3
"""Share of the highest peak of the averaged spectrum that a first peak has to reach: a side lobe has 0.22."""

NEAR = 1.35
"""A blow's own peak is looked for within this factor of the averaged spectrum's: ± 13 % were measured."""

OWN_SHARE = 0.2
"""Share of a blow's own spectrum below which it does not show the first mode."""

MOST_MODES = 4


def find_blows(time_s: FloatArray, values: FloatArray, *, channel: str) -> list[Blow]:
    """Return what one channel answers to each blow.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Even, at the joints' rate, 1 kHz or so.
    values : ndarray, shape (n,)
        Acceleration of a joint, in any unit; NaN is taken for the end of the record.
    channel : str
        Its name.

    Returns
    -------
    list of Blow
        Empty where nothing stands out of the noise. A record that begins with its blow has one.

    Raises
    ------
    InputError
        For times that are not even.

    Notes
    -----
    A blow begins where the envelope passes a fifth of its highest value and has risen threefold within twice the
    envelope's width, to four times the noise. The samples from the highest of the first width on are the answer: what
    the hammer itself does, a pulse of a few milliseconds, lies before it. It ends at the next blow, after a second, or
    where the envelope has fallen to the noise.
    """
    finite = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[finite], values[finite]
    if len(values) < LEAST_SAMPLES:
        return []
    step = float(np.median(np.diff(time_s)))
    if not (step > 0 and np.max(np.abs(np.diff(time_s) - step)) < 0.5 * step):
        raise InputError(f"{channel}: the times of the record are not even: a spectrum needs every sample")
    signal = values - np.median(values)
    width = max(3, round(ENVELOPE_S / step))
    envelope = maximum_filter1d(np.abs(signal), 2 * width + 1)
    loudest = float(envelope.max())
    if not loudest > 0:
        return []
    quiet = np.concatenate([np.full(2 * width, np.nan), minimum_filter1d(envelope, 3)[: -2 * width]])
    rises = (envelope > LOUD * loudest) & (envelope > RISE * quiet)
    starts = np.flatnonzero(rises & ~np.roll(rises, 1))
    onsets = [0] if envelope[: 2 * width].max() > LOUD * loudest and _decays(envelope) else []
    for start in starts:
        if not onsets or (start - onsets[-1]) * step > APART_S:
            onsets.append(int(start))
    floor = float(np.percentile(envelope, 5))
    onsets = [onset for onset in onsets if envelope[onset : onset + 3 * width].max() > ABOVE * floor]
    blows = []
    for onset, following in itertools.pairwise([*onsets, len(signal)]):
        begin = onset + int(np.argmax(np.abs(signal[onset : onset + 3 * width])))
        end = min(following - (width if following < len(signal) else 0), begin + round(LONGEST_S / step))
        dead = np.flatnonzero(envelope[begin:end] < max(2 * floor, 0.01 * envelope[begin]))
        end = begin + max(int(dead[0]), LEAST_SAMPLES) if dead.size else end
        part = signal[begin:end]
        if len(part) >= LEAST_SAMPLES and np.ptp(part) > 0:
            blow = Blow(channel=channel, start_s=float(time_s[begin]), step_s=step, value=part - part.mean())
            blows.append(blow)
    return blows


def average_spectra(blows: list[Blow]) -> ImpulseSpectra:
    """Return the zero-padded amplitude spectra of all blows, and their average.

    Parameters
    ----------
    blows : list of Blow
        At least one; of one sampling rate.

    Raises
    ------
    NotIdentifiableError
        For no blow.
    InputError
        Where the records' rates differ.
    """
    if not blows:
        raise NotIdentifiableError(
            "no blow stands out of the records: strike harder, and record the joints' accelerations at 1 kHz",
            code="no_blow",
        )
    step = blows[0].step_s
    if not all(abs(blow.step_s / step - 1) < 1e-3 for blow in blows):
        raise InputError("the records' sampling rates differ: give those of one rate together")
    longest = max(len(blow.value) for blow in blows)
    count = 1 << int(np.ceil(np.log2(max(1 / (BIN_HZ * step), 2 * longest))))
    amplitude = np.array([np.abs(np.fft.rfft(blow.value, count)) for blow in blows])
    each = amplitude / amplitude.max(axis=1, keepdims=True)
    return ImpulseSpectra(frequency_hz=np.arange(count // 2 + 1) / (count * step), each=each, mean=each.mean(axis=0))


def find_first_peak(spectra: ImpulseSpectra, *, lowest_hz: float, highest_hz: float) -> float:
    """Return the lowest significant peak of the averaged spectrum, in Hz.

    Raises
    ------
    NotIdentifiableError
        Where no peak stands out between the two frequencies.
    """
    frequency, mean = spectra.frequency_hz, spectra.mean
    inside = (frequency >= lowest_hz) & (frequency <= highest_hz)
    band = np.where(inside, mean, 0.0)
    peaks = find_peaks(band, height=SIGNIFICANT * band.max(), prominence=0.5 * SIGNIFICANT * band.max())[0]
    # Of white noise the average is flat: a peak of a mode stands above the middle of the band.
    peaks = [peak for peak in peaks if mean[peak] > 2 * float(np.median(mean[inside]))]
    if not peaks:
        raise NotIdentifiableError(
            f"no peak stands out of the averaged spectrum between {lowest_hz:g} and {highest_hz:g} Hz: strike harder, "
            "or name another band with --lowest and --highest",
            code="no_peak",
        )
    return _vertex(frequency, mean, peaks[0])


def measure_blow(blow: Blow, spectrum: FloatArray, frequency_hz: FloatArray, *, near_hz: float) -> BlowResult | None:
    """Return one blow's own first frequency: by its spectrum, and by damped modes fitted to the samples.

    Parameters
    ----------
    blow : Blow
        The answer.
    spectrum, frequency_hz : ndarray, shape (k,)
        Its zero-padded amplitude, as `average_spectra` has it.
    near_hz : float
        The averaged spectrum's first peak.

    Returns
    -------
    BlowResult or None
        None where this channel does not show the mode.
    """
    near = (frequency_hz > near_hz / NEAR) & (frequency_hz < near_hz * NEAR)
    peaks = find_peaks(spectrum)[0]
    own = [peak for peak in peaks if near[peak] and spectrum[peak] >= OWN_SHARE]
    if not own:
        return None
    peak = max(own, key=lambda place: float(spectrum[place]))
    hz = _vertex(frequency_hz, spectrum, int(peak))
    others = [p for p in peaks[np.argsort(-spectrum[peaks])] if abs(frequency_hz[p] / hz - 1) > NEAR - 1][
        : MOST_MODES - 1
    ]
    further = [_vertex(frequency_hz, spectrum, int(p)) for p in others if spectrum[p] >= OWN_SHARE]
    natural, damping = _fit_modes(blow, [hz, *further])
    return BlowResult(
        channel=blow.channel,
        start_s=blow.start_s,
        duration_s=len(blow.value) * blow.step_s,
        peak_hz=hz,
        natural_frequency_hz=natural,
        damping_ratio=damping,
    )


def lowest_frequency(blows: list[Blow]) -> float:
    """Return the frequency below which a peak has too few periods in the shortest answer to be one."""
    return LEAST_CYCLES / min(len(blow.value) * blow.step_s for blow in blows)


def _fit_modes(blow: Blow, start_hz: list[float]) -> tuple[Estimate | None, Estimate | None]:
    """Fit a sum of damped modes and an offset; only the poles are searched. The first one's f_n and ζ are returned."""
    time = np.arange(len(blow.value)) * blow.step_s

    def left(p: FloatArray) -> FloatArray:
        omega, alpha = p.reshape(2, -1)
        decay, phase = np.exp(-np.outer(time, alpha)), np.outer(time, omega)
        basis = np.hstack([decay * np.cos(phase), decay * np.sin(phase), np.ones((len(time), 1))])
        weights = np.linalg.lstsq(basis, blow.value, rcond=None)[0]
        return np.asarray(blow.value - basis @ weights, dtype=float)

    count = len(start_hz)
    omega = 2 * np.pi * np.array(start_hz)
    start = np.concatenate([omega, 0.02 * omega])
    low, high = np.concatenate([omega / NEAR, 0 * omega]), np.concatenate([omega * NEAR, omega])
    fit = least_squares(left, start, bounds=(low, high), x_scale=start)
    residual, jacobian = fit.fun, np.asarray(fit.jac)
    free = len(time) - 4 * count - 1
    if free < LEAST_SAMPLES // 2:
        return None, None
    variance = float(residual @ residual) / free * _correlated(residual)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    w, a = fit.x[0], fit.x[count]
    own = covariance[np.ix_([0, count], [0, count])]
    natural = float(np.hypot(w, a))
    slopes = np.array(
        [[w / natural / (2 * np.pi), a / natural / (2 * np.pi)], [-a * w / natural**3, w**2 / natural**3]]
    )
    std = np.sqrt(np.maximum(np.diag(slopes @ own @ slopes.T), 0.0))
    at_bound = min(abs(w - low[0]), abs(w - high[0])) < 1e-6 * w
    if at_bound or not std[0] < 0.1 * natural / (2 * np.pi):
        return None, None
    frequency = Estimate.normal(natural / (2 * np.pi), float(std[0]), low=0.0)
    return frequency, Estimate.normal(a / natural, float(std[1]), low=0.0) if a > 0 else None


def _correlated(residual: FloatArray) -> float:
    """Return by how much residuals that hang together over time say less than as many independent ones."""
    power, total = float(residual @ residual), 1.0
    for lag in range(1, len(residual) // 4):
        share = float(residual[lag:] @ residual[:-lag]) / power if power > 0 else 0.0
        if share < 0.05:
            break
        total += 2 * share
    return total


def _decays(envelope: FloatArray) -> bool:
    """Say whether a record begins with its blow: it falls from the first, instead of being loud throughout."""
    tenth = max(len(envelope) // 10, 1)
    return bool(envelope[:tenth].max() > RISE * envelope[-tenth:].max())


def _vertex(x: FloatArray, y: FloatArray, place: int) -> float:
    """Return where a parabola through a peak and its neighbours, in the logarithm, is highest."""
    left, middle, right = np.log(np.maximum(y[place - 1 : place + 2], 1e-300))
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(x[place] + shift * (x[1] - x[0]))
