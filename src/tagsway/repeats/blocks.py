"""Factors as columns of a linear model, and which of them cannot be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, IntArray, Unanswered

MOST_LEVELS = 50
"""Of a label in a model: more of them name measurements rather than kinds."""

LEAST_APART = 0.01
"""Share of a factor's own variation that the others must not explain: below, it is confounded with them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """The columns of one factor.

    Parameters
    ----------
    name : str
        Of the factor.
    columns : ndarray, shape (n, c)
        A dummy for each level but the first, or the numbers less their mean.
    codes : ndarray of int, shape (n,)
        Which of its distinct values each measurement has.
    levels : tuple of str
        Names of a categorical factor's, in order, the reference first; empty for a continuous one.
    """

    name: str
    columns: FloatArray
    codes: IntArray
    levels: tuple[str, ...]

    @property
    def distinct(self) -> int:
        """How many distinct values there are."""
        return int(self.codes.max()) + 1


def make_blocks(
    factors: Mapping[str, Sequence[object]], labels: frozenset[str]
) -> tuple[list[Block], list[Unanswered], Block | None]:
    """Return the columns of the factors that vary, those that cannot be used, and one that groups measurements.

    Parameters
    ----------
    factors : mapping of str to sequence of length n
        A word, a number, or nothing (None, NaN, "") a measurement.
    labels : frozenset of str
        Factors whose numbers are names.

    Returns
    -------
    blocks : list of Block
        Of the model.
    unanswered : list of Unanswered
        Factors that are not in it, and why.
    grouping : Block or None
        The coarsest label that is nested in a factor of the model.
    """
    blocks: list[Block] = []
    unanswered: list[Unanswered] = []
    for name, column in factors.items():
        missing = sum(_is_missing(value) for value in column)
        if missing == len(column):
            continue
        if missing:
            reason = f"not stated for {missing} of {len(column)} measurements"
            unanswered.append(Unanswered(factor=name, level=None, reason=reason))
            continue
        block = _make_block(name, column, is_label=name in labels)
        if block.levels and block.distinct == len(column):
            unanswered.append(Unanswered(factor=name, level=None, reason="names each measurement"))
        elif block.distinct > 1:
            blocks.append(block)
    nested = {block.name: other for block in blocks if block.levels and (other := _nest_of(block, blocks)) is not None}
    grouping = min((block for block in blocks if block.name in nested), key=lambda b: b.distinct, default=None)
    kept = []
    for block in blocks:
        reason = ""
        if block.name in nested:
            reason = f"nested in {nested[block.name]}: what its levels differ by counts as scatter"
        elif len(block.levels) > MOST_LEVELS:
            reason = f"has {block.distinct} levels: expected {MOST_LEVELS} at most"
        if reason:
            unanswered.append(Unanswered(factor=block.name, level=None, reason=reason))
        else:
            kept.append(block)
    return kept, unanswered, grouping


def find_confounded(blocks: Sequence[Block]) -> dict[str, str]:
    """Return for each factor that the others explain all but wholly, with which it is confounded.

    Notes
    -----
    The smallest sine² between the space of a factor's columns and that of the others', all centred: 1 less the largest
    squared canonical correlation.
    """
    bases = [_basis(block.columns - block.columns.mean(axis=0)) for block in blocks]
    found = {}
    for place, block in enumerate(blocks):
        others = [base for number, base in enumerate(bases) if number != place]
        if not others or not _sine2(bases[place], _basis(np.hstack(others))) < LEAST_APART:
            continue
        partners = [
            other.name
            for other, base in zip(blocks, bases, strict=True)
            if other is not block and _sine2(bases[place], base) < LEAST_APART
        ]
        found[block.name] = " and with ".join(partners) or "several other factors together"
    return found


def _basis(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what the columns span."""
    scale = np.linalg.norm(columns, axis=0)
    u, s, _ = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
    basis: FloatArray = u[:, s > 1e-10 * s.max(initial=0.0)]
    return basis


def _sine2(own: FloatArray, others: FloatArray) -> float:
    rest = own - others @ (others.T @ own)
    return float(np.linalg.svd(rest, compute_uv=False).min(initial=1.0)) ** 2


def _make_block(name: str, column: Sequence[object], *, is_label: bool) -> Block:
    numeric = not is_label and all(isinstance(v, (int, float, np.number)) and not isinstance(v, bool) for v in column)
    if numeric:
        numbers: FloatArray = np.asarray(column, dtype=float)
        codes = np.unique(numbers, return_inverse=True)[1]
        return Block(name=name, columns=(numbers - numbers.mean())[:, None], codes=codes, levels=())
    words = [_word(value) for value in column]
    levels = tuple(sorted(set(words), key=_order))
    place = {level: number for number, level in enumerate(levels)}
    codes = np.array([place[word] for word in words], dtype=np.int64)
    dummies: FloatArray = (codes[:, None] == np.arange(1, len(levels))).astype(float)
    return Block(name=name, columns=dummies[:, : MOST_LEVELS + 1], codes=codes, levels=levels)


def _nest_of(block: Block, blocks: Sequence[Block]) -> str | None:
    """Return a factor within whose levels a label only ever stands, and that has fewer of them."""
    for other in blocks:
        if other is not block and other.distinct < block.distinct:
            pairs = np.unique(np.column_stack([block.codes, other.codes]), axis=0)
            if len(pairs) == block.distinct:
                return other.name
    return None


def _is_missing(value: object) -> bool:
    return value is None or value == "" or value != value  # NaN differs from itself


def _word(value: object) -> str:
    return f"{value:.15g}" if isinstance(value, (float, np.floating)) else str(value)


def _order(word: str) -> tuple[float, str]:
    """Sort words that are numbers by their value, before the others."""
    try:
        return float(word), ""
    except ValueError:
        return np.inf, word
