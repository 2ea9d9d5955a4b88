"""Where a record holds a free vibration."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.core import Core, average_over, find_core, top_frequencies
from tagsway.modal.decay import OMEGA, Terms, predict
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.least_squares import DecayFit, Samples, extend, fit_decay
from tagsway.modal.modes import add_modes
from tagsway.modal.rests import find_rests
from tagsway.modal.significance import require_oscillation, significance
from tagsway.modal.start import find_start
from tagsway.modal.sway import measure_sway, remove_spikes
from tagsway.model import CleanTrack, Event, FloatArray, Notice, Track, Window

DEPARTED = 0.03
"""Share of the amplitude by which a motion may leave the decay that it followed."""

FITTED_PERIODS = 60
"""That are fitted to follow a decay past their end; a longer one is followed by what is nearest."""

BROKEN = 0.4
"""Share of the amplitude by which the second half of a core may leave what its first half foretells: a contact's swings
may be even, too, and a decay's frequency changes with its amplitude."""

VISIBLE = 8.0
"""Standard errors of an amplitude above which a decay is followed by its latest piece."""

LARGEST_RAD = 1.3
"""Swing of a recorded angle up to which a decay is sought: beyond, the expansion of its frequency leaves its ground."""

REGRIPPED = 0.5
"""Of the scatter of a product's places, that two places explain where it was held at one after the other."""

LEAST_BESIDE = 16
"""Samples, of a rest in which a product may have been held at two places."""

REMEDIES = {
    "peel_off": "move it more gently, or hold it better",
    "product_lost": "keep it in the picture, and hands off its tag, until it has swung out",
}
"""What is to be done about an event that ends a grip too soon."""

MOST_SAMPLES = 6000
"""In which a swing that has no visible extremes is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeVibration:
    """A free vibration, and why it was chosen.

    Parameters
    ----------
    window : Window
        From its begin to its end.
    notices : tuple of Notice
        Where there were others.
    """

    window: Window
    notices: tuple[Notice, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Candidate:
    """`regrip_s` is when the product was taken to another place beside it, if it was."""

    window: Window
    score: float
    regrip_s: float | None = None


def find_window(track: Track, clean: CleanTrack, *, events: Sequence[Event] = ()) -> Window:
    """Find the free vibration: after the move or the release, before a contact, a jump or a loss.

    Parameters
    ----------
    track, clean, events
        As in `find_free_vibration`.

    Returns
    -------
    Window

    Raises
    ------
    NotIdentifiableError
        Where nothing swings freely.
    """
    return find_free_vibration(track, clean, events=events).window


def find_free_vibration(track: Track, clean: CleanTrack, *, events: Sequence[Event] = ()) -> FreeVibration:
    """Find the free vibration, and say why it is this one.

    Parameters
    ----------
    track : Track
        Raw.
    clean : CleanTrack
        The same without spikes; of the tool, its velocity.
    events : sequence of Event
        What happened to the grip: what follows a peel-off, or a loss, is not looked at; a slip parts what is before
        from what is after it.

    Returns
    -------
    FreeVibration

    Raises
    ------
    NotIdentifiableError
        Where nothing swings freely.

    Notes
    -----
    Only where the tool is at rest is a swing free. There, the longest run of extremes in even time and with falling
    swings is the core; a decay is fitted to it and followed outwards until the motion leaves it, or the record ends.
    An eighth of a period is kept from where it left. Backwards that is where higher modes have died, unless they are a
    part of what the decay leaves throughout: those are fitted later. Of several rests, the one is taken whose decay
    stands farthest out of the noise.
    """
    seen = np.count_nonzero(np.isfinite(track.pcp.position[:, 0]))
    if seen < 8:
        raise NotIdentifiableError(
            f"nothing swings: the product's tag was seen {seen} times, at least 8 are needed (is its id right?)"
        )
    parted = min((event for event in events if event.ends_grip), key=lambda event: event.time_s.value, default=None)
    last_s = float("inf") if parted is None else parted.time_s.value
    found: list[_Candidate] = []
    failed: list[tuple[Window, str]] = []
    for rest in _between_slips(find_rests(track, clean), events):
        if not rest.start_s < last_s:
            continue
        rest = _after_large_swings(track, replace(rest, end_s=min(rest.end_s, last_s)))
        try:
            found.append(_find_free(track, rest))
        except NotIdentifiableError as error:
            parts = _find_beside_regrip(track, rest)
            found += parts
            failed += [] if parts else [(rest, str(error))]
    if not found and parted is not None:
        raise NotIdentifiableError(
            f"nothing swings freely before {parted.time_s.value:.2f} s, where {parted.words}: {REMEDIES[parted.kind]}",
            code=parted.kind,
        )
    if not found:
        raise NotIdentifiableError(_why_nothing(failed))
    best = max(found, key=lambda candidate: candidate.score)
    return FreeVibration(window=best.window, notices=_explain(best, found))


def _find_beside_regrip(track: Track, rest: Window) -> list[_Candidate]:
    """Return what swings before and after the product was taken to another place; nothing where it was not."""
    sway = measure_sway(track, rest, arc=False)
    place = np.column_stack([sway.along, sway.across])
    count = np.arange(1, len(place))[:, None]
    if not len(place) > 2 * LEAST_BESIDE:
        return []
    before = np.cumsum(place, axis=0)[:-1]
    apart = before / count - (np.sum(place, axis=0) - before) / (len(place) - count)
    explained = np.sum(apart**2, axis=1) * (count * (len(place) - count))[:, 0] / len(place)
    last = LEAST_BESIDE // 2 + int(np.argmax(explained[LEAST_BESIDE // 2 : -LEAST_BESIDE // 2]))
    if not explained[last] > REGRIPPED * float(np.sum((place - place.mean(axis=0)) ** 2)):
        return []
    found = []
    for start, end in ((rest.start_s, float(sway.time_s[last])), (float(sway.time_s[last + 1]), rest.end_s)):
        with suppress(NotIdentifiableError):
            found.append(
                replace(_find_free(track, Window(start_s=start, end_s=end)), regrip_s=float(sway.time_s[last]))
            )
    return found


def _why_nothing(failed: Sequence[tuple[Window, str]]) -> str:
    """Return why nothing was found: of several rests, what the longest one showed."""
    if not failed:
        return "nothing swings while the tool is at rest"
    rest, reason = max(failed, key=lambda one: one[0].end_s - one[0].start_s)
    where = f"of {len(failed)} rests of the tool the longest, {rest.start_s:.2f} to {rest.end_s:.2f} s: "
    return reason if len(failed) == 1 else where + reason


def _between_slips(rests: Sequence[Window], events: Sequence[Event]) -> list[Window]:
    """Return the rests without the moments at which the grip slipped: a step in z would pass for the sway's axis."""
    slips = sorted(event.time_s.ci95 for event in events if not event.ends_grip)
    parts = []
    for rest in rests:
        start = rest.start_s
        for first, last in [*slips, (rest.end_s, rest.end_s)]:
            if min(first, rest.end_s) > start:
                parts.append(Window(start_s=start, end_s=min(first, rest.end_s)))
            start = max(start, last)
    return parts


def _after_large_swings(track: Track, rest: Window) -> Window:
    """Return the part of a rest in which a recorded angle stays small; all of it where that part is short."""
    if track.length_unit != "rad":
        return rest
    inside = (track.time_s >= rest.start_s) & (track.time_s <= rest.end_s) & np.isfinite(track.pcp.position[:, 0])
    time, angle = track.time_s[inside], remove_spikes(track.pcp.position[inside, 0])
    level = float(np.median(angle[len(angle) // 2 :])) if len(angle) else 0.0
    large = np.flatnonzero(np.abs(angle - level) > LARGEST_RAD)
    if large.size == 0 or not large[-1] < 0.6 * len(time):
        return rest
    return replace(rest, start_s=float(time[large[-1] + 1]))


def _explain(best: _Candidate, found: Sequence[_Candidate]) -> tuple[Notice, ...]:
    return (*_explain_regrip(best), *_explain_choice(best, found))


def _explain_regrip(best: _Candidate) -> tuple[Notice, ...]:
    if best.regrip_s is None:
        return ()
    side = "before" if best.window.end_s <= best.regrip_s else "after"
    message = f"the product was taken to another place at about {best.regrip_s:.2f} s: only what swings {side} is used"
    return (Notice(code="regripped", message=message),)


def _explain_choice(best: _Candidate, found: Sequence[_Candidate]) -> tuple[Notice, ...]:
    if len(found) == 1:
        return ()
    message = (
        f"the payload swings freely {len(found)} times in this record; {best.window.start_s:.2f}:"
        f"{best.window.end_s:.2f} s is used, where it stands farthest out of the noise (--window takes another)"
    )
    return (Notice(code="several_decays", message=message),)


def _find_free(track: Track, rest: Window) -> _Candidate:
    where = f"between {rest.start_s:g} and {rest.end_s:g} s"
    sway = measure_sway(track, rest, arc=False)
    value = sway.value
    if track.length_unit == "rad" and len(value):
        # As a camera would have seen it: the decay that is followed is that of a projection.
        value = np.sin(np.clip(value - np.median(value), -np.pi / 2, np.pi / 2))
    samples = Samples(time_s=sway.time_s - rest.start_s, value=value, spread=sway.spread)
    # A codec that repeats a rest shows it with less than any noise: what is left of that is no swing.
    least = max(sway.stated_std, sway.pulled_std) if np.isfinite([sway.stated_std, sway.pulled_std]).all() else 0.0
    if len(samples.time_s) < 8 or not float(np.ptp(samples.value)) > least:
        raise NotIdentifiableError(f"nothing swings {where}: the product does not move")
    core = find_core(samples)
    if core is None:
        return _take_whole(samples, rest, where)
    try:
        return _take_around(core, samples, rest, where)
    except NotIdentifiableError as error:
        try:
            return _take_whole(samples, rest, where)
        except NotIdentifiableError:
            raise error from None


def _take_around(core: Core, samples: Samples, rest: Window, where: str) -> _Candidate:
    """Take what a decay around a core explains."""
    thin = average_over(samples, core.period_s)
    start, end, piece, fit = _follow(thin, core)
    end = float(samples.time_s[-1]) if end >= thin.time_s[-1] else end
    start = float(samples.time_s[0]) if start <= thin.time_s[0] else start
    fit = _require_swing(fit, piece, where=where)
    window = Window(start_s=rest.start_s + start, end_s=rest.start_s + end)
    return _Candidate(window=window, score=significance(fit))


def _take_whole(samples: Samples, rest: Window, where: str) -> _Candidate:
    """Take a whole rest with a swing or two in it, if a decay leaves nothing but white noise of it."""
    tops = top_frequencies(samples)
    thin = average_over(samples, 1 / tops[0]) if tops else samples
    if not len(thin.time_s) <= MOST_SAMPLES:
        raise NotIdentifiableError(f"nothing swings {where}: no run of even, decaying swings")
    fit = _fit(thin)
    if not fit.freedom > 0.5 * len(thin.time_s):
        raise NotIdentifiableError(f"nothing swings {where}: no run of even, decaying swings")
    fit = _require_swing(fit, thin, where=where)
    return _Candidate(window=rest, score=significance(fit))


def _require_swing(fit: DecayFit, samples: Samples, *, where: str) -> DecayFit:
    """Return the fit of a swing that stands out of what it leaves, or of a beat of two that do.

    Over a whole beat, no single decay does: what it leaves is as large as the smaller swing.
    """
    try:
        require_oscillation(fit, samples, where=where)
    except NotIdentifiableError:
        beat = add_modes(samples, fit)
        if not beat.terms.further:
            raise
        require_oscillation(beat, samples, where=where)
        return beat
    return fit


def _cut(samples: Samples, start: float, end: float) -> Samples:
    inside = (samples.time_s >= start - 1e-9) & (samples.time_s <= end + 1e-9)
    return Samples(time_s=samples.time_s[inside] - start, value=samples.value[inside], spread=samples.spread[inside])


def _fit(samples: Samples) -> DecayFit:
    begun = find_start(samples)
    if begun is None:
        raise NotIdentifiableError("nothing swings: too few samples of the product")
    return extend(samples, fit_decay(samples, begun[0], Terms(projected=True), scale=begun[1]))


def _reach_of(fit: DecayFit) -> float:
    """Return how long a piece is that is fitted at once."""
    return FITTED_PERIODS * 2 * np.pi / float(fit.parameters[OMEGA])


def _follow(samples: Samples, core: Core) -> tuple[float, float, Samples, DecayFit]:
    """Follow the decay outwards from its core until the motion leaves it; return both ends, its begin, and its fit."""
    start, end, period = core.start_s, _cut_core(samples, core), core.period_s
    first, last = float(samples.time_s[0]), float(samples.time_s[-1])
    closed_low = closed_high = False
    piece = min(end - start, FITTED_PERIODS * period)
    near, begin = _fit(_cut(samples, end - piece, end)), end - piece
    for _ in range(12):
        fit = _fit(_cut(samples, start, min(end, start + piece)))
        period, piece = 2 * np.pi / float(fit.parameters[OMEGA]), _reach_of(fit)
        # Backwards a decay grows: a period at a time.
        low = start if closed_low else max(first, start - period)
        high = end if closed_high else min(last, end + max(period, 0.5 * (end - start)))
        if not end - start > piece:
            near, begin = fit, start
        elif significance(late := _fit(_cut(samples, end - piece, end))) > VISIBLE:
            near, begin = late, end - piece
        left = _departures(samples, fit, start, low, start)
        right = _departures(samples, near, begin, end, high)
        start, closed_low = (low, low <= first) if not left.size else (float(left[-1]) + period / 8, True)
        end, closed_high = (high, high >= last) if not right.size else (float(right[0]) - period / 8, True)
        if closed_low and closed_high:
            break
    begun = _cut(samples, start, min(end, start + piece))
    return start, end, begun, _fit(begun)


def _cut_core(samples: Samples, core: Core) -> float:
    """Return the end of a core, or where its second half is no longer what the first half foretells."""
    middle = (core.start_s + core.end_s) / 2
    piece = min(middle - core.start_s, FITTED_PERIODS * core.period_s)
    first = _cut(samples, core.start_s, core.start_s + piece)
    if not piece > 1.5 * core.period_s:
        return core.end_s
    fit = _fit(first)
    gone = _departures(samples, fit, core.start_s, middle, min(core.end_s, middle + piece), share=BROKEN)
    return float(gone[0]) - core.period_s / 8 if gone.size and significance(fit) > VISIBLE else core.end_s


def _departures(
    samples: Samples, fit: DecayFit, begin: float, low: float, high: float, *, share: float = DEPARTED
) -> FloatArray:
    """Return where, between two times, the motion has left a decay that was fitted from `begin` on."""
    inside = (samples.time_s >= low - 1e-9) & (samples.time_s <= high + 1e-9)
    time = samples.time_s[inside]
    if len(time) == 0 or not high > low:
        return np.empty(0)
    shifted = time - begin
    value, rows = _predict_around(shifted, fit)
    unsure = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows, fit.bound, rows), 0.0))
    alpha, drag = fit.parameters[1], fit.parameters[6]
    size = float(np.hypot(*fit.parameters[2:4])) * find_envelope(shifted, alpha, drag)[0]
    count = max(3, int(len(time) * (np.pi / 8 / fit.parameters[OMEGA]) / (high - low)))
    count = min(count, len(time))
    residual = np.abs(samples.value[inside] - value)
    # Most of a sixteenth of a period must be away: a spike is not a departure.
    away = residual > np.maximum(5 * np.hypot(fit.scale * samples.spread[inside], unsure), share * size)
    gone = np.convolve(away, np.ones(count) / count, mode="same")
    return time[gone > 0.6]


def _predict_around(time_s: FloatArray, fit: DecayFit) -> tuple[FloatArray, FloatArray]:
    """Return the decay at times before and after its start, and its derivatives."""
    before = time_s < 0
    value, rows = np.empty(len(time_s)), np.empty((len(time_s), len(fit.parameters)))
    # Before the start, time is negative and so is its integral's sign.
    for part in (np.flatnonzero(before)[::-1], np.flatnonzero(~before)):
        if len(part):
            value[part], rows[part] = predict(time_s[part], fit.parameters, fit.terms)
    return value, rows
