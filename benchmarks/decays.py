"""Whether f_n and ζ lie inside their 95 % intervals: random payloads, from their track to the mode.

    python benchmarks/decays.py [--decays 200] [--workers 2] [--verbose]

The payloads are simulated here, by nothing that the package has: unit vectors in three dimensions and their second
derivatives, DOP853, the acceleration of the pivot in steps or a release by hand. All have a spring, viscous damping and
drag; a third dry friction. A half hold what the fit does not model, too: a second body, a sway out of the plane, a tag
that slips on the product, noise with a memory. The camera errs by the stated priors: scale 0.3 %, one tag against the
other 0.5 %, stretch along z 0.2 %, 0.5° of tilt. The truth is the small swing's mode, by its linear equations.
"""

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eig
from scipy.signal import lfilter

from tagsway.errors import NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.modal import find_window, identify_modes
from tagsway.model import Estimate, FloatArray, TagTrack, Track

GRAVITY = 9.81
UP = np.array([0.0, 0.0, 1.0])
KINDS = ("plain", "second body", "out of plane", "slip", "coloured")


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What hangs, per mass of the first body: a point at its length, and perhaps a second one at a hinge."""

    length: float
    radius: float
    spring: float
    damping: float
    drag: float
    friction: float
    release: float
    sideways: float
    second: tuple[float, float, float, float] | None
    """Mass, place of the hinge, length and damping rate of the second body."""


def draw(seed: int) -> tuple[str, Payload, FloatArray, float]:
    """Return a kind, a payload, the edges and values of the pivot's acceleration (n, 2), and the record's end."""
    rng = np.random.default_rng(seed)
    kind = "plain" if rng.random() < 0.5 else str(rng.choice(KINDS[1:]))
    length = math.exp(rng.uniform(math.log(0.022), math.log(0.15)))
    omega = math.sqrt(GRAVITY / length / (1 - rng.uniform(0, 0.5)))
    released = rng.random() < 0.25
    payload = Payload(
        length=length,
        radius=length * (1.0 if rng.random() < 0.5 else rng.uniform(0.6, 1.05)),
        spring=omega**2 - GRAVITY / length,
        damping=2 * omega * math.exp(rng.uniform(math.log(1e-3), math.log(0.05))),
        drag=rng.uniform(0, 0.08),
        friction=rng.uniform(0, 0.003) * omega**2 if rng.random() < 1 / 3 else 0.0,
        release=rng.uniform(0.1, 0.9) if released else 0.0,
        sideways=rng.uniform(0.03, 0.1) if kind == "out of plane" else 0.0,
        second=(rng.uniform(0.01, 0.05), 0.7 * length, rng.uniform(0.2, 0.6) * length, rng.uniform(0.5, 3.0))
        if kind == "second body"
        else None,
    )
    push, half = rng.uniform(0.05, 0.4) * length * omega**2, rng.uniform(0.1, 0.4)
    steps = np.array([[0.0, 0.0], [0.25, 0.0 if released else push], [0.25 + half, 0.0 if released else -push]])
    steps = np.vstack([steps, [0.25 + 2 * half, 0.0]])
    return kind, payload, steps, float(steps[-1, 0] + rng.uniform(1.5, 5.0))


def accelerate(p: Payload, place: FloatArray, rate: FloatArray, pull: FloatArray) -> FloatArray:
    """Return the second derivatives of the unit vectors of the bodies, shape (bodies, 3), under g and the pivot."""
    bodies = len(place)
    mass, hinge, short, lost = p.second or (0.0, 0.0, 0.0, 0.0)
    square = np.array([p.length**2 + mass * hinge**2, mass * short**2])[:bodies]
    first = np.array([p.length + mass * hinge, mass * short])[:bodies]
    rise = UP - place[0] * place[0, 2]
    lean = math.atan2(math.hypot(place[0, 0], place[0, 1]), -place[0, 2])
    speed = float(np.linalg.norm(rate[0]))
    brake = p.damping + p.drag * speed + p.friction * math.tanh(speed / 1e-3) / max(speed, 1e-12)
    force = -first[:, None] * pull
    force[0] -= p.length**2 * (brake * rate[0] + p.spring * lean * rise / max(float(np.linalg.norm(rise)), 1e-12))
    if bodies == 2:
        force -= mass * short**2 * lost * np.array([[-1.0], [1.0]]) * (rate[1] - rate[0])
    cross = mass * hinge * short
    weights = np.array([[square[0], cross], [cross, square[-1]]])[:bodies, :bodies]
    inward = -np.sum(rate**2, axis=1)[:, None] * place
    force -= weights @ inward
    # Only what lies across each body moves it: two axes there, by what is left of any third one.
    axes = [np.linalg.svd(one[None])[2][1:] for one in place]
    matrix = np.block([[weights[i, j] * axes[i] @ axes[j].T for j in range(bodies)] for i in range(bodies)])
    answer = np.linalg.solve(matrix, np.concatenate([axes[i] @ force[i] for i in range(bodies)])).reshape(bodies, 2)
    return inward + np.stack([answer[i] @ axes[i] for i in range(bodies)])


def simulate(p: Payload, steps: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the pivot's x, and the direction of the first body, shape (n, 3); nothing moves until the start."""
    bodies = 1 if p.second is None else 2
    begin = np.array([math.sin(p.release), math.sin(p.sideways), 0.0])
    begin[2] = -math.sqrt(1 - begin @ begin)
    state = np.concatenate([np.tile(begin, bodies), np.zeros(3 * bodies)])
    direction, x, at, speed = np.tile(begin, (len(time), 1)), np.zeros(len(time)), 0.0, 0.0
    for (low, push), high in zip(steps[1:], [*steps[2:, 0], time[-1] + 1e-6], strict=True):
        pull = GRAVITY * UP + [push, 0.0, 0.0]

        def slope(_: float, now: FloatArray, pull: FloatArray = pull) -> FloatArray:
            place, rate = now.reshape(2, bodies, 3)
            return np.concatenate([rate.ravel(), accelerate(p, place, rate, pull).ravel()])

        inside = (time >= low) & (time < high)
        times = np.union1d([low, high], time[inside])
        path = solve_ivp(slope, (low, high), state, method="DOP853", t_eval=times, rtol=1e-10, atol=1e-12).y
        direction[inside] = path[:3, np.searchsorted(times, time[inside])].T
        since = time[inside] - low
        x[inside] = at + speed * since + push * since**2 / 2
        at, speed, state = (
            at + speed * (high - low) + push * (high - low) ** 2 / 2,
            speed + push * (high - low),
            path[:, -1],
        )
    return x, direction


def find_mode(p: Payload) -> tuple[float, float]:
    """Return f_n and ζ of the mode in which the first body swings most."""
    mass, hinge, short, lost = p.second or (1e-6, 0.0, p.length / 2, 0.0)
    inertia = np.array([[p.length**2 + mass * hinge**2, mass * hinge * short], [mass * hinge * short, mass * short**2]])
    rub = mass * short**2 * lost
    damper = np.array([[p.length**2 * p.damping + rub, -rub], [-rub, rub]])
    spring = np.diag([GRAVITY * (p.length + mass * hinge) + p.length**2 * p.spring, GRAVITY * mass * short])
    nothing, one = np.zeros((2, 2)), np.eye(2)
    poles, shapes = eig(np.block([[nothing, one], [-spring, -damper]]), np.block([[one, nothing], [nothing, inertia]]))
    share = (
        inertia[0, 0] * np.abs(shapes[0]) ** 2 / np.einsum("ik,ij,jk->k", shapes[:2].conj(), inertia, shapes[:2]).real
    )
    pole = poles[int(np.argmax(np.where(poles.imag > 0, share, -1.0)))]
    return abs(pole) / (2 * math.pi), -pole.real / abs(pole)


def film(seed: int) -> tuple[str, Payload, Track]:
    """Return a random payload and the track that a camera with its errors makes of it."""
    kind, payload, steps, end = draw(seed)
    rng = np.random.default_rng(10_000 + seed)
    rate = float(rng.choice([60.0, 120.0, 200.0, 240.0]))
    time = np.arange(int(end * rate)) / rate
    x, direction = simulate(payload, steps, time)
    tool = np.column_stack([x, np.zeros(len(x))])
    product = tool + rng.uniform([-5e-3, -0.05], [5e-3, -0.01]) + payload.radius * direction[:, [0, 2]]
    if kind == "slip":
        product[time > steps[1, 0] + rng.uniform(0.1, 0.3)] += rng.uniform(1e-4, 5e-4) * np.array([0.6, -0.8])
    noise = math.exp(rng.uniform(math.log(1e-5), math.log(1e-4)))
    memory = rng.uniform(0.3, 0.8) if kind == "coloured" else 0.0
    scale, relative, stretch, tilt = rng.standard_normal(4) * [0.003, 0.005, 0.002, math.radians(0.5)]
    turn = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])

    def see(point: FloatArray, angle: FloatArray, own: float) -> TagTrack:
        white = rng.standard_normal((len(time), 2))
        spread = noise * lfilter([math.sqrt(1 - memory**2)], [1, -memory], white, axis=0)
        return TagTrack(
            position=(1 + scale + own) * (point @ turn) * [1.0, 1 + stretch] + spread,
            position_std=np.full((len(time), 2), noise),
            angle_rad=angle + tilt + 2e-3 * rng.standard_normal(len(time)),
            angle_std_rad=np.full(len(time), 2e-3),
        )

    angle = np.arctan2(direction[:, 0], -direction[:, 2])
    tcp, pcp = see(tool, np.zeros(len(time)), -relative / 2), see(product, angle, relative / 2)
    return kind, payload, Track(frame=np.arange(len(time)), time_s=time, length_unit="m", tcp=tcp, pcp=pcp)


def judge(seed: int) -> tuple[str, FloatArray, str]:
    """Return a kind, (errors over 1σ, inside the interval, 1σ) of f_n in parts and of ζ, shape (3, 2), and a line."""
    kind, payload, track = film(seed)
    truth = find_mode(payload)
    try:
        found = identify_modes(track, find_window(track, clean_track(track)))
    except NotIdentifiableError as reason:
        return kind, np.full((3, 2), np.nan), f"{seed:4d} {kind:13} {reason}"
    modal = found.estimate
    columns = [_score(modal.natural_frequency_hz, truth[0]), _score(modal.damping_ratio, truth[1])]
    scores = np.array(columns).T
    scores[2, 0] /= truth[0]
    line = (
        f"{seed:4d} {kind:13} f {scores[0, 0]:6.2f} of {100 * scores[2, 0]:.4f} %   ζ {scores[0, 1]:6.2f} of "
        f"{scores[2, 1]:.1e} ({truth[1]:.4f})   {modal.cycles:4.1f} cycles {payload.drag:.3f} {payload.friction:.3f}  "
        + " ".join(notice.code for notice in found.notices)
    )
    return kind, scores, line


def _score(estimate: Estimate | None, truth: float) -> tuple[float, float, float]:
    if estimate is None:
        return (math.nan,) * 3
    inside = estimate.ci95[0] <= truth <= estimate.ci95[1]
    return (estimate.value - truth) / estimate.std, float(inside), estimate.std


def main() -> None:
    """Print the shares inside."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--decays", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--verbose", action="store_true", help="a line a decay")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        done = list(pool.map(judge, range(options.first, options.first + options.decays), chunksize=4))
    if options.verbose:
        print("\n".join(line for *_, line in done))
    print("                  decays   refused   f_n inside   ζ inside    median σ of f_n, ζ")
    for kind in (*KINDS, "all"):
        scores = np.array([one for name, one, _ in done if kind in (name, "all")]).reshape(-1, 3, 2)
        if len(scores):
            inside, usual = np.nanmean(scores[:, 1], axis=0), np.nanmedian(scores[:, 2], axis=0)
            refused = np.count_nonzero(np.isnan(scores[:, 1, 0]))
            print(
                f"{kind:15} {len(scores):8d} {refused:9d} {100 * inside[0]:10.1f} % {100 * inside[1]:8.1f} % "
                f"{100 * usual[0]:12.4f} % {usual[1]:.1e}"
            )


if __name__ == "__main__":
    main()
