"""Impulses on a controller's grid, and what that costs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Impulse, Mode, Residual, Shaper
from tagsway.shapers.impulses import Impulses
from tagsway.shapers.residual import design_mode, insensitivity, residual_vibration

PLACEMENTS = ("phasor", "linear", "round")
"""Without loss at the mode; split by the distance; moved to the nearest sample."""

ON_A_SAMPLE = 1e-9
"""Of a sample: an impulse that is off by less is on it."""

MOST_SAMPLES = 1_000_000
"""In a shaper; more come from a mistyped sample time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GridCost:
    """One way to put a shaper on a grid.

    Parameters
    ----------
    placement : str
        One of `PLACEMENTS`.
    shaper : Shaper
        With its impulses at multiples of the sample time.
    residual_at_mode : float
        Largest V of the design modes.
    added_s : float
        By how much it is longer.
    insensitivity_5_percent : float or None
        As for `insensitivity`.
    """

    placement: str
    shaper: Shaper
    residual_at_mode: float
    added_s: float
    insensitivity_5_percent: float | None


def place_on_grid(shaper: Shaper, sample_time_s: float, *, placement: str = "phasor") -> Shaper:
    """Return the shaper with its impulses at multiples of a sample time.

    Parameters
    ----------
    shaper : Shaper
        With at least one design mode. A box and a filter stay as they are.
    sample_time_s : float
        Below half a damped period of every design mode.
    placement : str
        "phasor": each impulse becomes two neighbouring ones a mode that do the same to the mode [1]_, so that V stays
        what it was; "linear": two, weighted by the distance; "round": one, at the nearest sample.

    Returns
    -------
    Shaper
        Longer by less than a sample for one mode.

    Raises
    ------
    InputError
        For a sample time that cannot be, and a shaper without a mode.

    Notes
    -----
    Of m modes with poles p_k, 2 m amplitudes B_j at successive samples t_j solve Σ B_j e^(p_k t_j) = A e^(p_k t);
    their sum differs a little from A, and the whole is scaled to 1 again. A trajectory made of polynomials needs none
    of this: it is shaped exactly and then sampled.

    References
    ----------
    .. [1] B. R. Murphy and I. Watanabe, IEEE Trans. Robotics and Automation 8 (1992) 285-289.
    """
    if placement not in PLACEMENTS:
        raise InputError(f"a placement on the grid is one of {', '.join(PLACEMENTS)}, not {placement!r}")
    if not (sample_time_s > 0 and math.isfinite(sample_time_s)):
        raise InputError(f"a sample time must be positive, not {sample_time_s:g} s")
    modes = _modes(shaper)
    shortest = min(mode.damped_period_s for mode in modes)
    if not sample_time_s < shortest / 2:
        raise InputError(
            f"a sample time of {sample_time_s:g} s is too long for a mode of {1 / shortest:.4g} Hz: expected less than "
            f"half its period, {shortest / 2:.4g} s"
        )
    last = shaper.impulses[-1].time_s
    if not last / sample_time_s < MOST_SAMPLES:
        raise InputError(f"a sample time of {sample_time_s:g} s makes more than {MOST_SAMPLES} samples of {last:g} s")
    weights: dict[int, float] = {}
    for impulse in shaper.impulses:
        first, share = _split(impulse.time_s / sample_time_s, modes, sample_time_s, placement)
        for i, weight in enumerate((impulse.amplitude * share).tolist()):
            weights[first + i] = weights.get(first + i, 0.0) + weight
    used = sorted(index for index, weight in weights.items() if weight != 0 or index == 0)
    time = np.array([0, *used] if used[0] != 0 else used) * sample_time_s
    amplitude = np.array([weights.get(round(t / sample_time_s), 0.0) for t in time.tolist()])
    return _with_impulses(shaper, Impulses.normalised(time, amplitude), modes)


def grid_costs(shaper: Shaper, sample_time_s: float) -> tuple[GridCost, ...]:
    """Return every placement side by side, for `place_on_grid`."""
    costs = []
    for placement in PLACEMENTS:
        placed = place_on_grid(shaper, sample_time_s, placement=placement)
        costs.append(
            GridCost(
                placement=placement,
                shaper=placed,
                residual_at_mode=max(residual_vibration(placed, mode) for mode in _modes(placed)),
                added_s=placed.duration_s - shaper.duration_s,
                insensitivity_5_percent=placed.insensitivity_5_percent,
            )
        )
    return tuple(costs)


def _split(position: float, modes: Sequence[Mode], sample_time_s: float, placement: str) -> tuple[int, FloatArray]:
    """Return the first sample and the shares of an impulse that lies at `position` samples."""
    nearest = round(position)
    if placement == "round" or abs(position - nearest) < ON_A_SAMPLE:
        return nearest, np.ones(1)
    below = math.floor(position)
    if placement == "linear":
        return below, np.array([1 - (position - below), position - below])
    # Centred on the impulse, the shares stay small; nothing can come before the first sample.
    count = 2 * len(modes)
    first = max(below - (len(modes) - 1), 0)
    step = np.array(
        [
            mode.angular_frequency_rad_s
            * complex(mode.damping_ratio, math.sqrt(1 - mode.damping_ratio**2))
            * sample_time_s
            for mode in modes
        ]
    )
    powers = np.exp(np.multiply.outer(step, first + np.arange(count) - position))
    rows = np.concatenate([powers.real, powers.imag])
    wanted = np.concatenate([np.ones(len(modes)), np.zeros(len(modes))])
    return first, np.linalg.solve(rows, wanted)


def _modes(shaper: Shaper) -> list[Mode]:
    design_mode(shaper)
    return [Mode(natural_frequency_hz=m.frequency_hz, damping_ratio=m.damping_ratio) for m in shaper.modes]


def _with_impulses(shaper: Shaper, impulses: Impulses, modes: Sequence[Mode]) -> Shaper:
    pairs = zip(impulses.time_s.tolist(), impulses.amplitude.tolist(), strict=True)
    placed = replace(shaper, impulses=tuple(Impulse(time_s=time, amplitude=amplitude) for time, amplitude in pairs))
    width = insensitivity(placed)
    return replace(
        placed,
        insensitivity_5_percent=width if math.isfinite(width) else None,
        residual=Residual(at_mode=max(residual_vibration(placed, mode) for mode in modes)),
    )
