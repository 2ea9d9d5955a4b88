"""Motion time of every candidate on the flexible subset, and how much an optimised move takes off.

    python benchmarks/design.py [--quick] [--seed 1]

f_n uniform within ±11.46 % by l with k fixed, ζ from .04 to .07; the product within 7 mm of the end, its x'' and the
robot's vector within 20 m/s², 50 mm vertical at both ends, apex 130 mm. Legal: all limits for at least 95 % of 1000
payloads. The optimised moves keep |q| ≤ 45° and z'' ≥ -0.8 g on top, and in the second case a jerk of 1000 m/s³; the
best legal candidate that they are held against keeps neither. DOP853 in the acceleration form, begun anew at every
switch, verifies them on 1000 fresh payloads. `--quick` leaves the table out but for the unshaped move and ZVD.
"""

import argparse
import itertools
import math
import time

import numpy as np
from scipy.integrate import solve_ivp

from tagsway.design import (
    Candidate,
    DesignTask,
    OptimisedMove,
    Payloads,
    PayloadSpread,
    SearchSettings,
    corner_payloads,
    design_shapers,
    draw_payloads,
    make_payloads,
    optimise_move,
    read_limits,
    sample_payloads,
    search_candidate,
    simulate_motion,
)
from tagsway.design.motion import find_way
from tagsway.errors import TagswayError
from tagsway.model import GRAVITY_M_S2, DesignMode, FloatArray, Limits, Mode, Move, Shaper, Trajectory
from tagsway.shapers import SHAPER_TYPES

FREQUENCY_HZ, LENGTH_M, WINDOW_M, PEEL_M_S2 = 2.4727, 0.04585, 0.007, 20.0
SPREAD = PayloadSpread(
    mode=Mode(natural_frequency_hz=FREQUENCY_HZ, damping_ratio=0.055),
    frequency_percent=11.46,
    damping_low=0.04,
    damping_high=0.07,
    length_m=LENGTH_M,
    tag_radius_m=LENGTH_M,
    shape="uniform",
)


def flexible_move(jerk_m_s3: float | None = None) -> Move:
    """The thesis' pick and place."""
    return Move(
        from_m=(-0.35, 0.0, -0.767),
        to_m=(0.35, 0.0, -0.767),
        max_acceleration_m_s2=5.0,
        pick_height_m=0.05,
        place_height_m=0.05,
        limits=Limits(
            acceleration_m_s2=20.0,
            jerk_m_s3=jerk_m_s3,
            vertical_mm=50.0,
            pcp_acceleration_m_s2=PEEL_M_S2,
            placement_window_mm=1e3 * WINDOW_M,
            box_m=((-1.0, -1.0, -0.767), (1.0, 1.0, -0.637)),
        ),
    )


def integrate(trajectory: Trajectory, payloads: Payloads) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return placement in m, PCP |x''| in m/s² and swing in rad of each payload, by another road than tagsway's."""
    ensemble, count = payloads.ensemble, len(payloads)
    way = find_way(trajectory)
    state = np.zeros(2 * count)
    peak, swing, after = np.zeros(count), np.zeros(count), np.zeros(count)
    end = trajectory.duration_s
    for low, high in itertools.pairwise([*trajectory.breaks_s.tolist(), end + 0.7 * payloads.longest_period_s]):

        def turn(t: float, q: FloatArray, rate: FloatArray, low: float = low, high: float = high):
            push = trajectory(min(max(t, low + 1e-10), high - 1e-10), 2)
            pull = (GRAVITY_M_S2 + push[2]) * np.sin(q) + (push @ way) * np.cos(q)
            own = ensemble.damping_over_inertia_rad_s * rate + ensemble.stiffness_over_inertia_rad2_s2 * q
            return push @ way, -own - pull / ensemble.length_m

        def slope(t: float, y: FloatArray, turn=turn):
            return np.concatenate([y[count:], turn(t, y[:count], y[count:])[1]])

        times = np.linspace(low, high, max(math.ceil((high - low) / 2e-3), 4))
        found = solve_ivp(slope, (low, high), state, "DOP853", t_eval=times, rtol=1e-9, atol=1e-11)
        for t, y in zip(times, found.y.T, strict=True):
            q, rate = y[:count], y[count:]
            x, twist = turn(t, q, rate)
            product = x + payloads.tag_radius_m * (twist * np.cos(q) - rate**2 * np.sin(q))
            peak, swing = np.maximum(peak, np.abs(product)), np.maximum(swing, np.abs(q))
            if t >= end:
                after = np.maximum(after, np.abs(payloads.tag_radius_m * np.sin(q)))
        state = found.y[:, -1]
    return after, peak, swing


def show_table(move: Move, kinds: tuple[str, ...], rng: np.random.Generator) -> list[Candidate]:
    """Print every candidate and return the legal ones, the quickest first."""
    task = DesignTask(
        moves=(move,),
        modes=(DesignMode(frequency_hz=FREQUENCY_HZ, damping_ratio=0.055),),
        band_percent=(11.46,),
        payload=SPREAD,
        limits=read_limits(move),
        kinds=kinds,
    )
    settings = SearchSettings(
        rough=corner_payloads(SPREAD, frequencies=7, dampings=2, shares=(0.95, 0.95)),
        scanned=sample_payloads(SPREAD, 128, rng=rng),
        checked=draw_payloads(SPREAD, 1000, rng=rng),
    )
    jobs: list[tuple[Shaper | None, tuple]] = [(None, ())]
    jobs += [(shaper, axes) for shaper in design_shapers(task)[0] for axes in (("x",), ("x", "z"))]
    found = []
    print(f"{'candidate':<12}{'axes':<5}{'time s':>8}{'m/s²':>7}{'high mm':>8}{'kept %':>8}{'mm':>7}{'swing':>7}")
    for shaper, axes in jobs:
        try:
            c = search_candidate(task.moves, shaper, axes, task.limits, settings)
        except TagswayError as fault:
            print(f"{'unshaped' if shaper is None else shaper.type:<12}{''.join(axes):<5} {fault}")
            continue
        found.append(c)
        v = c.verdict
        print(
            f"{c.name:<12}{''.join(axes):<5}{c.motion_time_s:>8.3f}{c.acceleration_m_s2:>7.2f}{1e3 * c.height_m:>8.1f}"
            f"{100 * v.share_kept:>8.1f}{1e3 * v.placement_m:>7.2f}{math.degrees(v.swing_rad):>6.0f}°"
            f"  {'legal' if c.legal else f'breaks {v.broken}'}",
            flush=True,
        )
    return sorted((c for c in found if c.legal), key=lambda c: c.motion_time_s)


def verify(name: str, found: OptimisedMove, best: Candidate, asked: float, rng: np.random.Generator) -> None:
    """Print what an optimised move takes off, and what an independent simulation says of it."""
    payloads = draw_payloads(SPREAD, 1000, rng=rng)
    after, peak, swing = integrate(found.trajectory, payloads)
    kept = (after <= WINDOW_M) & (peak <= PEEL_M_S2)
    share, swung = float(np.mean(kept)), float(np.mean(kept & (swing <= math.radians(45))))
    own = simulate_motion(found.trajectory, payloads)
    lift = found.trajectory(np.linspace(0, found.motion_time_s, 5000), 2)[:, 2].min()
    print(f"\n{name}: {found.motion_time_s:.3f} s, {found.motion_time_s / best.motion_time_s:.3f} of {best.name} "
          f"{''.join(best.axes)} (asked: at most {asked})")  # fmt: skip
    print(f"  solved in {found.solve_s:.1f} s and {found.rounds} rounds; before the controller's grid "
          f"{found.free_time_s:.4f} s")  # fmt: skip
    print(f"  1000 fresh payloads by DOP853: limits kept by {100 * share:.1f} ± "
          f"{100 * math.sqrt(share * (1 - share) / 1000):.1f} %, with |q| ≤ 45° too {100 * swung:.1f} %; "
          f"worst {1e3 * after.max():.2f} mm, {peak.max():.2f} m/s², {math.degrees(swing.max()):.2f}°")  # fmt: skip
    print(f"  lowest z'' {lift / GRAVITY_M_S2:.3f} g; tagsway's own simulation differs by at most "
          f"{1e3 * np.abs(own.placement_m - after).max():.1e} mm")  # fmt: skip


def show_beyond(motions: dict[str, Trajectory]) -> None:
    """Print the worst placement at some distances from the middle."""
    print("\nworst placement in mm beyond the band (ζ .04 and .07)")
    deviations = (0, 5, 10, 11.46, 15, 20, 25)
    print(f"{'f_n off by ± %':<34}" + "".join(f"{d:>8g}" for d in deviations))
    for name, trajectory in motions.items():
        row = []
        for deviation in deviations:
            sides = FREQUENCY_HZ * (1 + np.array([-1, -1, 1, 1]) * deviation / 100)
            payloads = make_payloads(SPREAD, sides, np.array([0.04, 0.07, 0.04, 0.07]))
            row.append(1e3 * simulate_motion(trajectory, payloads).placement_m.max())
        print(f"{name:<34}" + "".join(f"{value:>8.1f}" for value in row))


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    begun = time.perf_counter()
    move = flexible_move()
    legal = show_table(move, ("zvd",) if options.quick else SHAPER_TYPES, rng)
    print(f"table in {time.perf_counter() - begun:.0f} s")
    best, shaped = legal[0], next(c for c in legal if c.shaper is not None)
    motions = {f"{c.name} {''.join(c.axes)}": c.planned.trajectories[0] for c in (best, shaped)}
    for name, jerk, asked in (("optimised", None, 0.78), ("optimised, jerk ≤ 1000 m/s³", 1000.0, 0.82)):
        bounded = flexible_move(jerk)
        found = optimise_move(bounded, SPREAD, read_limits(bounded))
        verify(name, found, best, asked, rng)
        motions[name] = found.trajectory
    show_beyond(motions)


if __name__ == "__main__":
    main()
