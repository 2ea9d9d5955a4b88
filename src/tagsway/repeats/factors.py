"""What the factors of a set do: a linear model with errors that hold for unequal scatter and for groups."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher_f
from scipy.stats import t as student_t

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import BoolArray, Estimate, FactorEffect, FactorModel, FloatArray, IntArray, Unanswered
from tagsway.repeats.blocks import Block, find_confounded, make_blocks

LEAST_FREE = 3
"""Independent groups beyond the coefficients: with fewer an interval says next to nothing."""

NOTHING = 1e-9
"""Of a projection that is 0 but for rounding."""


def fit_factor_effects(
    values: FloatArray, factors: Mapping[str, Sequence[object]], *, labels: frozenset[str] = frozenset()
) -> FactorModel:
    """Fit y = μ + Σ (effect of each factor) + e by least squares.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of each measurement, in any unit; NaN is left out. Of a quantity that spans decades give the logarithm.
    factors : mapping of str to sequence of length n
        What was varied: numbers act by a slope, words (and True, False) by a difference from the first level, in
        alphabetical order. None, NaN or "" is not stated.
    labels : frozenset of str
        Factors whose numbers are names, as of samples.

    Returns
    -------
    FactorModel
        A factor that the others explain to 99 % or more is confounded: it stays in the model, so that what it shares
        does not fall to others, and its effect is not answered. A label that only ever stands within one level of
        another factor (samples of a product) is not in the model; its levels are the repeats then.

    Raises
    ------
    InputError
        Where a factor has another length than the values.
    NotIdentifiableError
        Where no factor varies, or too few measurements are left beside the coefficients.

    Notes
    -----
    Standard errors are those of the jackknife that leaves out one measurement at a time, or one group [1]_:
    Σ_g d_g d_gᵀ, d_g the change of the coefficients without g. They hold where levels scatter unequally, as soft and
    stiff grippers do, and where the measurements of a group share a deviation; they are somewhat too wide for few.
    Intervals are Student's with as many degrees of freedom as there are groups beyond the coefficients. Effects are
    taken to add up: `lack_of_fit_p` tests it [2]_, under equal scatter.
    Association is not cause: a factor that followed the time of day carries all that did.

    References
    ----------
    .. [1] J. G. MacKinnon and H. White, J. Econometrics 29 (1985) 305-325.
    .. [2] N. R. Draper and H. Smith, Applied Regression Analysis, 3rd ed. (1998), section 2.1.
    """
    y, chosen = _keep_finite(values, factors)
    blocks, unanswered, grouping = make_blocks(chosen, labels)
    if not blocks:
        raise NotIdentifiableError("no factor varies among the measurements", code="no_factor")
    fit = _fit(y, blocks, None if grouping is None else grouping.codes)
    effects, silent = _tell_effects(blocks, fit, "" if grouping is None else grouping.name)
    return FactorModel(
        n=y.size,
        effects=tuple(effects),
        unanswered=(*unanswered, *silent),
        grouped_by=None if grouping is None else grouping.name,
        residual_std=float(np.sqrt(np.sum(fit.residual**2) / (y.size - fit.rank))),
        degrees_of_freedom=fit.free,
        lack_of_fit_p=None if grouping is not None else _lack_of_fit(y, blocks, fit),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """Coefficients with their covariance; `rests_on_one` where one measurement or group alone tells a coefficient."""

    coefficients: FloatArray
    covariance: FloatArray
    rests_on_one: BoolArray
    residual: FloatArray
    rank: int
    free: int
    starts: tuple[int, ...]


def _keep_finite(
    values: FloatArray, factors: Mapping[str, Sequence[object]]
) -> tuple[FloatArray, dict[str, list[object]]]:
    """Return the values that are there, and their factors."""
    y: FloatArray = np.asarray(values, dtype=float)
    for name, column in factors.items():
        if len(column) != y.size:
            raise InputError(f"factor {name} has {len(column)} values for {y.size} measurements: expected one each")
    finite = np.flatnonzero(np.isfinite(y))
    return y[finite], {name: [column[int(row)] for row in finite] for name, column in factors.items()}


def _fit(y: FloatArray, blocks: Sequence[Block], groups: IntArray | None) -> _Fit:
    columns = np.hstack([np.ones((y.size, 1)), *(block.columns for block in blocks)])
    scale = np.linalg.norm(columns, axis=0)
    u, s, vt = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
    held = s > 1e-10 * s[0]
    u, back = u[:, held], (vt[held].T / s[held]) / scale[:, None]
    count = y.size if groups is None else int(groups.max()) + 1
    rank, free = int(held.sum()), count - int(held.sum())
    if not free >= LEAST_FREE:
        raise NotIdentifiableError(
            f"{count} independent measurements do not tell {rank - 1} effects: film more, or vary less",
            code="no_effects",
        )
    inner = u.T @ y
    residual = y - u @ inner
    changes, alone = _leave_one_out(u, residual) if groups is None else _leave_group_out(u, residual, groups)
    shares = np.abs(alone @ back.T).max(axis=0, initial=0.0)
    return _Fit(
        coefficients=back @ inner,
        covariance=back @ (changes.T @ changes) @ back.T * (count - 1) / count,
        rests_on_one=shares > 1e-6 * np.linalg.norm(back, axis=1),
        residual=residual,
        rank=rank,
        free=free,
        starts=tuple(int(at) for at in 1 + np.cumsum([0, *(block.columns.shape[1] for block in blocks)])[:-1]),
    )


def _leave_one_out(u: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how the inner coefficients change without each measurement, and the directions that one alone tells."""
    rest = 1 - np.einsum("ij,ij->i", u, u)
    lone = ~(rest > NOTHING)
    changes: FloatArray = u * np.where(lone, 0.0, residual / np.where(lone, 1.0, rest))[:, None]
    return changes, u[lone]


def _leave_group_out(u: FloatArray, residual: FloatArray, groups: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the same for groups: (I - UᵀU)⁻¹ Uᵀe of each group's rows."""
    changes, alone = [], [np.empty((0, u.shape[1]))]
    order = np.argsort(groups, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1):
        values, vectors = np.linalg.eigh(np.eye(u.shape[1]) - u[rows].T @ u[rows])
        told = values > NOTHING
        changes.append(vectors[:, told] @ (vectors[:, told].T @ (u[rows].T @ residual[rows]) / values[told]))
        alone.append(vectors[:, ~told].T)
    return np.array(changes), np.vstack(alone)


def _tell_effects(blocks: Sequence[Block], fit: _Fit, group: str) -> tuple[list[FactorEffect], list[Unanswered]]:
    """Return the effects of all factors, and what the data do not tell."""
    effects: list[FactorEffect] = []
    unanswered: list[Unanswered] = []
    confounded = find_confounded(blocks)
    for block, start in zip(blocks, fit.starts, strict=True):
        if block.name in confounded:
            reason = f"confounded with {confounded[block.name]}: they were not varied apart"
            unanswered.append(Unanswered(factor=block.name, level=None, reason=reason))
        else:
            told, lone = _effects_of(block, start, fit, group)
            effects += told
            unanswered += lone
    return effects, unanswered


def _effects_of(block: Block, start: int, fit: _Fit, group: str) -> tuple[list[FactorEffect], list[Unanswered]]:
    told: list[FactorEffect] = []
    lone: list[Unanswered] = []
    width = float(student_t.ppf(0.975, fit.free))
    for number in range(block.columns.shape[1]):
        place = start + number
        level = block.levels[number + 1] if block.levels else None
        if fit.rests_on_one[place]:
            reason = f"rests on one {group or 'measurement'}: its scatter is not known"
            lone.append(Unanswered(factor=block.name, level=level, reason=reason))
            continue
        value, std = float(fit.coefficients[place]), float(np.sqrt(fit.covariance[place, place]))
        told.append(
            FactorEffect(
                factor=block.name,
                level=level,
                reference=block.levels[0] if block.levels else None,
                n=int(np.count_nonzero(block.codes == number + 1)) if block.levels else block.codes.size,
                effect=Estimate(value=value, std=std, ci95=(value - width * std, value + width * std)),
                p_value=float(2 * student_t.sf(abs(value) / std, fit.free)) if std > 0 else float(value == 0),
            )
        )
    return told, lone


def _lack_of_fit(y: FloatArray, blocks: Sequence[Block], fit: _Fit) -> float | None:
    codes = np.column_stack([block.codes for block in blocks])
    _, cell = np.unique(codes, axis=0, return_inverse=True)
    count = np.bincount(cell)
    between, within = len(count) - fit.rank, y.size - len(count)
    if between < 1 or within < 1:
        return None
    pure = float(np.sum((y - (np.bincount(cell, y) / count)[cell]) ** 2))
    excess = float(np.sum(fit.residual**2)) - pure
    if not pure > 0:
        return None
    return float(fisher_f.sf(max(excess, 0.0) / between / (pure / within), between, within))
