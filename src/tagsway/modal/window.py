"""Where a record holds a free vibration."""

from dataclasses import dataclass

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.decay import OMEGA, PROJECTION, Terms, predict
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.least_squares import DecayFit, Samples, extend, fit_decay
from tagsway.modal.peaks import find_peaks
from tagsway.modal.significance import require_oscillation, significance
from tagsway.modal.spectrum import find_peaks_of, find_spectrum
from tagsway.modal.start import find_start
from tagsway.modal.sway import MAD_TO_STD, measure_sway, remove_spikes
from tagsway.model import BoolArray, CleanTagTrack, CleanTrack, FloatArray, TagTrack, Track, Window

MOVING = 0.05
"""Share of the tool's largest speed above which it moves."""

DEPARTED = 0.03
"""Share of the amplitude by which a motion may leave the decay that it followed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Candidate:
    window: Window
    score: float


def find_window(track: Track, clean: CleanTrack) -> Window:
    """Find the free vibration: after the move or the release, before a contact, a jump or a loss.

    Parameters
    ----------
    track : Track
        Raw.
    clean : CleanTrack
        The same without spikes; of the tool, its velocity.

    Returns
    -------
    Window

    Raises
    ------
    NotIdentifiableError
        Where nothing swings freely.

    Notes
    -----
    Only where the tool is at rest is a swing free. There, the longest run of extremes in even time and with falling
    swings is the core; a decay is fitted to it and followed outwards until the motion leaves it, or the record ends.
    An eighth of a period is kept from where it left.
    """
    seen = np.count_nonzero(np.all(np.isfinite(track.pcp.position[:, :1]), axis=1))
    if seen < 8:
        raise NotIdentifiableError(
            f"nothing swings: the product's tag was seen {seen} times, at least 8 are needed (is its id right?)"
        )
    reasons, found = [], []
    for rest in find_rests(track, clean):
        try:
            found.append(_find_free(track, rest))
        except NotIdentifiableError as error:
            reasons.append(str(error))
    if not found:
        reason = reasons[0] if len(reasons) == 1 else "nothing swings while the tool is at rest"
        raise NotIdentifiableError(reason)
    return max(found, key=lambda candidate: candidate.score).window


def find_rests(track: Track, clean: CleanTrack) -> list[Window]:
    """Return the parts of a record in which the tool is at rest.

    Parameters
    ----------
    track : Track
        Raw.
    clean : CleanTrack
        The same without spikes.

    Returns
    -------
    list of Window
        The whole record where there is no tool or it never moves beyond its noise.
    """
    time = track.time_s
    whole = [Window(start_s=float(time[0]), end_s=float(time[-1]))]
    if track.tcp is None or clean.tcp is None:
        return whole
    speed = np.hypot(*clean.tcp.velocity.T)
    noise = _noise_of(track.tcp)
    place = clean.tcp.position[np.all(np.isfinite(clean.tcp.position), axis=1)]
    if len(place) < 8:
        return whole
    travel = float(np.hypot(*np.ptp(place, axis=0)))
    product = np.nanpercentile(track.pcp.position, [2, 98], axis=0)
    if not travel > max(8 * noise, 0.02 * float(np.nanmax(product[1] - product[0]))):
        return whole
    resting = ~(speed > MOVING * float(np.nanmax(speed)))
    rests = []
    for first, last in _runs(resting):
        first = _settled(clean.tcp, first, last, tolerance=max(5 * noise, 5e-4 * travel))
        # The clean track has spread the end of the motion over its own response: half of it is left out.
        blur = 0.5 / clean.tcp.bandwidth_hz if clean.tcp.bandwidth_hz > 0 else 0.0
        after = time[first] + (blur if first > 0 else 0.0)
        before = time[last] - (blur if last < len(time) - 1 else 0.0)
        first, last = int(np.searchsorted(time, after)), int(np.searchsorted(time, before, side="right")) - 1
        if last - first >= 8:
            rests.append(Window(start_s=float(time[first]), end_s=float(time[last])))
    return rests


def _noise_of(tag: TagTrack) -> float:
    return max((estimate_noise(axis[np.isfinite(axis)]) for axis in tag.position.T), default=0.0)


def estimate_noise(value: FloatArray) -> float:
    """Return the white noise of a smooth signal, from its third differences.

    Parameters
    ----------
    value : ndarray, shape (n,)
        Finite.

    Returns
    -------
    float
        Its standard deviation; 0 for fewer than 4 samples.
    """
    if len(value) < 4:
        return 0.0
    return MAD_TO_STD * float(np.median(np.abs(np.diff(value, 3)))) / float(np.sqrt(20))


def _runs(true: BoolArray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _settled(tool: CleanTagTrack, first: int, last: int, *, tolerance: float) -> int:
    """Return from where the tool stays at its place; the run's first sample where it rings on and on."""
    position = tool.position[first : last + 1]
    final = np.nanmedian(position[len(position) // 2 :], axis=0) if np.any(np.isfinite(position)) else np.zeros(2)
    outside = np.flatnonzero(np.hypot(*(position - final).T) > tolerance)
    if outside.size == 0 or outside[-1] > 0.5 * len(position):
        return first
    return first + int(outside[-1]) + 1


def _find_free(track: Track, rest: Window) -> _Candidate:
    where = f"between {rest.start_s:g} and {rest.end_s:g} s"
    sway = measure_sway(track, rest, arc=False)
    samples = Samples(time_s=sway.time_s - rest.start_s, value=sway.value, spread=sway.spread)
    if len(samples.time_s) < 8 or not float(np.ptp(samples.value)) > 0:
        raise NotIdentifiableError(f"nothing swings {where}: the product does not move")
    core = _find_core(samples)
    if core is None:
        # A swing or two between the ends of a short record: the whole of it, if nothing but white noise is left.
        fit = _fit(samples)
        if not fit.freedom > 0.5 * len(samples.time_s):
            raise NotIdentifiableError(f"nothing swings {where}: no run of even, decaying swings")
        require_oscillation(fit, samples, where=where)
        return _Candidate(window=rest, score=significance(fit))
    thin = _thin(samples, core)
    start, end, fit = _follow(thin, core[0], core[1])
    end = float(samples.time_s[-1]) if end >= thin.time_s[-1] else end
    require_oscillation(fit, _cut(samples, start, end), where=where)
    window = Window(start_s=rest.start_s + start, end_s=rest.start_s + end)
    return _Candidate(window=window, score=significance(fit))


def _thin(samples: Samples, core: tuple[float, float, float]) -> Samples:
    """Return every k-th sample of a long record: its window needs no more than 16 of them in a period."""
    step = float(np.median(np.diff(samples.time_s)))
    k = max(1, min(len(samples.time_s) // 2000, int(core[2] / step / 16)))
    return Samples(time_s=samples.time_s[::k], value=samples.value[::k], spread=samples.spread[::k])


def _find_core(samples: Samples) -> tuple[float, float, float] | None:
    """Return the strongest run of at least three extremes, even in time and swinging less and less, and its period."""
    value = remove_spikes(samples.value)
    span = float(samples.time_s[-1] - samples.time_s[0])
    trend = np.polyval(np.polyfit(samples.time_s, value, 1), samples.time_s)
    noise = estimate_noise(value)
    best, best_score = None, 0.0
    for hz in {
        hz
        for shape in (value, value - trend)
        for hz in find_peaks_of(find_spectrum(samples.time_s, shape), lowest_hz=0.8 / span, count=3)
    }:
        peaks = find_peaks(samples.time_s, value, 1 / hz)
        for first, last in _even_runs(peaks.time_s, peaks.value, 1 / hz, floor=4 * noise):
            swings = np.diff(peaks.value[first : last + 1])
            score = float(np.sum(swings**2))
            if score > best_score:
                best, best_score = _inner(peaks.time_s[first : last + 1], 1 / hz), score
    return best


def _inner(time_s: FloatArray, period_s: float) -> tuple[float, float, float]:
    """Return a run without its outermost extremes: a payload that is still held has a peak before it swings."""
    inner = time_s[1:-1] if len(time_s) >= 5 else time_s
    return float(inner[0]), float(inner[-1]), period_s


def _even_runs(time_s: FloatArray, value: FloatArray, period_s: float, *, floor: float) -> list[tuple[int, int]]:
    half, swing = np.diff(time_s) / (period_s / 2), np.abs(np.diff(value))
    runs, first = [], 0
    for k in range(len(half) + 1):
        fits = k < len(half) and 0.75 < half[k] < 1.3 and swing[k] > floor
        follows = fits and (k == first or 0.25 < swing[k] / swing[k - 1] < 1.2)
        if follows:
            continue
        if k - first >= 2:
            runs.append((first, k))
        first = k if fits else k + 1
    return runs


def _cut(samples: Samples, start: float, end: float) -> Samples:
    inside = (samples.time_s >= start - 1e-9) & (samples.time_s <= end + 1e-9)
    return Samples(time_s=samples.time_s[inside] - start, value=samples.value[inside], spread=samples.spread[inside])


def _fit(samples: Samples) -> DecayFit:
    begun = find_start(samples)
    if begun is None:
        raise NotIdentifiableError("nothing swings: too few samples of the product")
    return extend(samples, fit_decay(samples, begun[0], Terms(shape=PROJECTION), scale=begun[1]))


def _follow(samples: Samples, start: float, end: float) -> tuple[float, float, DecayFit]:
    """Follow the decay outwards from its core until the motion leaves it."""
    first, last = float(samples.time_s[0]), float(samples.time_s[-1])
    closed_low = closed_high = False
    for _ in range(12):
        fit = _fit(_cut(samples, start, end))
        period = 2 * np.pi / float(fit.parameters[OMEGA])
        reach = max(period, 0.5 * (end - start))
        # Backwards a decay grows: half a period at a time.
        low = start if closed_low else max(first, start - min(reach, period))
        high = end if closed_high else min(last, end + reach)
        left, right = _departures(samples, fit, start, end, low, high)
        start, closed_low = (low, low <= first) if left is None else (left + period / 8, True)
        end, closed_high = (high, high >= last) if right is None else (right - period / 8, True)
        if closed_low and closed_high:
            break
    fit = _fit(_cut(samples, start, end))
    return start, end, fit


def _departures(
    samples: Samples, fit: DecayFit, start: float, end: float, low: float, high: float
) -> tuple[float | None, float | None]:
    """Return where the motion leaves the decay before `start` and after `end`; None where it does not."""
    inside = (samples.time_s >= low - 1e-9) & (samples.time_s <= high + 1e-9)
    time = samples.time_s[inside]
    if len(time) == 0:
        return None, None
    # The model counts from its own start; before that, time is negative and so is its integral's sign.
    shifted = time - start
    value = _predict_around(shifted, fit)
    alpha, drag = fit.parameters[1], fit.parameters[6]
    size = float(np.hypot(*fit.parameters[2:4])) * find_envelope(shifted, alpha, drag)[0]
    count = max(3, int(len(time) * (np.pi / 8 / fit.parameters[OMEGA]) / max(high - low, 1e-9)))
    count = min(count, len(time))
    residual = np.abs(samples.value[inside] - value)
    # Most of a sixteenth of a period must be away: a spike is not a departure.
    away = residual > np.maximum(5 * fit.scale * samples.spread[inside], DEPARTED * size)
    share = np.convolve(away, np.ones(count) / count, mode="same")
    gone = share > 0.6
    before, after = np.flatnonzero(gone & (time < start)), np.flatnonzero(gone & (time > end))
    return (
        float(time[before[-1]]) if before.size else None,
        float(time[after[0]]) if after.size else None,
    )


def _predict_around(time_s: FloatArray, fit: DecayFit) -> FloatArray:
    """Return the decay at times before and after its start."""
    before = time_s < 0
    after = predict(time_s[~before], fit.parameters, fit.terms)[0] if np.any(~before) else np.empty(0)
    back = np.empty(0)
    if np.any(before):
        back = predict(time_s[before][::-1], fit.parameters, fit.terms)[0][::-1]
    return np.concatenate([back, after])
