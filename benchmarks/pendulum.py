"""What the pendulum's fit may claim: random payloads from track to result, against their truth.

    python benchmarks/pendulum.py [--scenes 200] [--first 0] [--workers 2] [--plain] [--verbose]

Each scene is simulated by `tagsway.scene` (Lagrange's equations, DOP853), not by the equations of the fit, and seen by
a camera that errs by the stated priors: scale 0.3 %, one tag against the other 0.5 %, stretch along z 0.2 %, gravity
0.5°. A third holds what the fit does not model: a second body, a sway out of the plane, a grip that slips. `--plain`
leaves those out.

"Informative" scenes are those whose Fisher information, with the true motion of the pivot, white noise and the same
priors, gives k within 10 %: a claim is wanted there, and nowhere a wrong one. A decay alone is never claimed, however
informative: its k hangs on the spring's being linear. Of a second body the truth is the first one's l and k alone.
"""

import argparse
import math
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.errors import NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.modal import find_window, identify_modes
from tagsway.model import GRAVITY_M_S2, Estimate, FloatArray, Mode, Move, Pendulum, TagTrack, Track
from tagsway.pendulum import fit_pendulum
from tagsway.scene import Motion, Scene, simulate_scene
from tagsway.scene.model import Payload, SecondBody, Tool
from tagsway.scene.motion import find_modes
from tagsway.scene.optics import VideoFormat

CAMERA_STD = np.array([0.003, 0.005, 0.002, math.radians(0.5)])
"""Scale, relative scale, stretch along z, tilt."""

ANGLE_NOISE_RAD = 2e-3
KINDS = ("plain", "second body", "out of plane", "slip")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One random scene, and how it is filmed."""

    kind: str
    scene: Scene
    noise_m: float
    slip_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What became of one scene; NaN for what was not told."""

    seed: int
    kind: str
    frequency_inside: float
    damping_inside: float
    operating_inside: float
    length_std: float
    length_share: float
    length_inside: float
    stiffness_share: float
    determined: bool
    informative: bool
    moved: bool
    seconds: float
    reason: str


def draw_case(seed: int, *, plain: bool) -> Case:
    """Return a random payload under a random move, or let go by hand."""
    rng = np.random.default_rng(seed)
    kind = "plain" if plain or rng.random() < 2 / 3 else str(rng.choice(KINDS[1:]))
    length = float(np.exp(rng.uniform(math.log(0.022), math.log(0.12))))
    spring = float(rng.uniform(0.0, 0.5))
    omega = math.sqrt(GRAVITY_M_S2 / length / (1 - spring))
    point = rng.random() < 0.5
    released = rng.random() < 0.15
    payload = Payload(
        length_m=length,
        tag_radius_m=length * (1.0 if point else float(rng.uniform(0.55, 1.1))),
        natural_frequency_hz=omega / (2 * math.pi),
        damping_ratio=float(np.exp(rng.uniform(math.log(1e-3), math.log(0.05)))),
        quadratic_drag_per_rad=float(rng.uniform(0, 0.08)),
        coulomb_friction_rad_s2=float(rng.uniform(0, 0.003)) * omega**2 if rng.random() < 0.3 else 0.0,
        release_angle_rad=float(rng.uniform(0.2, 0.9)) if released else 0.0,
        sideways_angle_rad=float(rng.uniform(0.03, 0.1)) if kind == "out of plane" else 0.0,
    )
    half = float(rng.uniform(0.15, 0.35))
    height = float(rng.choice([0.0, 0.02, 0.05]))
    # The swing that a step of acceleration makes is 2 a / (l ω²), and a move holds several.
    acceleration = float(rng.uniform(0.1, 0.45)) * length * omega**2
    move = Move(
        from_m=(-half, 0.0, 0.0),
        to_m=(half, 0.0, 0.0),
        max_acceleration_m_s2=acceleration,
        profile="pick-and-place" if height else "bang-bang",
        pick_height_m=height,
        place_height_m=height,
    )
    duration = 0.3 + (0.0 if released else 3.0 * math.sqrt((2 * half + 2 * height) / acceleration))
    second = SecondBody(
        hinge_m=0.7 * length,
        length_m=float(rng.uniform(0.2, 0.6)) * length,
        mass_kg=float(rng.uniform(0.002, 0.01)),
        damping_n_m_s_per_rad=1e-5,
    )
    scene = Scene(
        duration_s=duration + float(rng.uniform(2.0, 4.0)),
        payload=payload,
        second_body=second if kind == "second body" else None,
        tool=Tool(start_s=0.25, pivot_offset_m=(float(rng.uniform(-5e-3, 5e-3)), -float(rng.uniform(0.01, 0.05)))),
        move=None if released else move,
        video=VideoFormat(fps_hz=float(rng.choice([120.0, 200.0, 240.0]))),
    )
    noise = float(np.exp(rng.uniform(math.log(1e-5), math.log(1e-4))))
    return Case(kind=kind, scene=scene, noise_m=noise, slip_m=float(rng.uniform(1e-4, 5e-4)) if kind == "slip" else 0)


def film(case: Case, rng: np.random.Generator) -> tuple[Track, Motion, FloatArray]:
    """Return the track that a camera with its errors makes, the true motion, and the frames' times."""
    scene = case.scene
    times = np.arange(round(scene.duration_s * scene.video.fps_hz)) / scene.video.fps_hz
    motion = simulate_scene(scene, times)
    scale, relative, stretch, tilt = rng.standard_normal(4) * CAMERA_STD
    turn = np.array([[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]])

    def see(point: FloatArray, one: float) -> FloatArray:
        seen = (1 + scale + one) * (point @ turn.T) * [1.0, 1 + stretch]
        return np.asarray(seen + case.noise_m * rng.standard_normal(seen.shape))

    pcp, angle = motion.pcp_m[:, [0, 2]].copy(), motion.angle_rad + tilt + 0.02
    late = times > scene.tool.start_s + rng.uniform(0.1, 0.4)
    pcp[late] += case.slip_m * np.array([0.6, -0.8])
    angle[late] += 5 * case.slip_m / scene.payload.length_m * 0.1
    return (
        Track(
            frame=np.arange(len(times)),
            time_s=times,
            length_unit="m",
            tcp=_tag(see(motion.tcp_m[:, [0, 2]], -relative / 2), np.full(len(times), tilt), case.noise_m, rng),
            pcp=_tag(see(pcp, relative / 2), angle, case.noise_m, rng),
        ),
        motion,
        times,
    )


def _tag(position: FloatArray, angle: FloatArray, noise: float, rng: np.random.Generator) -> TagTrack:
    return TagTrack(
        position=position,
        position_std=np.full_like(position, noise),
        angle_rad=angle + ANGLE_NOISE_RAD * rng.standard_normal(len(angle)),
        angle_std_rad=np.full(len(angle), ANGLE_NOISE_RAD),
    )


def fisher_stiffness(case: Case, motion: Motion) -> float:
    """Return the standard error of k/J over k/J that the data hold: known pivot, white noise, the camera's priors."""
    pendulum = case.scene.payload.pendulum()
    step = 2e-3
    nodes = np.arange(0.0, motion.time_s[-1] + step, step)
    halves = np.linspace(nodes[0], nodes[-1], 2 * len(nodes) - 1)
    path = np.column_stack([np.interp(halves, motion.time_s, motion.pivot_m[:, i]) for i in (0, 2)])
    if case.scene.move is not None:
        path = simulate_scene(replace(case.scene, second_body=None), halves).pivot_m[:, [0, 2]]
    velocity = np.gradient(path, halves, axis=0)
    omega = math.sqrt(pendulum.angular_frequency_squared)
    names = ["length", "k", "b", "r", "d", "c", "q", "p", "x", "z", "zero", "scale", "relative", "stretch", "tilt"]
    change, tiny = np.eye(len(names) + 1)[:, 1:] * 1e-5, 1e-5
    longer, k, b, r, d, c, q, p, x, z, zero, scale, relative, stretch, tilt = change.T
    length, shift = pendulum.length_m * (1 + longer), pendulum.tag_radius_m * (1 + r)
    cosine, sine = np.cos(tilt), np.sin(tilt)
    tool = 1 + scale - relative / 2
    vx, vz = velocity[:, 0, None] / tool, velocity[:, 1, None] / tool / (1 + stretch)
    angle, _ = simulate_sway(
        PendulumEnsemble(
            length_m=length,
            stiffness_over_inertia_rad2_s2=pendulum.stiffness_over_inertia_rad2_s2 + k * omega**2,
            damping_over_inertia_rad_s=pendulum.damping_over_inertia_rad_s + b * omega,
            quadratic_drag_per_rad=pendulum.quadratic_drag_per_rad + d,
            coulomb_friction_rad_s2=pendulum.coulomb_friction_rad_s2 + c * omega**2,
        ),
        nodes,
        np.stack([cosine * vx + sine * vz, cosine * vz - sine * vx], axis=1),
        angle_rad=case.scene.payload.release_angle_rad + q,
        momentum_rad_s=p * omega,
        stiction_rate_rad_s=0.05,
    )
    angle = np.stack([np.interp(motion.time_s, nodes, column) for column in angle.T], axis=1)
    start = motion.time_s >= case.scene.tool.start_s
    arm = (1 + scale + relative / 2) * shift
    seen_x = x + arm * np.sin(angle + tilt) + relative * motion.tcp_m[:, :1]
    seen_z = z - (1 + stretch) * arm * np.cos(angle + tilt) + relative * motion.tcp_m[:, 2:]
    channels = [seen_x / case.noise_m / math.sqrt(2), seen_z / case.noise_m / math.sqrt(2), (angle + zero) / 2e-3]
    slopes = np.concatenate([(one[:, 1:] - one[:, :1])[start] / tiny for one in channels])
    priors = np.zeros(len(names))
    priors[[4, 5, 11, 12, 13, 14]] = 1 / np.array([0.1, 0.005, *CAMERA_STD])
    spread = np.linalg.pinv(slopes.T @ slopes + np.diag(priors**2), hermitian=True)
    k_over_j = pendulum.stiffness_over_inertia_rad2_s2
    return omega**2 * math.sqrt(spread[1, 1]) / max(k_over_j, 1e-9)


def judge(seed: int, plain: bool) -> Score:
    """Simulate, film and identify one scene."""
    case, rng = draw_case(seed, plain=plain), np.random.default_rng(10_000 + seed)
    track, motion, _ = film(case, rng)
    truth, mode = case.scene.payload.pendulum(), find_modes(case.scene)[0]
    nan = float("nan")
    begin = time.process_time()
    try:
        clean = clean_track(track)
        window = find_window(track, clean)
        modal = identify_modes(track, window).estimate
        found = fit_pendulum(track, window, modal, rng=rng).estimate
    except NotIdentifiableError as reason:
        return Score(
            seed=seed, kind=case.kind, frequency_inside=nan, damping_inside=nan, operating_inside=nan,
            length_std=nan, length_share=nan, length_inside=nan, stiffness_share=nan, determined=False,
            informative=False, moved=False, seconds=0.0, reason=str(reason),
        )  # fmt: skip
    seconds = time.process_time() - begin
    length, stiffness = found.length_m, found.stiffness_over_inertia_rad2_s2
    return Score(
        seed=seed,
        kind=case.kind,
        frequency_inside=_inside(modal.natural_frequency_hz, mode.natural_frequency_hz),
        damping_inside=_inside(modal.damping_ratio, mode.damping_ratio),
        operating_inside=nan
        if modal.amplitude_m is None
        else _inside(modal.operating_damping_ratio, _damping_at(truth, mode, modal.amplitude_m.value)),
        length_std=nan if length is None else (length.value - truth.length_m) / length.std,
        length_share=nan if length is None else length.value / truth.length_m - 1,
        length_inside=_inside(length, truth.length_m),
        stiffness_share=nan if stiffness is None else _share(stiffness, truth),
        determined=found.determined,
        informative=fisher_stiffness(case, motion) <= 0.1,
        moved=case.scene.move is not None,
        seconds=seconds,
        reason=found.reason,
    )


def _inside(estimate: Estimate | None, truth: float) -> float:
    return float("nan") if estimate is None else float(estimate.ci95[0] <= truth <= estimate.ci95[1])


def _damping_at(pendulum: Pendulum, mode: Mode, amplitude_m: float) -> float:
    """Return the damping ratio at a swing, where drag and dry friction take part."""
    swing = amplitude_m / pendulum.tag_radius_m
    friction = pendulum.coulomb_friction_rad_s2 / pendulum.angular_frequency_squared
    drag = 4 / (3 * math.pi) * pendulum.quadratic_drag_per_rad * swing
    return mode.damping_ratio + drag + 2 / math.pi * friction / swing


def _share(stiffness: Estimate, truth: Pendulum) -> float:
    k = truth.stiffness_over_inertia_rad2_s2
    return abs(stiffness.value - k) / k if k > 0 else math.inf


def report(scores: list[Score]) -> None:
    """Print the shares asked for."""
    column = {name: np.array([getattr(s, name) for s in scores]) for name in Score.__dataclass_fields__}
    told, sure, informative = np.isfinite(column["length_std"]), column["determined"], column["informative"]
    lines = {
        "f_n inside its 95 % interval": np.nanmean(column["frequency_inside"]),
        "ζ inside its 95 % interval": np.nanmean(column["damping_inside"]),
        "ζ inside its interval, at the decay's swing": np.nanmean(column["operating_inside"]),
        "l within 3 standard errors, where told": np.mean(np.abs(column["length_std"][told]) <= 3),
        "l inside its 95 % interval": np.nanmean(column["length_inside"]),
        "l within 1 %, where determined": np.mean(np.abs(column["length_share"][sure]) <= 0.01),
        "determined, where informative": np.mean(sure[informative]),
        "determined, where informative and moved": np.mean(sure[informative & column["moved"]]),
        "of all: determined with k wrong by > 25 %": np.mean(sure & ~(column["stiffness_share"] <= 0.25)),
    }
    for text, share in lines.items():
        print(f"{text:45} {100 * share:6.1f} %")
    print(
        f"{len(scores)} scenes: l told in {np.count_nonzero(told)}, informative {np.count_nonzero(informative)}, "
        f"determined {np.count_nonzero(sure)}; {np.mean(column['seconds']):.2f} s CPU each"
    )


def main() -> None:
    """Run the scenes."""
    parser = argparse.ArgumentParser(description="What the pendulum's fit may claim.")
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first scene")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.scenes)
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        scores = list(pool.map(judge, seeds, [options.plain] * len(seeds), chunksize=4))
    if options.verbose:
        for s in scores:
            print(
                f"{s.seed:4d} {s.kind:13} f {s.frequency_inside:3.0f} ζ {s.damping_inside:3.0f} "
                f"l {s.length_std:6.2f} σ {100 * s.length_share:6.2f} % k {100 * s.stiffness_share:6.1f} % "
                f"{'claim' if s.determined else '-':5} {'informative' if s.informative else '':11} {s.reason}"
            )
    for kind in KINDS:
        chosen = [s for s in scores if s.kind == kind]
        if chosen:
            print(f"\n{kind}")
            report(chosen)
    print("\nall")
    report(scores)


if __name__ == "__main__":
    main()
