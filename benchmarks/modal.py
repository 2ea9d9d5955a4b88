"""How near the estimators come to the Cramér-Rao bound: RMSE over the bound, for twelve decays.

    python benchmarks/modal.py [--trials 2000] [--spikes PERCENT] [--gaps] [--colour POLE] [--rivals 200]
    python benchmarks/modal.py --alarms 100

200 Hz, 30 mm, noise 0.05 and 0.5 mm, records of 1.5 and 5 s. `--gaps` takes away 20 % of the samples and one piece of
0.3 s, and compares with the bound of what is left. `--colour` draws autoregressive noise of that pole and the same
variance: the bound is white noise's, so only the coverage is to be judged. The other estimators are slower and far from
the bound: they see the first trials only. `--alarms` counts instead how often noise alone is taken for a decay. Runs on
all cores.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfilt
from scipy.stats import t as student_t

from tagsway.errors import NotIdentifiableError
from tagsway.modal import identify_modes
from tagsway.modal.bound import find_bound, to_modal
from tagsway.modal.decay import Terms
from tagsway.modal.least_squares import Samples, extend, fit_decay
from tagsway.modal.peaks import find_peaks, measure_decay_rate, measure_period
from tagsway.modal.pencil import find_pole
from tagsway.modal.spectrum import find_peaks_of, find_spectrum, find_spectrum_peak, measure_half_power
from tagsway.modal.start import find_start
from tagsway.model import FloatArray, TagTrack, Track, Window

RATE_HZ = 200.0
AMPLITUDE_MM = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One decay and its record."""

    frequency_hz: float
    damping: float
    duration_s: float
    noise_mm: float


CASES = [
    Case(frequency_hz=f, damping=z, duration_s=duration, noise_mm=noise)
    for f, z in ((2.47, 3.5e-4), (3.59, 0.0012), (2.5, 0.02))
    for duration in (1.5, 5.0)
    for noise in (0.05, 0.5)
]


def make_decay(
    case: Case, rng: np.random.Generator, *, spikes: float = 0.0, gaps: bool = False, colour: float = 0.0
) -> tuple[Samples, float]:
    """Return one noisy record of a case, and its phase."""
    time = np.arange(int(case.duration_s * RATE_HZ)) / RATE_HZ
    white = rng.standard_normal(len(time) + 300)
    noise = lfilter([np.sqrt(1 - colour**2)], [1, -colour], white)[300:]
    if gaps:
        middle = 0.5 * case.duration_s
        seen = (rng.random(len(time)) > 0.2) & ~((time > middle) & (time < middle + 0.3))
        time, noise = time[seen], noise[seen]
    phase = float(rng.uniform(0, 2 * np.pi))
    omega = 2 * np.pi * case.frequency_hz
    value = AMPLITUDE_MM * np.exp(-case.damping * omega * time)
    value = value * np.cos(omega * np.sqrt(1 - case.damping**2) * time + phase) + 5.0
    value = value + case.noise_mm * noise
    hit = rng.random(len(time)) < spikes
    value[hit] += rng.uniform(-40, 40, np.count_nonzero(hit))
    return Samples(time_s=time, value=value, spread=np.ones(len(time))), phase


def estimate(samples: Samples, *, even: bool, rivals: bool = True) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return (f_n, ζ) and the half widths of their 95 % intervals, by each estimator."""
    start = find_start(samples)
    assert start is not None
    fit = extend(samples, fit_decay(samples, start[0], Terms(), scale=start[1]))
    value, jacobian = to_modal(fit.parameters)
    half = student_t.ppf(0.975, fit.error_freedom) * np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))
    if not rivals:
        return {"least squares": (value, half)}
    unknown = np.full(2, np.nan)
    up = 1 / np.sqrt(1 - value[1] ** 2)
    top = find_peaks_of(find_spectrum(samples.time_s, samples.value), lowest_hz=1.0, count=1)[0]
    peak = find_spectrum_peak(samples.time_s, samples.value, near_hz=top)
    peaks = find_peaks(samples.time_s, samples.value, 1 / value[0])
    period, rate = measure_period(peaks), measure_decay_rate(peaks, noise=fit.scale)
    logarithmic = unknown.copy()
    if period is not None and rate is not None:
        decrement = rate.value * period.value
        logarithmic[1] = decrement / np.hypot(2 * np.pi, decrement)
        logarithmic[0] = 1 / period.value / np.sqrt(1 - logarithmic[1] ** 2)
    found = {
        "least squares": (value, half),
        "FFT": (np.array([up * peak.frequency_hz, np.nan]), unknown),
        "log decrement": (logarithmic, unknown),
    }
    width = measure_half_power(samples.time_s, samples.value, near_hz=value[0])
    if width is not None:
        found["half power"] = np.array(width[:2]), unknown
    pole = find_pole(samples.value, 1 / RATE_HZ) if even else None
    if pole is not None:
        found["matrix pencil"] = np.array([abs(pole) / (2 * np.pi), -pole.real / abs(pole)]), unknown
    return found


def run_case(number: int, options: argparse.Namespace) -> list[str]:
    """Return the rows of one case."""
    case, rng = CASES[number], np.random.default_rng(number)
    ratios: dict[str, list[FloatArray]] = {}
    covered = []
    for trial in range(options.trials):
        samples, phase = make_decay(case, rng, spikes=options.spikes / 100, gaps=options.gaps, colour=options.colour)
        bound = find_bound(
            samples.time_s,
            natural_frequency_hz=case.frequency_hz,
            damping_ratio=case.damping,
            amplitude=AMPLITUDE_MM,
            noise=case.noise_mm,
            phase_rad=phase,
        )
        unit = np.array([bound.natural_frequency_hz, bound.damping_ratio])
        truth = np.array([case.frequency_hz, case.damping])
        found = estimate(samples, even=not options.gaps, rivals=trial < options.rivals)
        for name, (value, half) in found.items():
            ratios.setdefault(name, []).append((value - truth) / unit)
            if name == "least squares":
                covered.append(np.abs(value - truth) < half)
    rows = []
    for name, errors in ratios.items():
        rms = [
            float(np.sqrt(np.mean(c[np.isfinite(c)] ** 2))) if np.any(np.isfinite(c)) else np.nan
            for c in np.array(errors).T
        ]
        tail = "{:10.3f} {:.3f}".format(*np.mean(covered, axis=0)) if name == "least squares" else ""
        rows.append(
            f"{case.frequency_hz:8.2f} {case.damping:7.2g} {case.duration_s:3g} {case.noise_mm:6g}  {name:15s}"
            f"{rms[0]:12.3f} {rms[1]:15.3f}      {tail}"
        )
    return rows


WANDERING = ("white", "walk", "pole 0.9", "pole 0.99", "below 1 Hz", "below 3 Hz", "below 1 Hz + white")


def make_noise(kind: str, n: int, rng: np.random.Generator) -> FloatArray:
    """Return n samples of noise of a kind."""
    white = rng.standard_normal(n + 2000)
    if kind == "walk":
        return np.cumsum(white[2000:])
    if kind.startswith("pole"):
        return np.asarray(lfilter([1.0], [1.0, -float(kind.split()[1])], white)[2000:])
    if kind.startswith("below"):
        slow = sosfilt(butter(2, float(kind.split()[1]), fs=RATE_HZ, output="sos"), white)[2000:]
        return np.asarray(slow / np.std(slow) + 0.1 * ("white" in kind) * rng.standard_normal(n))
    return white[2000:]


def count_alarms(kind: str, trials: int) -> str:
    """Return how many records of noise alone are taken for a decay."""
    taken = []
    for n in (300, 1000):
        rng, time, nothing = np.random.default_rng(n), np.arange(n) / RATE_HZ, np.full(n, np.nan)
        count = 0
        for _ in range(trials):
            position = np.column_stack([make_noise(kind, n, rng), nothing])
            tag = TagTrack(
                position=position,
                position_std=np.full((n, 2), np.nan),
                angle_rad=nothing,
                angle_std_rad=nothing,
            )
            track = Track(frame=np.arange(n), time_s=time, length_unit="m", pcp=tag)
            try:
                identify_modes(track, Window(start_s=0.0, end_s=float(time[-1])))
            except NotIdentifiableError:
                continue
            count += 1
        taken.append(f"{count:4d}/{trials} of {n} samples")
    return f"{kind:20s} " + "   ".join(taken)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--rivals", type=int, default=200, help="trials that the other estimators see")
    parser.add_argument("--spikes", type=float, default=0.0, help="percent of the samples")
    parser.add_argument("--gaps", action="store_true")
    parser.add_argument("--colour", type=float, default=0.0, help="pole of autoregressive noise, 0 to 0.95")
    parser.add_argument("--alarms", type=int, default=0, help="records of noise alone, of each kind and length")
    options = parser.parse_args()
    if options.alarms:
        print("noise alone taken for a decay:")
        with ProcessPoolExecutor() as pool:
            for row in pool.map(count_alarms, WANDERING, [options.alarms] * len(WANDERING)):
                print(row, flush=True)
        return
    print("  f_n Hz       ζ   s  noise  estimator         f: RMSE/bound   ζ: RMSE/bound   covered by 95 %: f, ζ")
    with ProcessPoolExecutor() as pool:
        for rows in pool.map(run_case, range(len(CASES)), [options] * len(CASES)):
            print("\n".join(rows), flush=True)


if __name__ == "__main__":
    main()
