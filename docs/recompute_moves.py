"""The documents' numbers of corners, pendulums, moves and robots, as in `recompute_shapers`."""

import ast
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rows import LINES, Row, compare, compare_each, mode_of
from tagsway.model import DesignMode, Move, Pendulum, Robot
from tagsway.robots import find_joints, find_tool
from tagsway.shapers import design_multimode, design_shaper, frequency_response, residual_vibration, step_indicators
from tagsway.trajectories import find_corner_error, plan_corner, plan_feed, plan_move

ANGLES = (30, 45, 60, 90, 120, 135, 150)


def corners(section: Mapping[str, Any]) -> Iterator[Row]:
    """Document 4: the length of each prefilter, and the corner table at 500 µm."""
    speed, mode = section["F_mm_s"] / 1e3, DesignMode(frequency_hz=section["f_Hz"], damping_ratio=section["zeta"])
    for name, seconds in section["Tdec_s"].items():
        shaper = design_shaper(name.lower(), mode)
        yield compare(f"Tdec_s / {name}", seconds, shaper.duration_s, 5.1e-9)
        feed = plan_feed(0.2, max_velocity_m_s=speed, shaper=shaper)
        for angle in ANGLES:
            planned = plan_corner(feed, feed, angle_rad=math.radians(angle), error_m=500e-6)
            ours = np.multiply(1e3, (planned.cornering_time_s, planned.delay_time_s, planned.error_time_s))
            key = f"tc_td_te_ms_at_500um / {name} / {angle}"
            yield from compare_each(key, section["tc_td_te_ms_at_500um"][name][str(angle)], ours.tolist(), 1e-4)
            whole = find_corner_error(feed, feed, angle_rad=math.radians(angle), cornering_time_s=shaper.duration_s)
            key = f"error_mm_if_tc=Tdec / {name} / {angle}"
            yield compare(key, section["error_mm_if_tc=Tdec"][name][str(angle)], 1e3 * whole.error_m, 1.1e-5)
    for key, value in section["V_FIR_nominal"].items():
        zeta = float(key.removeprefix("zeta"))
        line = DesignMode(frequency_hz=section["f_Hz"], damping_ratio=zeta)
        left = residual_vibration(design_shaper("fir", line), mode_of(section["f_Hz"], zeta))
        yield compare(f"V_FIR_nominal / {key}", value, left, 5.1e-8)
    for key, value in section["zv_trough_H"].items():
        zeta = float(key.removeprefix("zeta"))
        shaper = design_shaper("zv", DesignMode(frequency_hz=section["f_Hz"], damping_ratio=zeta))
        trough = frequency_response(shaper, np.array([0.5 / shaper.duration_s])).gain[0]
        yield compare(f"zv_trough_H / {key}", value, float(trough), 5.1e-8)


def pendulums(section: Mapping[str, Any]) -> Iterator[Row]:
    """Document 1, Table 6.1: which mode its pendulums have, and which pendulums have its modes."""
    printed = {"flex": (0.04585, 2e-5, 1e-7), "stiff": (0.02295, 2.4e-5, 2e-5)}
    for key, swapped, mass in (
        ("table6.1_m225", False, 0.225),
        ("table6.1_m255", False, 0.255),
        ("code_m225", True, 0.225),
        ("code_m255", True, 0.255),
    ):
        for name, (length, stiffness, damping) in printed.items():
            k, b = (damping, stiffness) if swapped else (stiffness, damping)
            frequency, zeta = section[key][name]
            ours = _pendulum(length, math.degrees(k), math.degrees(b), mass)
            targets = section["targets"][name]
            yield compare(f"{key} / {name} / 0", frequency, ours.natural_frequency_hz, 5.1e-5, targets[0])
            yield compare(
                f"{key} / {name} / 1", zeta, ours.damping_ratio, 5.1e-5 if zeta > 0.01 else 5.1e-8, targets[1]
            )
    for name, (frequency, zeta) in section["targets"].items():
        entry = section["needed_m225"][name]
        needed = _pendulum(entry["l_mm"] / 1e3, entry["k_Nm_per_rad"], entry["b_Nms_per_rad"], 0.225)
        # l, k and b are given to five digits or more
        yield compare(f"targets / {name} / 0", frequency, needed.natural_frequency_hz, 1e-5)
        yield compare(f"targets / {name} / 1", zeta, needed.damping_ratio, 1e-4 * zeta)
        bare = _pendulum(section["l_mm_if_k0"][name] / 1e3, 0.0, 0.0, 0.225)
        yield compare(f"l_mm_if_k0 / {name}", frequency, bare.natural_frequency_hz, 1e-5)
        short = _pendulum(section["needed_l_mm_if_k_table_m225"][name] / 1e3, math.degrees(printed[name][1]), 0, 0.225)
        yield compare(f"needed_l_mm_if_k_table_m225 / {name}", frequency, short.natural_frequency_hz, 5e-5)


def _pendulum(length_m: float, stiffness: float, damping: float, mass_kg: float) -> Pendulum:
    inertia = mass_kg * length_m**2
    return Pendulum(
        length_m=length_m,
        tag_radius_m=length_m,
        stiffness_over_inertia_rad2_s2=stiffness / inertia,
        damping_over_inertia_rad_s=damping / inertia,
    )


def reference_move(section: Mapping[str, Any]) -> Iterator[Row]:
    """Document 1: the pick-and-place whose time is 2.517484/√a, and the printed motion times."""

    def planned(acceleration: float):
        return plan_move(
            Move(
                from_m=(-0.35, 0, -0.767),
                to_m=(0.35, 0, -0.767),
                pick_height_m=0.05,
                place_height_m=0.05,
                max_acceleration_m_s2=acceleration,
            )
        )

    slow = planned(1.0)
    yield compare("C=T*sqrt(a)", section["C=T*sqrt(a)"], slow.duration_s, 1e-9)
    apex = float(slow(np.array([slow.duration_s / 2]))[0, 2]) + 0.767
    yield compare("apex_height_m", section["apex_height_m"], apex, 5.1e-11)
    for acceleration, seconds in section["T_unshaped_s"].items():
        key = f"T_unshaped_s / {acceleration}"
        yield compare(key, seconds, planned(float(acceleration)).duration_s, 5.1e-5)
    for name, times in section["published_motion_times"].items():
        kind, _, shaped = name.partition("_")
        added = design_shaper("zv", LINES[kind]).duration_s if shaped.startswith("shaped") else 0.0
        for acceleration, seconds in times.items():
            key = f"published_motion_times / {name} / {acceleration}"
            yield compare(key, seconds, planned(float(acceleration)).duration_s + added, section["tol_s"], seconds)


THESIS_DELTA = Robot(kind="delta", lengths_m={"base": 0.2, "platform": 0.045, "upper": 0.348087991749213, "lower": 0.8})


DUAL_MODE_DELTA = Robot(kind="delta", lengths_m={"base": 0.17, "platform": 0.06, "upper": 0.26, "lower": 0.68})


DUAL_MODE_POINTS_MM = {
    "P0": (-200, 0, -740),
    "P1": (-200, 0, -710),
    "P2": (-182, -9, -670),
    "P3": (182, -191, -670),
    "P4": (200, -200, -710),
    "P5": (200, -200, -780),
}


def delta_robots(section: Mapping[str, Any]) -> Iterator[Row]:
    """Documents 1 and 3: joint angles, and how far the way back misses, in mm."""
    for key, robot in {"thesis": THESIS_DELTA, "seed002": DUAL_MODE_DELTA}.items():
        for name, angles in section[key].items():
            point = DUAL_MODE_POINTS_MM.get(name) or ast.literal_eval(name)
            position = np.array(point) / 1e3
            joints = find_joints(robot, position)
            yield from compare_each(f"{key} / {name}", angles, np.degrees(joints).tolist(), 1e-6)
            missed = 1e3 * float(np.max(np.abs(find_tool(robot, joints) - position)))
            yield compare(f"{key} / {name} / round trip (mm)", 0.0, missed, 1e-9)


def beyond_the_reference() -> Iterator[Row]:
    """Numbers of the documents' text and figures; what they are held against was computed independently."""
    low = [0, 5, 10, 15, 20]
    plants = [mode_of(w / 0.9 / (2 * math.pi), 0.05) for w in (35.424, 36.405)]
    for kinds, settling in {
        ("zvd", "ei"): (0.276, 0.292, 0.310, 0.331, 0.358),
        ("zvd",): (0.142, 0.150, 0.156, 0.262, 0.590),
    }.items():
        for percent, seconds in zip(low, settling, strict=True):
            share = 1 - percent / 100
            modes = [
                DesignMode(frequency_hz=share * plant.natural_frequency_hz, damping_ratio=0.05)
                for plant, _ in zip(plants, kinds, strict=False)
            ]
            step = step_indicators(design_multimode(kinds, modes), plants[0])
            key = f"Figures 14-16 / {'-'.join(kinds)} / design {percent} % low / settling_5pct_s"
            yield compare(key, seconds, step.settling_s, 1e-3)
    points = np.array(list(DUAL_MODE_POINTS_MM.values())) / 1e3
    length = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    yield compare("document 3 / straights and chords (m)", 0.5965, length, 5.1e-5, 0.6048)
    quintic = plan_move(Move(from_m=(0, 0, 0), to_m=(0.6048, 0, 0), max_acceleration_m_s2=55.87, profile="quintic"))
    yield compare("document 3 / quintic of 0.6048 m at 55.87 m/s² / duration (s)", 0.25, quintic.duration_s, 2e-5, 0.25)
    fastest = float(quintic(quintic.duration_s / 2, 1)[0])
    yield compare("document 3 / quintic of 0.6048 m at 55.87 m/s² / peak velocity (m/s)", 4.536, fastest, 1e-3, 4.536)
    for azimuth, angle in ((-90, 80.2), (180, 74.9)):
        robot = Robot(kind="delta", lengths_m=DUAL_MODE_DELTA.lengths_m, leg_azimuth_deg=azimuth)
        worst = float(np.degrees(find_joints(robot, points[-1])).max())
        yield compare(f"document 3 / P5, leg 1 at {azimuth}°, largest angle (°)", angle, worst, 0.051, "≤ 75")
    line = DesignMode(frequency_hz=6.34, damping_ratio=0.022)
    for kind, largest in {"zv": 158.9, "zvd": 150.6}.items():
        feed = plan_feed(0.2, max_velocity_m_s=0.16, shaper=design_shaper(kind, line))
        angles = np.arange(largest - 0.2, largest + 0.2, 0.01)
        square = [plan_corner(feed, feed, angle_rad=math.radians(a), error_m=5e-4).perpendicular for a in angles]
        last = float(angles[np.flatnonzero(square)[-1]])
        yield compare(f"document 4 / {kind} / last angle with a perpendicular (°)", largest, last, 0.051)
