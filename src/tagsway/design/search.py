"""The quickest move of every candidate: each shaper, on one axis or both, at every acceleration.

Which accelerations keep the limits is no interval (the unshaped move's are a narrow island), so they are scanned, from
the gentlest to the hardest, and never bisected.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tagsway.design.limits import LIMIT_NAMES, DesignLimits
from tagsway.design.motion import Outcome, longest_step_s, simulate_motion, simulate_together, tail_s
from tagsway.design.payload import Payloads
from tagsway.design.planning import (
    MotionPeaks,
    PlannedCandidate,
    ShapedAxes,
    find_peaks,
    plan_candidate,
    refine_peaks,
)
from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Shaper, Trajectory

LOWEST_M_S2, HIGHEST_M_S2 = 0.5, 60.0
"""Accelerations that are scanned; a shaped move may be planned with more than the robot's limit and yet keep it."""

SCAN_RATIO = 1.03
"""From one acceleration to the next: the narrowest island known, 4.7 to 5.1 m/s², holds two or three."""

FILTER_RATIO = 1.15
"""The same for a filter, whose response has to be fitted for each; its accelerations have no islands."""

REFINEMENTS = 5
"""Accelerations between the quickest that holds and the next quicker one."""

SCAN_STEP_S = 8e-3
"""A tenth of a radian of a mode of 2 Hz: the placement is off by 0.01 mm."""

CHECK_STEP_S = 4e-3

GROUP = 12
"""Accelerations that are simulated side by side."""

ROUGH_SHARE = 0.6
"""Of a dozen payloads: what keeps the limits for fewer will not for 95 of 100."""

GEOMETRIC = ("box_m", "vertical_mm")
"""Limits that do not keep a move from being judged: the table shows what it would take without them."""

JOINTS = "joints"
"""Looked at last, for those alone that keep everything else."""

NEAR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Which limits a motion keeps, for how many payloads.

    Parameters
    ----------
    share_kept : float
        Of the payloads, all of theirs at once; 0 where the robot's velocity, acceleration or jerk is broken.
    broken : str or None
        The limit that is broken the most, or the robot's first; None where enough keep all.
    strain : float
        How much of its limit the worst of the payload's quantities takes, at the quantile that must keep it: 2 is twice
        the limit; infinite where nothing was simulated.
    placement_m, pcp_acceleration_m_s2, swing_rad, box_error_m : float
        Worst of the payloads; NaN where nothing was simulated, and of the box where the product never was above it.
    """

    share_kept: float
    broken: str | None
    strain: float = math.inf
    placement_m: float = math.nan
    pcp_acceleration_m_s2: float = math.nan
    swing_rad: float = math.nan
    box_error_m: float = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """The quickest move of one shaper on its axes, or the one that comes nearest to keeping the limits.

    Parameters
    ----------
    name : str
        The shaper's type, or "unshaped".
    axes : tuple of str
        That are shaped.
    acceleration_m_s2, height_m : float
        What the move is planned with: its acceleration, and its vertical ends as they were raised.
    motion_time_s : float
        Duration of the tool's motion, of the longest where there are several place points.
    planned : PlannedCandidate
        Its moves and trajectories.
    shaper : Shaper or None
        None for the unshaped move.
    verdict : Verdict
        Over the fresh payloads of the check; over those of the scan where it breaks a limit.
    """

    name: str
    axes: ShapedAxes
    acceleration_m_s2: float
    height_m: float
    motion_time_s: float
    planned: PlannedCandidate
    shaper: Shaper | None
    verdict: Verdict

    @property
    def legal(self) -> bool:
        """Whether it keeps all limits for the share that was asked for."""
        return self.verdict.broken is None


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchSettings:
    """What is judged with: few payloads first, more where they pass, and fresh ones where those pass too."""

    rough: Payloads
    scanned: Payloads
    checked: Payloads


def accelerations_to_scan(limits: DesignLimits, *, ratio: float = SCAN_RATIO) -> FloatArray:
    """Return the accelerations to scan, rising, in m/s²."""
    count = math.ceil(math.log(HIGHEST_M_S2 / LOWEST_M_S2) / math.log(ratio))
    grid: FloatArray = np.geomspace(LOWEST_M_S2, HIGHEST_M_S2, count + 1)
    if limits.acceleration_m_s2 is not None:
        grid = np.union1d(grid, limits.acceleration_m_s2 * (1 - NEAR))
    return grid


def search_candidate(
    moves: Sequence[Move],
    shaper: Shaper | None,
    axes: ShapedAxes,
    limits: DesignLimits,
    settings: SearchSettings,
    *,
    accelerations_m_s2: FloatArray | None = None,
) -> Candidate:
    """Return the quickest move of one shaper that keeps the limits, or the one that comes nearest to it.

    Parameters
    ----------
    moves : sequence of Move
        One for each place point.
    shaper : Shaper or None
        What is laid over them; None leaves them unshaped.
    axes : tuple of str
        To shape: ("x",), ("x", "z") or ().
    limits : DesignLimits
        To keep.
    settings : SearchSettings
        The payloads.
    accelerations_m_s2 : ndarray, optional
        To scan.

    Raises
    ------
    InputError
        Where no acceleration gives a move at all.
    """
    ratio = SCAN_RATIO if shaper is None or shaper.filter is None else FILTER_RATIO
    grid = accelerations_to_scan(limits, ratio=ratio) if accelerations_m_s2 is None else accelerations_m_s2
    search = _Search(moves=tuple(moves), shaper=shaper, axes=axes, limits=limits, settings=settings)
    planned = search.plan(grid)
    for breaks in (None, *GEOMETRIC):
        tried = [candidate for candidate in planned if candidate.verdict.broken == breaks]
        best = search.find_quickest(tried)
        if best is not None and len(grid) > 1:
            around = best.acceleration_m_s2 * np.geomspace(1 / SCAN_RATIO, SCAN_RATIO, 2 * REFINEMENTS + 1)
            nearby = [c for c in search.plan(around) if c.verdict.broken == breaks and _sooner(c, best)]
            best = search.find_quickest(nearby) or best
        if best is not None:
            return best
    return find_nearest([*search.failed, *(c for c in planned if c.verdict.broken not in (None, *GEOMETRIC))])


def find_nearest(candidates: Sequence[Candidate]) -> Candidate:
    """Return the one that comes nearest to its limits: by share, by strain, then by the last of the robot's limits."""
    return max(
        candidates,
        key=lambda c: (c.verdict.share_kept, -c.verdict.strain, _rank(c.verdict.broken), -c.motion_time_s),
    )


def check_candidate(candidate: Candidate, limits: DesignLimits, payloads: Payloads) -> Candidate:
    """Return a candidate with its verdict over other payloads, simulated finely, its exact peaks and its joints."""
    planned, own = candidate.planned, candidate.verdict
    broken = find_broken_at_last(planned.trajectories, limits)
    if broken not in (None, own.broken):
        return replace(candidate, verdict=replace(own, broken=broken))
    if planned.find_joint_fault() is not None:
        return replace(candidate, verdict=replace(own, broken=JOINTS))
    verdicts = [judge(simulate_motion(t, payloads, step_s=CHECK_STEP_S), limits) for t in planned.trajectories]
    return _with_verdict(candidate, verdicts)


def judge(outcome: Outcome, limits: DesignLimits) -> Verdict:
    """Return which limits an outcome keeps, for how many payloads."""
    taken = {"placement_window_mm": outcome.placement_m / limits.placement_window_m}
    if limits.pcp_acceleration_m_s2 is not None:
        taken["pcp_acceleration_m_s2"] = outcome.pcp_acceleration_m_s2 / limits.pcp_acceleration_m_s2
    if limits.box_error_m is not None:
        # A product that never is above the rim cannot be put over it.
        taken["box_error_mm"] = np.nan_to_num(outcome.box_error_m / limits.box_error_m, nan=math.inf)
    share = float(np.mean(np.all([values <= 1 + NEAR for values in taken.values()], axis=0)))
    strains = {name: float(np.quantile(values, limits.share, method="higher")) for name, values in taken.items()}
    worst = max(strains, key=lambda name: strains[name])
    return Verdict(
        share_kept=share,
        broken=None if share >= limits.share else worst,
        strain=strains[worst],
        placement_m=float(outcome.placement_m.max()),
        pcp_acceleration_m_s2=float(outcome.pcp_acceleration_m_s2.max()),
        swing_rad=float(outcome.swing_rad.max()),
        box_error_m=float(outcome.box_error_m.max()),
    )


def find_broken(peaks: MotionPeaks, limits: DesignLimits) -> str | None:
    """Return the first limit of the robot that a motion breaks, or None."""
    for name in ("acceleration_m_s2", "velocity_m_s", "jerk_m_s3"):
        limit = getattr(limits, name)
        if limit is not None and not getattr(peaks, name) <= limit * (1 + 1e-6):
            return name
    if limits.box_m is not None:
        low, high = np.array(limits.box_m)
        if not (np.all(peaks.lowest_m >= low - 1e-6) and np.all(peaks.highest_m <= high + 1e-6)):
            return "box_m"
    return None if peaks.vertical_m >= limits.vertical_m - 1e-6 else "vertical_mm"


def find_broken_at_last(trajectories: Sequence[Trajectory], limits: DesignLimits) -> str | None:
    """Return the first limit of the robot that the exact peaks of some motions break, or None."""
    broken = (find_broken(refine_peaks(find_peaks(each), each), limits) for each in trajectories)
    return next(filter(None, broken), None)


@dataclass(slots=True, kw_only=True)
class _Search:
    """One shaper on its axes; keeps what failed on the way."""

    moves: tuple[Move, ...]
    shaper: Shaper | None
    axes: ShapedAxes
    limits: DesignLimits
    settings: SearchSettings
    failed: list[Candidate] = field(default_factory=list)

    def plan(self, accelerations_m_s2: FloatArray) -> list[Candidate]:
        """Return the candidates that can be planned, each with the limit of the robot that it breaks, if any."""
        found, fault = [], None
        for acceleration in accelerations_m_s2.tolist():
            try:
                planned = plan_candidate(
                    self.moves, self.shaper, self.axes, acceleration, vertical_m=self.limits.vertical_m
                )
            except InputError as error:
                fault = error
                continue
            broken = (find_broken(find_peaks(trajectory), self.limits) for trajectory in planned.trajectories)
            found.append(
                Candidate(
                    name="unshaped" if self.shaper is None else self.shaper.type,
                    axes=self.axes,
                    acceleration_m_s2=acceleration,
                    height_m=max(max(m.pick_height_m, m.place_height_m) for m in planned.moves),
                    motion_time_s=max(t.duration_s for t in planned.trajectories),
                    planned=planned,
                    shaper=self.shaper,
                    verdict=Verdict(share_kept=0.0, broken=next(filter(None, broken), None)),
                )
            )
        if fault is not None and not found:
            raise fault
        return found

    def find_quickest(self, candidates: list[Candidate]) -> Candidate | None:
        """Return the quickest that keeps the limits of the payload; it may break one of the robot's space."""
        queue = sorted(candidates, key=lambda candidate: candidate.motion_time_s)
        for start in range(0, len(queue), GROUP):
            group = self._pass(queue[start : start + GROUP], self.settings.rough, ROUGH_SHARE)
            for candidate in self._pass(group, self.settings.scanned, self.limits.share):
                checked = check_candidate(candidate, self.limits, self.settings.checked)
                if (
                    checked.verdict.share_kept >= self.limits.share
                    and checked.verdict.broken == candidate.verdict.broken
                ):
                    return checked
                self.failed.append(checked)
        return None

    def _pass(self, group: list[Candidate], payloads: Payloads, share: float) -> list[Candidate]:
        if not group:
            return []
        judged = _judge_together(group, self.limits, payloads)
        self.failed.extend(c for c in judged if c.verdict.share_kept < share)
        return [c for c in judged if c.verdict.share_kept >= share]


def _judge_together(group: list[Candidate], limits: DesignLimits, payloads: Payloads) -> list[Candidate]:
    end = max(candidate.motion_time_s for candidate in group) + tail_s(payloads)
    time = np.linspace(0.0, end, math.ceil(end / min(SCAN_STEP_S, longest_step_s(payloads))) + 1)
    trajectories = [trajectory for candidate in group for trajectory in candidate.planned.trajectories]
    verdicts = [judge(outcome, limits) for outcome in simulate_together(trajectories, payloads, time)]
    places = len(group[0].planned.trajectories)
    return [_with_verdict(candidate, verdicts[i * places : (i + 1) * places]) for i, candidate in enumerate(group)]


def _with_verdict(candidate: Candidate, verdicts: Sequence[Verdict]) -> Candidate:
    """Return the candidate with the worst of its place points; what breaks the robot's space goes on doing so."""
    worst = min(verdicts, key=lambda verdict: (verdict.share_kept, -verdict.strain))
    space = candidate.verdict.broken if candidate.verdict.broken in GEOMETRIC else None
    return replace(candidate, verdict=replace(worst, broken=space or worst.broken))


def _sooner(candidate: Candidate, best: Candidate) -> bool:
    return candidate.motion_time_s < best.motion_time_s


def _rank(broken: str | None) -> int:
    return -1 if broken is None else LIMIT_NAMES.index(broken)
