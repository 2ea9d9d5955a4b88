"""What a pendulum does not explain: how large pushes of unknown course must be, and what they leave unknown.

A second body, a spring that stiffens or a gust push the pendulum by what its equation does not hold; a tag that slips
is seen where it is not; a sway towards the camera does both. The residuals show how large such pushes and
wanderings are, though not their course. Taken as random, each is one more way in which samples err together, and a
parameter is known only as far as it can be told from them.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from tagsway.model import GRAVITY_M_S2, FloatArray, IntArray
from tagsway.pendulum.model import angular_frequency, length_m, stiffness_over_inertia, tag_radius_m
from tagsway.pendulum.problem import Problem, SharedErrors
from tagsway.pendulum.tangent import Tangent

PUSH_KNOTS, LIFT_KNOTS, SLIP_KNOTS = 4.0, 8.0, 2.0
"""Knots a period: of a push, which follows what sways up to twice as fast; of a lift, which comes twice a swing; of a
slip, which may come at any swing."""

HINGES, BODY_FREQUENCIES, BODY_DAMPING = (0.4, 0.9), 2.0 ** np.arange(-1.0, 2.6, 0.25), (0.03, 0.1, 0.3)
"""Light bodies: where on the payload they hang, in its lengths, and their own frequency over the sway's and damping."""

LIKELY = 1.0
"""A size is taken as large as it may be for no more than this beyond the least cost: the end of a 68 % interval."""

SIZES = 10.0 ** np.arange(-6.0, 0.01, 0.25)
"""Sizes that are tried: shares of the pull of spring and gravity at the swing, or of the arm."""

LEAST_GAIN = 6.0
"""By which twice the log-likelihood has to rise, which by chance it does in one of a hundred records."""


class Sizes(NamedTuple):
    """How large what is not modelled is; 0 where none shows.

    Parameters
    ----------
    push : float
        Of the push at a knot, as a share of the pull of spring and gravity at the swing.
    body : float
        Of a light body that hangs from the payload, as a share of its mass.
    slip : float
        Of the tag's random walk on its product, from knot to knot, as a share of the arm.
    lift : float
        Of the tag's lift by a sway across at a knot, as a share of the arm.
    """

    push: float = 0.0
    body: float = 0.0
    slip: float = 0.0
    lift: float = 0.0


BODY = Sizes._fields.index("body")


def find_ways(problem: Problem, parameters: FloatArray, *, pushing: bool = False) -> list[FloatArray]:
    """Return what each kind does to the samples at its unit size, over their noise: shape (samples, knots) each.

    A lift pushes only where it was found without: a slip may look like one that does.
    """
    record, tangent = problem.record, Tangent.of(problem.record, parameters)
    period, arm = 2 * np.pi / float(angular_frequency(parameters)), float(tag_radius_m(parameters))
    nodes = record.nodes_s
    angle = np.abs(tangent.angle_rad[:, 0])
    swing = maximum_filter1d(angle, 2 * round(period / 4 / (nodes[1] - nodes[0])) + 1)
    pull = float(angular_frequency(parameters)) ** 2 * swing[:, None]
    push = tangent.of_push(pull * _bumps(nodes, period / PUSH_KNOTS))

    bodies = tangent.of_push(_reactions(tangent))

    bumps = _bumps(record.time_s, period / LIFT_KNOTS)
    lift = np.zeros((3, *bumps.shape))
    lift[1] = arm * bumps
    lift = _sway_across(tangent, period / LIFT_KNOTS) if pushing else lift

    since = np.arange(nodes[0], nodes[-1], period / SLIP_KNOTS)[1:]
    steps = arm * (record.time_s[:, None] >= since)
    slip = np.zeros((3, len(steps), 2 * len(since)))
    slip[0, :, : len(since)] = slip[1, :, len(since) :] = steps
    return [problem.scaled(way) for way in (push, bodies, slip, lift)]


def find_sizes(problem: Problem, parameters: FloatArray, ways: list[FloatArray]) -> Sizes:
    """Return how large each kind is, by restricted likelihood: what the parameters could take up counts for nothing.

    Parameters
    ----------
    problem : Problem
        With the shared errors of the pivot's path only.
    parameters : ndarray, shape (15,)
        Its minimum.
    ways : list of ndarray, shape (samples, knots)
        As `find_ways` returns them.

    Notes
    -----
    With r the whitened residuals, D a kind's ways, and P the projection off the parameters' slopes, a size s costs
    log |1 + s² DᵀPD| - bᵀ (s⁻² + DᵀPD)⁻¹ b, b = DᵀP r [1]_. First comes the kind that gains
    most, then what gains beside it; of each the largest size that is still likely.

    References
    ----------
    .. [1] D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320-338.
    """
    left, slopes = problem.linearise(parameters)
    basis = np.linalg.qr(slopes)[0]
    left = left - basis @ (basis.T @ left)
    whitened = []
    for way in ways:
        way = way if problem.shared is None else problem.shared.whiten(way)
        way = np.concatenate([way, np.zeros((len(problem.rows), way.shape[1]))])
        whitened.append(way - basis @ (basis.T @ way))
    every = np.concatenate(whitened, axis=1)
    gram, seen = every.T @ every, every.T @ left
    kinds = np.repeat(np.arange(len(ways)), [way.shape[1] for way in ways])
    sizes = np.zeros(len(ways))
    for _ in ways:
        found = [_best_size(gram, seen, sizes, kinds, kind) for kind in range(len(ways))]
        costs = [np.inf if size > 0 else cost for size, (_, cost) in zip(sizes, found, strict=True)]
        best = int(np.argmin(costs))
        if not costs[best] < -LEAST_GAIN:
            break
        sizes[best] = found[best][0]
        for kind in np.flatnonzero(sizes):
            sizes[kind] = _best_size(gram, seen, sizes, kinds, int(kind))[0]
    # A light body that moves with the payload leaves little trace of itself, and l takes it up.
    sizes[BODY] = sizes[BODY] or _best_size(gram, seen, sizes, kinds, BODY)[0]
    return Sizes(*sizes.tolist())


def share_errors(problem: Problem, ways: list[FloatArray], sizes: Sizes) -> SharedErrors:
    """Return the shared errors of a problem with those of what is not modelled beside them."""
    columns = [size * way for size, way in zip(sizes, ways, strict=True) if size > 0]
    if problem.shared is not None:
        columns.append(problem.shared.modes * problem.shared.size)
    return SharedErrors.of(np.concatenate(columns, axis=1))


def _best_size(
    gram: FloatArray, seen: FloatArray, sizes: FloatArray, kinds: IntArray, kind: int
) -> tuple[float, float]:
    """Return the size of one kind, given the others, and what the best size costs more than none (0 at most)."""
    mine, scale = kinds == kind, sizes[kinds]
    others = ~mine & (scale > 0)
    own, cross = gram[np.ix_(mine, mine)], gram[np.ix_(others, mine)] * scale[others, None]
    told = seen[mine]
    if np.any(others):
        rest = gram[np.ix_(others, others)] * np.outer(scale[others], scale[others]) + np.diag(np.ones(others.sum()))
        solved = np.linalg.solve(rest, np.column_stack([cross, scale[others] * seen[others]]))
        own, told = own - cross.T @ solved[:, :-1], told - cross.T @ solved[:, -1]
    square, vectors = np.linalg.eigh(own)
    square, told = np.maximum(square, 0.0), (vectors.T @ told) ** 2
    grown = SIZES[:, None] ** 2
    costs = np.sum(np.log1p(grown * square) - grown * told / (1 + grown * square), axis=1)
    least = min(float(np.min(costs)), 0.0)
    likely = np.flatnonzero(costs <= least + LIKELY)
    return (float(SIZES[likely[-1]]) if len(likely) else 0.0), least


def _reactions(tangent: Tangent) -> FloatArray:
    """Return the pushes of light bodies that hang from the payload, shape (k, bodies), for a mass ratio of one.

    Hung at R, a body stays behind by y, y'' + 2 ζ ω y' + ω² y = -(X cos q + Z sin q + R q)'', and pulls with
    ω² y + 2 ζ ω y'; of the velocity in the bracket that is a filter without a second derivative.
    """
    q, rate = tangent.angle_rad[:, 0], tangent.rate_rad_s[:, 0]
    own, length = float(angular_frequency(tangent.parameters)[0]), float(length_m(tangent.parameters)[0])
    along = tangent.momentum_rad_s[:, 0] - rate
    step = float(np.diff(tangent.record.nodes_s[:2])[0])
    pushes = [-GRAVITY_M_S2 / length * np.sin(q)]
    for omega in own * BODY_FREQUENCIES:
        # s becomes c (z - 1)/(z + 1), the same at the body's own frequency.
        c = 1 / math.tan(min(omega * step / 2, 1.5))
        for zeta in BODY_DAMPING:
            pull = -omega * np.polymul([c, -c], np.polyadd(2 * zeta * np.array([c, -c]), [1.0, 1.0]))
            body = np.array([c**2 + 2 * zeta * c + 1, 2 - 2 * c**2, c**2 - 2 * zeta * c + 1])
            pushes += [lfilter(pull, body, along + hinge * rate) for hinge in HINGES]
    return np.stack(pushes, axis=1)


def _sway_across(tangent: Tangent, apart_s: float) -> FloatArray:
    """Return what bumps of h = s²/2 do to the samples, shape (3, n, bumps), s the angle of a sway across.

    With x = r sin q and z = -r cos q cos s, the sway lifts the tag by r h cos q, and it pushes q by
    -½ s'² sin 2q + h (g/l sin q + 2/3 k/J q), where s'² = h'' + 2 ω² h as s swings with ω, too.
    """
    record, p = tangent.record, tangent.parameters[:, 0]
    q, omega = tangent.angle_rad[:, :1], float(angular_frequency(p))
    rise, bent = (_bumps(record.nodes_s, apart_s, slope=slope) for slope in (0, 2))
    pull = GRAVITY_M_S2 / float(length_m(p)) * np.sin(q) + 2 / 3 * float(stiffness_over_inertia(p)) * q
    lift = tangent.of_push(pull * rise - np.sin(2 * q) / 2 * (bent + 2 * omega**2 * rise))
    up = np.cos(np.interp(record.time_s, record.nodes_s, q[:, 0]))[:, None]
    lift[1] += float(tag_radius_m(p)) * up * _bumps(record.time_s, apart_s, ends=record.nodes_s[[0, -1]])
    return lift


def _bumps(time_s: FloatArray, apart_s: float, *, ends: FloatArray | None = None, slope: int = 0) -> FloatArray:
    """Return cubic bumps at even distances between the ends of the times or others, or slopes, shape (n, bumps)."""
    ends = time_s[[0, -1]] if ends is None else ends
    count = max(math.ceil((ends[1] - ends[0]) / apart_s), 1)
    per_s = count / (ends[1] - ends[0])
    place = np.clip((time_s - ends[0]) * per_s, 0.0, count)
    bumps = BSpline(np.arange(-3.0, count + 4), np.eye(count + 3), 3)(place, nu=slope)
    return np.asarray(bumps * per_s**slope)
