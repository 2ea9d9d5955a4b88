"""From a design to the files of its folder."""

from dataclasses import replace
from pathlib import Path

from tagsway.design import Advice
from tagsway.files import write_text
from tagsway.model import Move
from tagsway.pipeline.shaping import plan_shaped_move
from tagsway.report.design import write_design
from tagsway.robots import plan_joints
from tagsway.store.controller import controller_text, describe_trajectory
from tagsway.store.designs import candidates_csv, design_document
from tagsway.store.documents import dump, write_shaper
from tagsway.trajectories import check_limits, sample_trajectory

DESIGN_FILES = (
    "shaper.json",
    "trajectory.csv",
    "trajectory.json",
    "optimised.csv",
    "optimised.json",
    "candidates.csv",
    "design.png",
    "design.json",
)


def write_advice(advice: Advice, folder: Path, *, figure: bool = True) -> None:
    """Write the chosen move, the optimised one where there is one, and the evidence; design.json comes last.

    An unshaped move has no shaper.json; where there are several place points, trajectory.csv leads to the first, and
    trajectory-2.csv and so on to the others. The figure takes a second and may be left out. What an earlier design left
    and this one does not have is removed.
    """
    chosen = advice.chosen
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / "design.json").exists():
        numbered = [path for path in folder.glob("trajectory-[0-9]*.*") if path.suffix in {".csv", ".json"}]
        for path in [*(folder / name for name in DESIGN_FILES), *numbered]:
            path.unlink(missing_ok=True)
    if chosen.shaper is not None:
        write_shaper(folder / "shaper.json", chosen.shaper)
    for i, move in enumerate(chosen.planned.moves):
        stem = "trajectory" if i == 0 else f"trajectory-{i + 1}"
        planned = plan_shaped_move(_with_limits(move, advice), chosen.shaper)
        text, description = planned.files()
        write_text(folder / f"{stem}.csv", text)
        write_text(folder / f"{stem}.json", dump(description))
    if advice.optimised is not None:
        _write_optimised(advice, folder)
    write_text(folder / "candidates.csv", candidates_csv(advice))
    if figure:
        write_design(advice, folder / "design.png")
    write_text(folder / "design.json", dump(design_document(advice)))


def _write_optimised(advice: Advice, folder: Path) -> None:
    assert advice.optimised is not None
    trajectory = advice.optimised.move.trajectory
    move = _with_limits(advice.task.moves[0], advice)
    sampled = sample_trajectory(trajectory, move.sample_time_ms / 1e3)
    known = move.robot.kind == "cartesian" or move.robot.lengths_m
    joints = plan_joints(sampled, move.robot) if known else None
    text = controller_text(sampled, joints)
    report = check_limits(trajectory, trajectory, move)
    write_text(folder / "optimised.csv", text)
    write_text(folder / "optimised.json", dump(describe_trajectory(sampled, report, text, joints)))


def _with_limits(move: Move, advice: Advice) -> Move:
    """Return the move with the limits that were designed for: its own acceleration is what the design chose."""
    limits = advice.task.limits
    highest = limits.acceleration_m_s2 or max(move.max_acceleration_m_s2, advice.chosen.acceleration_m_s2)
    return replace(move, limits=replace(move.limits, acceleration_m_s2=highest))
