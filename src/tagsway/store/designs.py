"""design.json and its table: what a design found, and what it rests on."""

from typing import Any

import numpy as np

from tagsway.design import Advice, Candidate, Retuned, Verdict
from tagsway.store.documents import shaper_document, to_document

DESIGN_SCHEMA = "tagsway/design/1"
RETUNE_SCHEMA = "tagsway/retune/1"

CANDIDATE_HEADER = (
    "candidate,shaped_axes,motion_time_s,max_acceleration_m_s2,height_mm,legal,breaks,share_kept,worst_placement_mm,"
    "worst_pcp_acceleration_m_s2,worst_swing_deg,worst_box_error_mm"
)


def design_document(advice: Advice) -> dict[str, Any]:
    """Return what design.json holds."""
    task, limits = advice.task, advice.task.limits
    optimum = advice.optimised
    return {
        "schema": DESIGN_SCHEMA,
        "spread": {
            "source": task.payload.source,
            "shape": task.payload.shape,
            "natural_frequency_hz": task.payload.mode.natural_frequency_hz,
            "frequency_percent": task.payload.frequency_percent,
            "damping_ratio": [task.payload.damping_low, task.payload.damping_high],
            "length_mm": 1e3 * task.payload.length_m,
            "tag_radius_mm": 1e3 * task.payload.tag_radius_m,
            "n": task.payload.n,
            "further": [
                {
                    "frequency_hz": each.mode.natural_frequency_hz,
                    "damping_ratio": each.mode.damping_ratio,
                    "frequency_percent": each.frequency_percent,
                    "gain": each.gain,
                }
                for each in task.payload.further
            ],
        },
        "modes": to_document(task.modes),
        "limits": {
            "placement_window_mm": 1e3 * limits.placement_window_m,
            "pcp_acceleration_m_s2": limits.pcp_acceleration_m_s2,
            "box_error_mm": None if limits.box_error_m is None else 1e3 * limits.box_error_m,
            "acceleration_m_s2": limits.acceleration_m_s2,
            "velocity_m_s": limits.velocity_m_s,
            "jerk_m_s3": limits.jerk_m_s3,
            "box_m": limits.box_m,
            "vertical_mm": 1e3 * limits.vertical_m,
            "share": limits.share,
        },
        "place_points_m": [list(move.to_m) for move in task.moves],
        "worst_place_m": list(advice.worst_place_m),
        "chosen": _candidate(advice.chosen),
        "optimised": None
        if optimum is None
        else {
            "motion_time_s": optimum.move.motion_time_s,
            "over_chosen": optimum.move.motion_time_s / advice.chosen.motion_time_s,
            "solve_s": optimum.move.solve_s,
            **_verdict(optimum.verdict),
        },
        "candidates": [_candidate(candidate) for candidate in advice.candidates],
        "beyond_band": {
            "deviation_percent": advice.beyond.deviation_percent.tolist(),
            "placement_mm": {
                name: (1e3 * row).tolist()
                for name, row in zip(advice.beyond.names, advice.beyond.placement_m, strict=True)
            },
        },
        "warnings": to_document(advice.notices),
    }


def candidates_csv(advice: Advice) -> str:
    """Return the table of all candidates as text."""
    rows = []
    for c in advice.candidates:
        v = c.verdict
        worst = (1e3 * v.placement_m, v.pcp_acceleration_m_s2, np.degrees(v.swing_rad), 1e3 * v.box_error_m)
        numbers = ["" if np.isnan(value) else f"{value:.4g}" for value in worst]
        rows.append(
            f"{c.name},{'+'.join(c.axes)},{c.motion_time_s:.4f},{c.acceleration_m_s2:.4f},{1e3 * c.height_m:.2f},"
            f"{str(c.legal).lower()},{v.broken or ''},{v.share_kept:.4f},{','.join(numbers)}"
        )
    return "\n".join([CANDIDATE_HEADER, *rows]) + "\n"


def retune_document(retuned: Retuned) -> dict[str, Any]:
    """Return what `identify retune` says as JSON."""
    return {
        "schema": RETUNE_SCHEMA,
        "natural_frequency_hz": to_document(retuned.natural_frequency_hz),
        "damping_ratio": to_document(retuned.damping_ratio),
        "residual": {
            "amplitude_mm": to_document(retuned.amplitude_m, 1e3),
            "phase_rad": to_document(retuned.phase_rad),
            "now_mm": to_document(retuned.residual_m, 1e3),
            "expected_mm": to_document(retuned.expected_m, 1e3),
        },
        "gain": to_document(retuned.gain),
        "shaper": shaper_document(retuned.shaper),
        "warnings": to_document(list(retuned.notices)),
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "name": candidate.name,
        "shaped_axes": list(candidate.axes),
        "motion_time_s": candidate.motion_time_s,
        "max_acceleration_m_s2": candidate.acceleration_m_s2,
        "height_mm": 1e3 * candidate.height_m,
        "legal": candidate.legal,
        **_verdict(candidate.verdict),
    }


def _verdict(verdict: Verdict) -> dict[str, Any]:
    def number(value: float) -> float | None:
        return None if np.isnan(value) else value

    return {
        "breaks": verdict.broken,
        "share_kept": verdict.share_kept,
        "worst_placement_mm": number(1e3 * verdict.placement_m),
        "worst_pcp_acceleration_m_s2": number(verdict.pcp_acceleration_m_s2),
        "worst_swing_rad": number(verdict.swing_rad),
        "worst_box_error_mm": number(1e3 * verdict.box_error_m),
    }
