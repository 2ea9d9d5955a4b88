"""How frequency and damping depend on the amplitude: by one nonlinear decay, and by plain decays piece by piece."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tagsway.modal.bound import to_modal
from tagsway.modal.decay import ALPHA, COSINE, GAIN, OMEGA, PLACES, SINE, SLOPE, Terms, predict
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.delta import damping_at, estimate_of, frequency_at
from tagsway.modal.least_squares import DecayFit, Samples, fit_decay, fit_linear_part
from tagsway.modal.sway import Sway
from tagsway.model import SCALE_STD, BackbonePoint, Estimate, FloatArray

PIECES = 6
"""At most so many pieces of a decay are fitted one by one."""

PIECE_CYCLES = 3.0
"""At least so many cycles are in a piece."""


def mean_amplitude(sway: Sway, fit: DecayFit, relative: FloatArray, *, metres: bool) -> Estimate:
    """Return the mean amplitude over the window; in metres with the error of the scale, which no residual shows."""
    start = _amplitude(sway, fit)
    way = float(np.hypot(fit.parameters[COSINE], fit.parameters[SINE]))
    share = float(np.mean(np.abs(sway.chord(way * relative)))) / max(float(np.abs(sway.chord(np.array(way)))), 1e-300)
    scale = SCALE_STD * start.value if metres else 0.0
    return Estimate.normal(share * start.value, share * float(np.hypot(start.std, scale)), low=0.0)


def _amplitude(sway: Sway, fit: DecayFit) -> Estimate:
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    gradient = np.zeros(len(p))
    gradient[[COSINE, SINE]] = p[COSINE] / way, p[SINE] / way
    angle = sway.curvature * way
    if angle > 0 and not sway.angular:
        # Beyond a right angle the bob comes back over the main axis: the farthest point is the radius.
        value = float(np.sin(min(angle, np.pi / 2))) / sway.curvature
        return estimate_of(fit, value, gradient * max(float(np.cos(angle)), 0.0), low=0.0)
    return estimate_of(fit, way, gradient, low=0.0)


def draw_backbone(sway: Sway, fit: DecayFit, last: float) -> tuple[BackbonePoint, ...]:
    """Return frequency and ζ from the first amplitude to the last, relative one; empty where neither depends on it."""
    if not (fit.terms.softening or fit.terms.drag or fit.terms.friction) or not last < 1:
        return ()
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    return tuple(
        BackbonePoint(
            amplitude_m=float(abs(sway.chord(np.array(way * relative)))),
            frequency_hz=estimate_of(fit, *frequency_at(fit, relative**2), low=0.0),
            damping_ratio=estimate_of(fit, *damping_at(fit, relative), low=0.0),
        )
        for relative in (float(x) for x in np.linspace(1.0, max(last, 0.05), 5))
    )


def fit_pieces(sway: Sway, samples: Samples, fit: DecayFit) -> tuple[BackbonePoint, ...]:
    """Return undamped frequency and ζ of plain decays, fitted piece by piece: the backbone without a model of it.

    Parameters
    ----------
    sway : Sway
        For its path.
    samples : Samples
        What was fitted.
    fit : DecayFit
        Of these samples: where the pieces start, and what further modes and drift are taken off.

    Returns
    -------
    tuple of BackbonePoint
        Largest amplitude first, at each piece's mean; empty where there are fewer than two pieces of three cycles.
    """
    cycles = float(fit.parameters[OMEGA]) / (2 * np.pi) * float(samples.time_s[-1])
    count = min(PIECES, int(cycles / PIECE_CYCLES), len(samples.time_s) // 20)
    if count < 2:
        return ()
    single = replace(fit.terms, slope=False, driven=False, further=0)
    alone = fit.parameters[:PLACES].copy()
    alone[[SLOPE, GAIN]] = 0.0
    rest = samples.value - fit.residual - predict(samples.time_s, alone, single)[0]
    edges = np.linspace(0, len(samples.time_s), count + 1).astype(int)
    points = []
    for first, last in pairwise(edges):
        start = float(samples.time_s[first])
        piece = Samples(
            time_s=samples.time_s[first:last] - start,
            value=(samples.value - rest)[first:last],
            spread=samples.spread[first:last],
            stated=samples.stated,
            pulled=samples.pulled,
            common=None if samples.common is None else samples.common[first:last],
        )
        p, scale = fit_linear_part(piece, float(fit.parameters[OMEGA]), float(fit.parameters[ALPHA]))
        local = fit_decay(piece, p, Terms(projected=fit.terms.projected), scale=max(scale, 1e-3 * fit.scale))
        value, jacobian = to_modal(local.parameters)
        lasting = find_envelope(piece.time_s, float(local.parameters[ALPHA]), 0.0)[0]
        way = float(np.hypot(local.parameters[COSINE], local.parameters[SINE])) * float(np.mean(lasting))
        points.append(
            BackbonePoint(
                amplitude_m=float(abs(sway.chord(np.array(way)))),
                frequency_hz=estimate_of(local, float(value[0]), jacobian[0], low=0.0),
                damping_ratio=estimate_of(local, float(value[1]), jacobian[1]),
            )
        )
    return tuple(points)
