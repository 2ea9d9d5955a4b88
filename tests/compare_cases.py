"""Measured sets and moves with known differences, for comparisons."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenes import small_scene
from tagsway.filters import clean_track
from tagsway.indicators import align_move, find_watched, measure_indicators
from tagsway.model import AlignedMove, DesignMode, FloatArray, Indicators, Shaper, TagTrack, Track
from tagsway.pipeline.shaping import plan_shaped_move
from tagsway.scene import Scene, simulate_scene
from tagsway.scene.model import Waypoints
from tagsway.shapers import design_shaper

NOISE_M = 2e-5
SHAPER = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=0.02))


def shaped_scene(scene: Scene, shaper: Shaper = SHAPER, *, rest_s: float = 1.2) -> Scene:
    """Return a scene whose tool runs its own move, shaped on x."""
    assert scene.move is not None
    planned = plan_shaped_move(replace(scene.move, shaped_axes=("x",), sample_time_ms=5.0), shaper).sampled
    time = np.arange(len(planned.position_m)) * planned.sample_time_s
    x, _, z = planned.position_m.T
    path = Waypoints(time_s=tuple(time.tolist()), x_m=tuple(x.tolist()), z_m=tuple(z.tolist()))
    return replace(scene, move=None, trajectory=path, duration_s=scene.tool.start_s + float(time[-1]) + rest_s)


def track_of(scene: Scene, *, rate_hz: float = 200.0, seed: int = 0) -> Track:
    """Return what an ideal camera sees of a scene, with noise."""
    rng, time = np.random.default_rng(seed), np.arange(int(scene.duration_s * rate_hz)) / rate_hz
    motion = simulate_scene(scene, time)

    def tag(position: FloatArray) -> TagTrack:
        angle = np.full(len(time), np.nan)
        seen = position[:, [0, 2]] + NOISE_M * rng.normal(size=(len(time), 2))
        return TagTrack(position=seen, position_std=np.full(seen.shape, NOISE_M), angle_rad=angle, angle_std_rad=angle)

    return Track(frame=np.arange(len(time)), time_s=time, length_unit="m", tcp=tag(motion.tcp_m), pcp=tag(motion.pcp_m))


def judged(track: Track) -> tuple[Indicators, AlignedMove]:
    """Return indicators and move of a track, as a measurement without a decay has them."""
    clean = clean_track(track)
    window = find_watched(clean)
    assert window is not None
    found, move = measure_indicators(track, clean, window), align_move(track, clean, window)
    assert found is not None
    assert move is not None
    return found, move


def repeat(number: int, **changes: Any) -> Scene:
    """Return the small scene with another payload, and another start."""
    rng = np.random.default_rng(number)
    scene = small_scene(**changes)
    payload = replace(scene.payload, length_m=0.04585 * (1 + 0.01 * rng.normal()))
    return replace(scene, payload=payload, tool=replace(scene.tool, start_s=0.1 + 0.2 * rng.random()), duration_s=2.8)


def write_measured_set(folder: Path, rows: list[dict[str, Any]]) -> Path:
    """Write a folder as `identify batch` leaves it, with rows of known numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "attempts.jsonl").touch()
    plain = {
        "pick": None,
        "subset": "s",
        "status": "ok",
        "error": None,
        "warnings": None,
        "rejected_by": None,
        "key": None,
        "settling_time_s": 1.0,
        "motion_time_s": 1.0,
        "trajectory_time_s": 0.9,
        "overshoot_percent": 4.0,
        "max_pcp_acceleration_m_s2": 6.0,
        "max_pcp_vector_m_s2": 12.0,
        "residual_max_m_s2": 2.0,
        "residual_rms_m_s2": 1.0,
        "place_error_mm": 8.0,
        "reference_mm": 280.0,
        "watched_s": 2.5,
        "bandwidth_hz": 30.0,
    }
    table = pd.DataFrame.from_records([{"file": f"r{n}.mp4", **plain, **row} for n, row in enumerate(rows)])
    table.to_csv(folder / "measurements.csv", index=False)
    return folder


def repeats(factor: dict[str, Any], seed: int, n: int = 6, **shift: float) -> list[dict[str, Any]]:
    """Return rows that scatter about the plain numbers, some of them shifted."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(n):
        motion = 1.0 + shift.get("motion_time_s", 0.0) + 0.02 * rng.normal()
        overshoot = 4.0 + shift.get("overshoot_percent", 0.0) + 0.1 * rng.normal()
        peak = 6.0 + shift.get("max_pcp_acceleration_m_s2", 0.0) + 0.1 * rng.normal()
        rows.append(
            {
                **factor,
                "motion_time_s": motion,
                "settling_time_s": motion,
                "overshoot_percent": overshoot,
                "max_pcp_acceleration_m_s2": peak,
                "residual_rms_m_s2": overshoot / 4 + 0.005 * rng.normal(),
                "trajectory_time_s": 0.9 + 0.002 * rng.normal(),
                "place_error_mm": 2 * overshoot,
            }
        )
    return rows
