"""How many modes a decay has: a second body's, or the twin out of the plane that makes it beat."""

from dataclasses import replace

import numpy as np

from tagsway.modal.bound import pole_places
from tagsway.modal.decay import ALPHA, OMEGA, predict, slowed_by
from tagsway.modal.least_squares import DecayFit, Samples, Softening, extend, fit_decay, misfit, solve
from tagsway.modal.spectrum import find_peaks_of, find_spectrum
from tagsway.model import FloatArray

MOST = 2
"""Further modes that are looked for."""

NEEDED = 6.5
"""Standard errors by which a further mode's amplitude must exceed nothing: it was searched for, as the first was."""

NEEDED_CYCLES = 2.0
"""Of a further mode and of the first, until a tenth of it is left: together they draw any short wandering."""

NEARBY = (0.5, 1.0, 1.5, 2.2, 3.0)
"""Distances of a close mode that are tried, in periods of the beat inside the window."""

FASTEST = 0.9
"""Of half the rate of the images: a coder that keeps more of every second image makes its own swing beyond."""

CODED_ALIKE, SMALL_SHARE = 4, 0.02
"""A codec treats every second or fourth picture alike, so that the sway is seen once more, that much smaller, beside
half and a quarter of the frame rate."""

RESOLVED = 0.4
"""Part of a beat that must be seen: two modes closer than that only bend one envelope."""


def choose_modes(
    samples: Samples, fit: DecayFit, *, prior: Softening | None = None, straight: bool = False
) -> DecayFit:
    """Return the fit with the terms and the number of modes that its information criterion chooses.

    Parameters
    ----------
    samples : Samples
        What is fitted.
    fit : DecayFit
        Of the first mode, with the terms that are sure.
    prior, straight
        As in `extend`.

    Returns
    -------
    DecayFit
        The largest mode is the first.

    Notes
    -----
    A beat of two close modes looks like odd damping, so both explanations are carried to their end: drag, friction
    and softening first and modes after them, and modes first. The Bayesian information criterion
    -2 ln L + k ln n decides, on as many samples as the residual's colour leaves independent. Where a single mode
    leaves white noise, there is nothing to look for.
    """
    plain = extend(samples, fit, prior=prior, straight=straight)
    if not _is_coloured(plain):
        return plain
    after = add_modes(samples, plain, prior=prior, straight=straight)
    found = [plain] if after is plain else [plain, after]
    before = add_modes(samples, fit, prior=prior, straight=straight) if plain is not fit else fit
    if before is not fit:
        found.append(before)
    best = _choose(samples, found)
    if best is before:
        best = _choose(samples, [before, extend(samples, before, prior=prior, straight=straight)])
    return best


def _choose(samples: Samples, fits: list[DecayFit]) -> DecayFit:
    scale = min(one.scale for one in fits)
    share = max(one.freedom for one in fits) / len(samples.value)

    def score(one: DecayFit) -> float:
        # The frequency of a further mode was searched for: it counts twice.
        count = len(one.terms.free) + one.terms.further
        return share * misfit(samples, one, scale=scale) + count * float(np.log(len(samples.value)))

    return min(fits, key=score)


def _is_coloured(fit: DecayFit) -> bool:
    return fit.freedom < 0.9 * (len(fit.residual) - len(fit.terms.free))


def add_modes(samples: Samples, fit: DecayFit, *, prior: Softening | None = None, straight: bool = False) -> DecayFit:
    """Return the fit with as many further modes as stand out of what it leaves; the same where none does."""
    for _ in range(MOST):
        if len(samples.value) < 4 * (len(fit.terms.free) + 4) or not _is_coloured(fit):
            break
        more = _add_mode(samples, fit, prior=prior, straight=straight)
        if more is None:
            break
        fit = more
    return _largest_first(samples, fit, prior=prior)


def find_rival(samples: Samples, fit: DecayFit, *, prior: Softening | None = None) -> DecayFit | None:
    """Return what one more mode would make of a fit, where it explains much and yet was not believed.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        As it was chosen.
    prior : Softening, optional
        As it was used.

    Returns
    -------
    DecayFit or None
        None where the fit leaves white noise, or no mode explains what it leaves.

    Notes
    -----
    A second body that swings far is no linear mode: what it leaves is so coloured that nothing stands out of it. How
    far it pulls the first mode's pole is then not known better than by the two fits' distance.
    """
    if not _is_coloured(fit) or len(samples.value) < 4 * (len(fit.terms.free) + 4):
        return None
    return min(_try_modes(samples, fit, prior=prior), key=lambda more: more.scale, default=None)


def _add_mode(samples: Samples, fit: DecayFit, *, prior: Softening | None, straight: bool) -> DecayFit | None:
    found, mode = [], fit.terms.further + 1
    for more in _try_modes(samples, fit, prior=prior):
        if not _stands_out(more, mode=mode):
            # What drag or friction leaves colours the residual, and hides a mode until it is fitted along.
            more = extend(samples, more, prior=prior, straight=straight)
        if _stands_out(more, mode=mode) and _is_another(samples, more, mode=mode):
            found.append(more)
    return min(found, key=lambda more: more.scale, default=None)


def _try_modes(samples: Samples, fit: DecayFit, *, prior: Softening | None) -> list[DecayFit]:
    """Return fits with one more mode that leave clearly less."""
    terms = replace(fit.terms, further=fit.terms.further + 1)
    found = []
    few = _every_kth(samples)
    for start in _candidates(samples, fit):
        near = solve(few, start, terms, scale=fit.scale, prior=prior)[0]
        more = fit_decay(samples, near, terms, scale=fit.scale, prior=prior)
        gain = misfit(samples, fit, scale=more.scale) - misfit(samples, more, scale=more.scale)
        if gain > 4 * np.log(len(samples.value)) and _is_another(samples, more, mode=terms.further):
            found.append(more)
    return found


def _every_kth(samples: Samples) -> Samples:
    """Return fewer samples to search on."""
    return replace(samples.part(slice(None, None, max(1, len(samples.time_s) // 800))), common=None)


def _stands_out(fit: DecayFit, *, mode: int) -> bool:
    return all(amplitude_significance(fit, mode=k) > NEEDED for k in (0, mode))


def _is_another(samples: Samples, fit: DecayFit, *, mode: int) -> bool:
    """Whether a mode is seen for long enough, and apart from the others, to be one of its own."""
    omega, alpha = fit.parameters[pole_places(mode)]
    span = float(samples.time_s[-1] - samples.time_s[0])
    cycles = min(fit.parameters[pole_places(k)[0]] / (2 * np.pi) * _lasting(fit, span, k) for k in (0, mode))
    if not (cycles >= NEEDED_CYCLES and alpha > -1 / span):
        return False
    # An overtone belongs to the first mode's path, not to another body: of a large swing it is as slow as that.
    ratio, slowed = omega / fit.parameters[OMEGA], abs(slowed_by(fit.parameters, fit.terms, 1.0)[0])
    if any((0.98 - slowed) * k < ratio < 1.02 * k for k in (2, 3)):
        return False
    if _is_codecs(samples, fit, mode):
        return False
    apart = min(abs(omega - fit.parameters[pole_places(k)[0]]) * _lasting(fit, span, k, mode) for k in range(mode))
    turn = omega * float(np.median(np.diff(samples.time_s)))
    return bool(0.02 < ratio < 50 and turn < FASTEST * np.pi and apart > RESOLVED * 2 * np.pi)


def _is_codecs(samples: Samples, fit: DecayFit, mode: int) -> bool:
    """Whether a mode is the first one's image at a part of the rate of the samples."""
    (omega, _, *both), first = fit.parameters[pole_places(mode)[0] :][:4], float(fit.parameters[OMEGA])
    if not np.hypot(*both) < SMALL_SHARE * np.hypot(*fit.parameters[[k + 2 for k in pole_places(0)]]):
        return False
    rate = 2 * np.pi / float(np.median(np.diff(samples.time_s)))
    beat = 2 * np.pi / float(samples.time_s[-1] - samples.time_s[0])
    images = [part * rate / CODED_ALIKE + side * first for part in (1, 2) for side in (-1, 1)]
    return min(abs(float(omega) - image) for image in images) < beat


def _lasting(fit: DecayFit, span_s: float, *modes: int) -> float:
    """Return how long all of these modes are seen: until a tenth of one is left, or the window ends."""
    rates = [float(fit.parameters[pole_places(k)[1]]) for k in modes]
    return min([span_s, *(float(np.log(10)) / rate for rate in rates if rate > 0)])


def amplitude_significance(fit: DecayFit, *, mode: int = 0) -> float:
    """Return a mode's amplitude over its standard error, the residual's colour paid for."""
    both = [k + 2 for k in pole_places(mode)]
    amplitude = fit.parameters[both]
    precision = np.linalg.pinv(fit.covariance[np.ix_(both, both)], hermitian=True)
    return float(np.sqrt(max(float(amplitude @ precision @ amplitude), 0.0)))


def _candidates(samples: Samples, fit: DecayFit) -> list[FloatArray]:
    """Return start values with one more mode: the two poles that explain most of what is left."""
    time, p = samples.time_s, fit.parameters
    span = float(time[-1] - time[0])
    tops = find_peaks_of(find_spectrum(time, fit.residual), lowest_hz=0.8 / span, count=3)
    poles = [(2 * np.pi * f, k / span) for f in tops for k in (0.3, 2.0, 8.0)]
    beat, slow = 2 * np.pi / span, max(float(p[ALPHA]), 0.1 / span)
    poles += [(float(p[OMEGA]) + sign * k * beat, slow) for k in NEARBY for sign in (-1, 1)]
    # Every k-th sample tells as well which one it is.
    few = slice(None, None, max(1, len(time) // 3000))
    rows = predict(time, p, fit.terms, samples.drive)[1][few, fit.terms.free] / samples.spread[few, None]
    basis = np.linalg.qr(rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300))[0]
    left = np.clip(fit.residual / samples.spread, -3 * fit.scale, 3 * fit.scale)[few]
    ranked = []
    for omega, alpha in poles:
        if not omega > 0.5 * beat:
            continue
        turn = np.exp((-alpha + 1j * omega) * time[few]) / samples.spread[few]
        columns = np.column_stack([turn.real, turn.imag])
        outside = columns - basis @ (basis.T @ columns)
        size, *_ = np.linalg.lstsq(outside, left, rcond=1e-6)
        ranked.append((float(np.sum((outside @ size) ** 2)), [omega, alpha, *size]))
    ranked.sort(key=lambda one: -one[0])
    return [np.concatenate([p, start]) for _, start in ranked[:2]]


def _largest_first(samples: Samples, fit: DecayFit, *, prior: Softening | None) -> DecayFit:
    """Return the fit with the mode of most energy in the first place."""
    if fit.terms.further == 0:
        return fit
    span = float(samples.time_s[-1] - samples.time_s[0])
    energy = [mode_energy(fit, mode, span) for mode in range(fit.terms.further + 1)]
    largest = int(np.argmax(energy))
    if largest == 0:
        return fit
    first, other = ([*pole_places(k), *(i + 2 for i in pole_places(k))] for k in (0, largest))
    p = fit.parameters.copy()
    p[first], p[other] = fit.parameters[other], fit.parameters[first]
    return fit_decay(samples, p, fit.terms, scale=fit.scale, prior=prior)


def mode_energy(fit: DecayFit, mode: int, span_s: float) -> float:
    """Return the mean square of a mode over a span from the start, at its linear damping."""
    at = pole_places(mode)
    lost = np.clip(2 * fit.parameters[at[1]] * span_s, -20, 600)
    size = float(np.sum(fit.parameters[[k + 2 for k in at]] ** 2))
    return size / 2 * float(-np.expm1(-lost) / lost if abs(lost) > 1e-6 else 1.0)
