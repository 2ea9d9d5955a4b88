"""Which shaper, how fast, and how sure: every candidate, the quickest that keeps the limits, and a move beyond them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tagsway.design.limits import DesignLimits
from tagsway.design.motion import simulate_motion
from tagsway.design.optimise import OptimisedMove, optimise_move
from tagsway.design.payload import PayloadSpread, corner_payloads, draw_payloads, make_payloads, sample_payloads
from tagsway.design.planning import PlannedCandidate, ShapedAxes
from tagsway.design.problem import OptimiserSettings
from tagsway.design.search import (
    Candidate,
    SearchSettings,
    Verdict,
    find_broken_at_last,
    find_nearest,
    judge,
    search_candidate,
)
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import NORMAL_95, DesignMode, FloatArray, Mode, Move, Notice, Shaper, Spread, Trajectory
from tagsway.shapers import IMPULSE_TYPES, SHAPER_TYPES, Band, design_multimode, design_shaper

SCANNED = 128
"""Payloads of the scan, spread evenly."""

OPTIMISED_SHARES = ((0.95, 0.87), (0.98, 0.95))
"""Of frequency and damping, in which an optimised move keeps the limits for every payload; the second where the fresh
payloads outside the first break them too often: a normal spread has its tails there."""

BEYOND_PERCENT = 30.0
"""How far from the design's frequency the evidence looks."""

Report = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignTask:
    """What is to be designed.

    Parameters
    ----------
    moves : tuple of Move
        One for each place point, the same but for `to_m`.
    modes : tuple of DesignMode
        Of the payload at the operating amplitude, the first the one that sways; shapers are designed for the first
        alone, and for all of them.
    band_percent : tuple of float
        By how much the frequency of each mode may be off, on either side: each mode's shaper follows its own.
    payload : PayloadSpread
        How the first mode varies, and as many further ones as there are.
    limits : DesignLimits
        To keep.
    kinds : tuple of str
        Shaper types.
    accelerations_m_s2 : ndarray or None
        To scan; None for all that a robot may do.
    checked : int
        How many fresh payloads a candidate is checked with: a share of 95 % of 1000 is known to ±0.7 %.
    """

    moves: tuple[Move, ...]
    modes: tuple[DesignMode, ...]
    band_percent: tuple[float, ...]
    payload: PayloadSpread
    limits: DesignLimits
    kinds: tuple[str, ...] = SHAPER_TYPES
    accelerations_m_s2: FloatArray | None = None
    checked: int = 1000

    def __post_init__(self) -> None:
        counts = {len(self.modes), len(self.band_percent), 1 + len(self.payload.further)}
        if not (self.moves and len(counts) == 1):
            raise InputError(
                f"{len(self.moves)} moves, {len(self.modes)} modes, {len(self.band_percent)} bands and a payload of "
                f"{1 + len(self.payload.further)} modes: expected a move, and as many bands and modes as modes"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class BeyondBand:
    """Where the product comes to lie when the payload is not what was designed for.

    Parameters
    ----------
    deviation_percent : ndarray, shape (n,)
        Of the natural frequency from the middle of the spread.
    names : tuple of str
        Of the motions.
    placement_m : ndarray, shape (motions, n)
        The worst of the damping's spread.
    """

    deviation_percent: FloatArray
    names: tuple[str, ...]
    placement_m: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedOptimum:
    """An optimised move with its verdict over fresh payloads."""

    move: OptimisedMove
    verdict: Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """The outcome of a design.

    Parameters
    ----------
    task : DesignTask
        What was asked.
    candidates : tuple of Candidate
        Legal ones first, the quickest first.
    chosen : Candidate
        The first of them.
    optimised : CheckedOptimum or None
        Only where it beats every candidate.
    beyond : BeyondBand
        Outside the band: the chosen one, the quickest shaped one beside it, the optimised one.
    worst_place_m : tuple of float
        Of several place points, that at which the chosen move leaves the most.
    notices : tuple of Notice
        What degrades it.
    """

    task: DesignTask
    candidates: tuple[Candidate, ...]
    chosen: Candidate
    optimised: CheckedOptimum | None
    beyond: BeyondBand
    worst_place_m: tuple[float, float, float]
    notices: tuple[Notice, ...]


def design_move(
    task: DesignTask, *, rng: np.random.Generator, optimise: bool = True, progress: Report | None = None
) -> Advice:
    """Return every candidate, the one to take, and an optimised move where it beats them all.

    Parameters
    ----------
    task : DesignTask
        Moves, modes, spread and limits.
    rng : numpy.random.Generator
        Draws the payloads.
    optimise : bool
        Whether a move made for the payload is looked for too.
    progress : callable, optional
        Called with (candidates done, candidates in all).

    Raises
    ------
    NotIdentifiableError
        Where no candidate keeps the limits: names the one that comes nearest and the limit that fails first.
    InputError
        Where no candidate can be planned.

    Notes
    -----
    The motion time is that of the tool: what the product still does after it is held by the placement window.
    """
    settings = draw_settings(task, rng=rng)
    candidates, notices = find_candidates(task, settings, progress=progress)
    ranked = tuple(sorted(candidates, key=lambda c: (not c.legal, c.motion_time_s)))
    chosen = ranked[0]
    if not chosen.legal:
        raise NotIdentifiableError(_why_nothing(candidates, task.limits), code="limits_unmeetable")
    optimum = None
    if optimise:
        optimum = _optimum(task, chosen, settings, notices)
    return Advice(
        task=task,
        candidates=ranked,
        chosen=chosen,
        optimised=optimum,
        beyond=_look_beyond(task.payload, _compared(ranked, optimum)),
        worst_place_m=_worst_place(chosen, settings),
        notices=tuple(notices),
    )


def draw_settings(task: DesignTask, *, rng: np.random.Generator) -> SearchSettings:
    """Draw the payloads that candidates are judged with."""
    return SearchSettings(
        rough=corner_payloads(task.payload, frequencies=7, dampings=2, further=2, shares=(0.95, 0.95)),
        scanned=sample_payloads(task.payload, SCANNED, rng=rng),
        checked=draw_payloads(task.payload, task.checked, rng=rng),
    )


def find_candidates(
    task: DesignTask, settings: SearchSettings, *, progress: Report | None = None
) -> tuple[list[Candidate], list[Notice]]:
    """Return the unshaped move and every shaper on its axes, each at its quickest, and what could not be planned."""
    shapers, notices = design_shapers(task)
    jobs: list[tuple[Shaper | None, ShapedAxes]] = [(None, ())]
    jobs += [(shaper, axes) for shaper in shapers for axes in _axes_of(task.moves[0])]
    candidates: list[Candidate] = []
    for done, (shaper, axes) in enumerate(jobs):
        try:
            found = search_candidate(
                task.moves, shaper, axes, task.limits, settings, accelerations_m_s2=task.accelerations_m_s2
            )
        except InputError as fault:
            name = "unshaped" if shaper is None else f"{shaper.type} on {','.join(axes)}"
            notices.append(Notice(code="no_such_candidate", message=f"{name}: {fault}"))
        else:
            candidates.append(found)
        if progress is not None:
            progress(done + 1, len(jobs))
    if not candidates:
        raise InputError(notices[-1].message)
    return candidates, notices


def design_shapers(task: DesignTask) -> tuple[list[Shaper], list[Notice]]:
    """Return one shaper of every kind for the first mode; where there are more modes, one for all of them beside it.

    The further modes of the latter take what their own bands ask for, a ZV in a narrow one: a further mode that moves
    the product little is cheaper left alone, and only the simulation knows.
    """
    spread = Spread(
        source=task.payload.source, natural_frequency_std_percent=task.band_percent[0] / NORMAL_95, n=task.payload.n
    )
    shapers, notices = [], []
    for kind in task.kinds:
        # What is no train of impulses is no shaper for several modes.
        for design in (_for_first, _for_all) if len(task.modes) > 1 and kind in IMPULSE_TYPES else (_for_first,):
            try:
                shapers.append(design(kind, task, spread))
            except InputError as fault:
                notices.append(Notice(code="no_such_shaper", message=f"{kind}: {fault}"))
    return shapers, notices


def _for_first(kind: str, task: DesignTask, spread: Spread) -> Shaper:
    first = task.modes[0]
    mode = Mode(natural_frequency_hz=first.frequency_hz, damping_ratio=first.damping_ratio)
    band = Band.around(mode, percent=task.band_percent[0])
    return design_shaper(kind, first, spread=spread, band=band, source=task.payload.source)


def _for_all(kind: str, task: DesignTask, spread: Spread) -> Shaper:
    further = design_multimode(None, task.modes[1:], band_percent=task.band_percent[1:])
    own = [replace(spread, natural_frequency_std_percent=band / NORMAL_95) for band in task.band_percent]
    return design_multimode(
        [kind, *further.type.split("-")],
        task.modes,
        band_percent=task.band_percent,
        spreads=own,
        source=task.payload.source,
    )


def _axes_of(move: Move) -> tuple[ShapedAxes, ...]:
    rises = move.profile != "bang-bang" or move.from_m[2] != move.to_m[2]
    return (("x",), ("x", "z")) if rises else (("x",),)


def _why_nothing(candidates: Sequence[Candidate], limits: DesignLimits) -> str:
    near = find_nearest(candidates)
    v = near.verdict
    reached = f"{100 * v.share_kept:.3g} % of the payloads"
    if not math.isnan(v.placement_m):
        box = "" if limits.box_error_m is None else f", {1e3 * v.box_error_m:.3g} mm in the box"
        reached += f" (worst: {1e3 * v.placement_m:.3g} mm, {v.pcp_acceleration_m_s2:.3g} m/s²{box})"
    return (
        f"no candidate keeps the limits for {100 * limits.share:g} % of the payloads: {v.broken} fails first; the "
        f"nearest, {describe(near)}, keeps the payload's for {reached}; widen that limit, narrow the spread, or "
        "allow a longer or higher way"
    )


def describe(candidate: Candidate) -> str:
    """Return a candidate in words."""
    axes = "" if not candidate.axes else f" on {','.join(candidate.axes)}"
    return f"{candidate.name}{axes} at {candidate.acceleration_m_s2:.3g} m/s² in {candidate.motion_time_s:.3f} s"


def _optimum(
    task: DesignTask, chosen: Candidate, settings: SearchSettings, notices: list[Notice]
) -> CheckedOptimum | None:
    reasons = {
        "several place points are one trajectory each": len(task.moves) > 1,
        "the limit acceleration_m_s2 is not stated": task.limits.acceleration_m_s2 is None,
        "the move is no pick-and-place": task.moves[0].profile != "pick-and-place",
    }
    if why := next((words for words, holds in reasons.items() if holds), None):
        notices.append(Notice(code="not_optimised", message=f"no optimised move was looked for: {why}"))
        return None
    for frequencies, dampings in OPTIMISED_SHARES:
        wish = OptimiserSettings(frequency_share=frequencies, damping_share=dampings)
        try:
            found = optimise_move(task.moves[0], task.payload, task.limits, settings=wish)
        except NotIdentifiableError as fault:
            notices.append(Notice(code="not_optimised", message=str(fault)))
            return None
        verdict = _check_optimum(found, task, settings)
        if verdict.share_kept >= task.limits.share or found.motion_time_s >= chosen.motion_time_s:
            break
    if verdict.broken is not None or found.motion_time_s >= chosen.motion_time_s:
        words = f"takes {found.motion_time_s:.3f} s" if verdict.broken is None else f"breaks {verdict.broken}"
        message = f"an optimised move {words} and is not offered: {describe(chosen)} is the better one"
        notices.append(Notice(code="not_optimised", message=message))
        return None
    return CheckedOptimum(move=found, verdict=verdict)


def _check_optimum(found: OptimisedMove, task: DesignTask, settings: SearchSettings) -> Verdict:
    """Return the verdict of an optimised move over fresh payloads, the robot's limits and joints included."""
    verdict = judge(simulate_motion(found.trajectory, settings.checked), task.limits)
    broken = find_broken_at_last((found.trajectory,), task.limits)
    if PlannedCandidate(moves=task.moves, trajectories=(found.trajectory,)).find_joint_fault() is not None:
        broken = "joints"
    return verdict if broken is None else replace(verdict, broken=broken)


def _compared(ranked: Sequence[Candidate], optimum: CheckedOptimum | None) -> list[tuple[str, Trajectory]]:
    shown = [ranked[0]]
    shown += [c for c in ranked[1:] if c.legal and c.shaper is not None][:1]
    motions = [(describe(c), c.planned.trajectories[0]) for c in shown]
    if optimum is not None:
        motions.append((f"optimised in {optimum.move.motion_time_s:.3f} s", optimum.move.trajectory))
    return motions


def _look_beyond(spread: PayloadSpread, motions: Sequence[tuple[str, Trajectory]]) -> BeyondBand:
    deviation = np.linspace(-BEYOND_PERCENT, BEYOND_PERCENT, 61)
    frequency = spread.mode.natural_frequency_hz * (1 + deviation / 100)
    dampings = np.array([spread.damping_low, spread.damping_high])
    payloads = make_payloads(spread, np.repeat(frequency, 2), np.tile(dampings, len(frequency)))
    placements = [simulate_motion(t, payloads, step_s=2e-3).placement_m.reshape(-1, 2).max(axis=1) for _, t in motions]
    return BeyondBand(
        deviation_percent=deviation, names=tuple(name for name, _ in motions), placement_m=np.stack(placements)
    )


def _worst_place(chosen: Candidate, settings: SearchSettings) -> tuple[float, float, float]:
    planned = chosen.planned
    left = [float(simulate_motion(t, settings.scanned, step_s=2e-3).placement_m.max()) for t in planned.trajectories]
    return planned.moves[int(np.argmax(left))].to_m
