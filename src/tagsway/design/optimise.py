"""Moves made for the pendulum itself, over a whole spread of frequency and damping.

Direct transcription: three phases with free durations, accelerations in cells, and every payload of a small ensemble as
a constraint. Its derivatives come from one batched run of the vectorised Runge-Kutta; SLSQP does the rest.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.optimize import minimize

from tagsway.design.limits import DesignLimits
from tagsway.design.motion import Outcome, simulate_motion
from tagsway.design.payload import PayloadSpread
from tagsway.design.problem import Bounds, OptimiserSettings, Problem
from tagsway.design.transcription import PHASES
from tagsway.errors import NotIdentifiableError
from tagsway.model import FloatArray, Move, Trajectory
from tagsway.trajectories.limits import find_extremes

_Vectorised = Callable[[FloatArray], FloatArray]

ROUNDS = 5
"""Of solving, checking finely, and tightening by what was broken."""

TIGHTENING = 1.05
NEGLIGIBLE: Mapping[str, float] = MappingProxyType(
    {"placement_m": 1e-5, "pcp_m_s2": 1e-2, "swing_rad": 1e-3, "ceiling_m": 1e-7, "box_error_m": 1e-5}
)
"""By how much of what was broken a bound is tightened, and what is too little to count."""

START_M_S2 = 6.0
START_SWING_RAD = math.radians(75)
"""Of the reference move that the search begins with: from a wilder one SLSQP does not come back."""

START_STEP_S = 4e-3
GENTLER = 0.7
MOST_STARTS = 3
GENTLEST_M_S2 = 0.3

REACHED_M = 1e-6
"""From the end point: SLSQP ends nearer, or nowhere."""

DIFFERENCE = 1e-6
TOLERANCE = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimisedMove:
    """A move made for the payload.

    Parameters
    ----------
    trajectory : Trajectory
        Its pieces begin and end on the controller's grid.
    motion_time_s : float
        Its duration.
    free_time_s : float
        Of the optimum before its pieces were put on the grid.
    solve_s : float
        Time that it took to find.
    rounds : int
        Of solving and tightening.
    outcome : Outcome
        Of the payloads of the check's grid.
    """

    trajectory: Trajectory
    motion_time_s: float
    free_time_s: float
    solve_s: float
    rounds: int
    outcome: Outcome


def optimise_move(
    move: Move, spread: PayloadSpread, limits: DesignLimits, *, settings: OptimiserSettings | None = None
) -> OptimisedMove:
    """Return the quickest move found that keeps all limits over the whole band.

    Parameters
    ----------
    move : Move
        Its points, heights and sample time; its profile does not count.
    spread : PayloadSpread
        Frequency and damping vary over the middle of it: an optimum for one damping alone is fragile.
    limits : DesignLimits
        To keep.
    settings : OptimiserSettings, optional
        Swing, lift, band.

    Raises
    ------
    NotIdentifiableError
        Where SLSQP finds no move that keeps them.

    Notes
    -----
    A local optimum, started from the reference move, as quick as the swing lets it be; where that leads nowhere, from
    two gentler ones. Outside the band it fails faster than a shaper does: show it.
    """
    wish = settings or OptimiserSettings()
    begun = time.perf_counter()
    problem = Problem.of(move, spread, limits, wish)
    vector, rounds = _solve_from_starts(problem, move, limits, wish)
    free_time = float(problem.layout.durations(vector).sum())
    on_grid = problem.on_grid(vector, move.sample_time_ms / 1e3)
    vector, more = _solve_and_tighten(on_grid, on_grid.adopt(vector), limits, wish)
    trajectory = on_grid.layout.trajectory(vector)
    return OptimisedMove(
        trajectory=trajectory,
        motion_time_s=trajectory.duration_s,
        free_time_s=free_time,
        solve_s=time.perf_counter() - begun,
        rounds=rounds + more,
        outcome=simulate_motion(trajectory, on_grid.checked),
    )


def _solve_from_starts(
    problem: Problem, move: Move, limits: DesignLimits, wish: OptimiserSettings
) -> tuple[FloatArray, int]:
    acceleration = min(START_M_S2, limits.acceleration_m_s2 or START_M_S2)
    fault: NotIdentifiableError | None = None
    for _ in range(MOST_STARTS):
        vector = problem.start(move, acceleration)
        while acceleration > GENTLEST_M_S2 and _swing(problem, vector) > START_SWING_RAD:
            acceleration *= GENTLER
            vector = problem.start(move, acceleration)
        try:
            return _solve_and_tighten(problem, vector, limits, wish)
        except NotIdentifiableError as error:
            fault = error
            acceleration *= GENTLER
    assert fault is not None
    raise fault


def _swing(problem: Problem, vector: FloatArray) -> float:
    outcome = simulate_motion(problem.layout.trajectory(vector), problem.payloads, step_s=START_STEP_S)
    return float(outcome.swing_rad.max())


def _solve_and_tighten(
    problem: Problem, vector: FloatArray, limits: DesignLimits, wish: OptimiserSettings
) -> tuple[FloatArray, int]:
    """Solve, look finely at many payloads, tighten by what was broken, and solve again."""
    tight = problem
    for done in range(1, ROUNDS + 1):
        vector = _solve(tight.with_steps_for(vector), vector)
        short = 0.1 * float(np.abs(problem.equalities(vector[None])).max())
        if not short <= REACHED_M:
            raise NotIdentifiableError(
                f"no optimised move keeps the limits: the best one found ends {1e3 * short:.2g} mm off; allow more, or "
                "take a shaped move"
            )
        trajectory = problem.layout.trajectory(vector)
        outcome = simulate_motion(trajectory, problem.checked)
        height = find_extremes(trajectory.coefficients[..., [2]], trajectory) - problem.layout.start_m[2]
        over = Bounds(
            placement_m=_excess(outcome.placement_m, limits.placement_window_m),
            pcp_m_s2=_excess(outcome.pcp_acceleration_m_s2, limits.pcp_acceleration_m_s2 or math.inf),
            swing_rad=_excess(outcome.swing_rad, wish.swing_rad),
            ceiling_m=_excess(height, problem.bounds.ceiling_m),
            box_error_m=_excess(outcome.box_error_m, problem.bounds.box_error_m),
        )
        if all(getattr(over, name) <= little for name, little in NEGLIGIBLE.items()):
            return vector, done
        tightened = {name: getattr(tight.bounds, name) - TIGHTENING * getattr(over, name) for name in NEGLIGIBLE}
        if not tight.boxed:
            tightened["box_error_m"] = problem.bounds.box_error_m
        boxed = tight.boxed or over.box_error_m > NEGLIGIBLE["box_error_m"]
        tight = replace(tight, bounds=Bounds(**tightened), boxed=boxed)
    off_mm = 1e3 * max(over.placement_m, over.box_error_m)
    raise NotIdentifiableError(
        f"no optimised move keeps the limits: after {ROUNDS} rounds the product is still {off_mm:.2g} mm and "
        f"{over.pcp_m_s2:.2g} m/s² beyond them; allow more, or take a shaped move"
    )


def _solve(problem: Problem, start: FloatArray) -> FloatArray:
    anchor = start.copy()
    gradient = np.zeros(len(start))
    if problem.fixed_s is None:
        gradient[:PHASES] = problem.layout.scale_s

    def cost(v: FloatArray) -> float:
        return float(gradient @ v) if problem.fixed_s is None else 0.5 * float(np.sum((v - anchor) ** 2))

    def slope(v: FloatArray) -> FloatArray:
        return gradient if problem.fixed_s is None else v - anchor

    inner, inner_slopes = _with_slopes(problem.inequalities)
    outer, outer_slopes = _with_slopes(problem.equalities)
    bounds = problem.variable_bounds()
    constraints: Any = [
        {"type": "eq", "fun": outer, "jac": outer_slopes},
        {"type": "ineq", "fun": inner, "jac": inner_slopes},
    ]
    low, high = np.array(bounds).T
    found = minimize(
        cost,
        np.clip(start, low, high),
        jac=slope,
        method="SLSQP",
        bounds=bounds,
        constraints=constraints,
        options={"maxiter": problem.iterations, "ftol": TOLERANCE},
    )
    vector: FloatArray = found.x
    return vector


def _with_slopes(function: _Vectorised) -> tuple[_Vectorised, _Vectorised]:
    """Return a function of one vector and its Jacobian, both from one batched run."""
    kept: dict[str, FloatArray] = {}

    def run(v: FloatArray) -> None:
        if "at" in kept and np.array_equal(kept["at"], v):
            return
        batch = np.concatenate([v[None], v + DIFFERENCE * np.eye(len(v))])
        values = function(batch)
        kept.update(at=v.copy(), value=values[0], slope=(values[1:] - values[0]).T / DIFFERENCE)

    def value(v: FloatArray) -> FloatArray:
        run(v)
        return kept["value"]

    def slopes(v: FloatArray) -> FloatArray:
        run(v)
        return kept["slope"]

    return value, slopes


def _excess(values: FloatArray, limit: float) -> float:
    """Return by how much the largest is above a limit; NaN, a product that never was above the box, exceeds none."""
    return max(float(np.nan_to_num(values, nan=-np.inf).max()) - limit, 0.0)
