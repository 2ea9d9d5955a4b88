"""The runs behind `identify simulate`: one move as it is and as it is shaped, or a study of many."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from tagsway.cli.payloads import KnownPayload
from tagsway.cli.shape import tell_unshaped
from tagsway.cli.study_options import Study
from tagsway.errors import InputError
from tagsway.model import LimitRow, Move, Notice, Pair, Shaper, StudyRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tagsway.simulation import SimulatedMotion
    from tagsway.studies import Limit, Shaping

LARGE_SWING_DEG = 75.0
"""Above it the pendulum's parameters are not known from any film."""

LITTLE_PERCENT = 0.5
"""An unshaped overshoot below it makes the ratio of two overshoots a matter of chance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a run found: rows, what follows from them, how to draw them, and further files by name."""

    rows: Sequence[StudyRow]
    title: str
    draw: "Callable[[], Figure]"
    limits: Sequence[LimitRow] = ()
    pairs: Sequence[Pair] | None = None
    notices: Sequence[Notice] = ()
    motions: Sequence[tuple[str, str]] = ()


def run_once(
    move: Move, known: KnownPayload, shaper: Shaper | None, reference_m: float | None, mass_kg: float | None
) -> Found:
    """Simulate the move as it is and as it is shaped."""
    import numpy as np

    from tagsway.simulation import simulate_moves
    from tagsway.studies import UNSHAPED, Shaping, worst_rows

    shapings = [UNSHAPED]
    if shaper is not None and move.shaped_axes:
        shapings.append(Shaping(name=",".join(move.shaped_axes), shaper=shaper, axes=move.shaped_axes))
    fastest = [move.max_acceleration_m_s2]
    motions = [simulate_moves(shaping.plan(move, fastest[0]), known.payload) for shaping in shapings]
    criteria = {s.name: m.judge(reference_m=reference_m) for s, m in zip(shapings, motions, strict=True)}
    rows = worst_rows(criteria, shapings, fastest, known.payload)
    swing = max(float(np.degrees(np.abs(motion.sway.angle_rad).max())) for motion in motions)
    notices = [*known.notices, *tell_unshaped(move, shaper), *_notices(rows), *_swing_notices(swing)]
    tables = [
        (f"motion-{s.name.replace(',', '')}.csv", _motion_csv(motion, known.nominal, mass_kg))
        for s, motion in zip(shapings, motions, strict=True)
    ]
    title = f"at {move.max_acceleration_m_s2:g} m/s², worst of {len(known.payload)}"
    draw = partial(_draw_motions, shapings, motions, known.nominal)
    return Found(rows=rows, title=title, draw=draw, notices=notices, motions=tables)


def _draw_motions(shapings: "Sequence[Shaping]", motions: "Sequence[SimulatedMotion]", nominal: int) -> "Figure":
    from tagsway.report.studies import MotionCurve, plot_motions

    return plot_motions(
        [
            MotionCurve(
                name=shaping.name,
                time_s=motion.time_s[:, 0],
                tool_m=motion.pivot_m[:, :, 0, 0],
                product_m=motion.pcp_m[:, :, 0],
                product_m_s2=motion.pcp_acceleration_m_s2[:, :, 0],
                nominal=nominal,
            )
            for shaping, motion in zip(shapings, motions, strict=True)
        ]
    )


def _draw_study(rows: Sequence[StudyRow], limits: Sequence[LimitRow] = ()) -> "Figure":
    from tagsway.report.studies import plot_study

    return plot_study(rows, limits)


def run_study(
    study: Study,
    move: Move,
    known: KnownPayload,
    shaper: Shaper | None,
    scan: list[float],
    limits: "list[Limit]",
    reference_m: float | None,
) -> Found:
    """Run one of the studies; `scan` are the accelerations of two of them, `limits` what the third one keeps."""
    from tagsway.studies import find_pairs, shapings_of, study_accelerations, study_deviations, study_limits

    shapings: tuple[Shaping, ...] = shapings_of(shaper)
    payload = known.payload
    worst = f"worst of {len(payload)}" if len(payload) > 1 else "one payload"
    if study is Study.DEVIATIONS:
        if len(payload) < 2:
            raise InputError(
                "--study deviations needs payloads that differ: give --spread PERCENT, or measurements.csv"
            )
        rows = study_deviations(move, payload, shapings, nominal=known.nominal, reference_m=reference_m)
        title = f"at {move.max_acceleration_m_s2:g} m/s², over the frequency"
        return Found(rows=rows, title=title, draw=partial(_draw_study, rows), notices=known.notices)
    if study is Study.ACCELERATIONS:
        rows = study_accelerations(move, scan, payload, shapings, reference_m=reference_m)
        pairs = find_pairs(rows)
        notices = [*known.notices, *_notices(rows)]
        title = f"over the acceleration, {worst}"
        return Found(rows=rows, title=title, draw=partial(_draw_study, rows), pairs=pairs, notices=notices)
    if not limits:
        raise InputError("--study limits needs one: give --max-pcp-acceleration, --max-overshoot or --box")
    found, rows = study_limits(move, scan, payload, shapings, limits, reference_m=reference_m)
    return Found(
        rows=rows,
        title=f"scanned from {scan[0]:g} to {scan[-1]:g} m/s², {worst}",
        draw=partial(_draw_study, rows, found),
        limits=found,
        notices=known.notices,
    )


def _notices(rows: Sequence[StudyRow]) -> list[Notice]:
    plain = [row for row in rows if row.shaping == "unshaped" and row.overshoot_percent < LITTLE_PERCENT]
    shaped = any(row.shaping != "unshaped" for row in rows)
    found = []
    if plain and shaped:
        found.append(
            Notice(
                code="ratio_ill_conditioned",
                message=f"the unshaped move at {plain[0].max_acceleration_m_s2:g} m/s² overshoots by only "
                f"{plain[0].overshoot_percent:.2g} %: the ratio to it says little, look at the overshoots",
            )
        )
    if any(row.motion_time_s is None for row in rows):
        found.append(Notice(code="never_settles", message="some moves do not settle within 2 s after their end"))
    return found


def _swing_notices(swing_deg: float) -> list[Notice]:
    if swing_deg <= LARGE_SWING_DEG:
        return []
    words = f"the payload swings by {swing_deg:.0f}°: farther than any film shows it, a spring need not hold there"
    return [Notice(code="large_swing", message=words)]


def _motion_csv(motion: "SimulatedMotion", nominal: int, mass_kg: float | None) -> str:
    """Return the nominal payload's motion; where the acceleration jumps a time stands twice."""
    import numpy as np

    names = ["time_s"] + [f"{what}_{axis}_{unit}" for what, unit in _QUANTITIES for axis in "xz"]
    columns = [motion.time_s[:, :1], 1e3 * motion.pivot_m[:, :, 0, 0], 1e3 * motion.pcp_m[:, :, 0, nominal]]
    columns += [motion.pcp_velocity_m_s[:, :, 0, nominal], motion.pcp_acceleration_m_s2[:, :, 0, nominal]]
    if mass_kg is not None:
        names += ["pcp_force_x_n", "pcp_force_z_n"]
        columns.append(motion.pcp_force_n(mass_kg)[:, :, 0, nominal])
    names.append("angle_rad")
    columns.append(motion.sway.angle_rad[:, 0, nominal, None])
    rows = np.concatenate(columns, axis=1)
    return "\n".join([",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"


_QUANTITIES = (("tcp", "mm"), ("pcp", "mm"), ("pcp_velocity", "m_s"), ("pcp_acceleration", "m_s2"))
