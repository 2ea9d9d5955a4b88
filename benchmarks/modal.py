"""How near the estimators come to the Cramér-Rao bound: RMSE over the bound, for twelve decays.

    python benchmarks/modal.py [--trials 300] [--spikes PERCENT] [--gaps]

200 Hz, 30 mm, noise 0.05 and 0.5 mm, records of 1.5 and 5 s. `--gaps` takes away 20 % of the samples and one piece of
0.3 s, and compares with the bound of what is left.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from tagsway.modal.bound import find_bound, to_modal
from tagsway.modal.decay import Terms
from tagsway.modal.least_squares import Samples, extend, fit_decay
from tagsway.modal.peaks import find_peaks, measure_decay_rate, measure_period
from tagsway.modal.pencil import find_pole
from tagsway.modal.spectrum import find_peaks_of, find_spectrum, find_spectrum_peak
from tagsway.modal.start import find_start
from tagsway.model import FloatArray

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
    case: Case, rng: np.random.Generator, *, spikes: float = 0.0, gaps: bool = False
) -> tuple[Samples, float]:
    """Return one noisy record of a case, and its phase."""
    time = np.arange(int(case.duration_s * RATE_HZ)) / RATE_HZ
    if gaps:
        middle = 0.5 * case.duration_s
        time = time[(rng.random(len(time)) > 0.2) & ~((time > middle) & (time < middle + 0.3))]
    phase = float(rng.uniform(0, 2 * np.pi))
    omega = 2 * np.pi * case.frequency_hz
    value = AMPLITUDE_MM * np.exp(-case.damping * omega * time)
    value = value * np.cos(omega * np.sqrt(1 - case.damping**2) * time + phase) + 5.0
    value = value + case.noise_mm * rng.standard_normal(len(time))
    hit = rng.random(len(time)) < spikes
    value[hit] += rng.uniform(-40, 40, np.count_nonzero(hit))
    return Samples(time_s=time, value=value, spread=np.ones(len(time))), phase


def estimate(samples: Samples, *, even: bool) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return (f_n, ζ) and the half widths of their 95 % intervals, by each estimator."""
    start = find_start(samples)
    assert start is not None
    fit = extend(samples, fit_decay(samples, start[0], Terms(), scale=start[1]))
    value, jacobian = to_modal(fit.parameters)
    half = student_t.ppf(0.975, fit.freedom) * np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))
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
    pole = find_pole(samples.value, 1 / RATE_HZ) if even else None
    if pole is not None:
        found["matrix pencil"] = np.array([abs(pole) / (2 * np.pi), -pole.real / abs(pole)]), unknown
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--spikes", type=float, default=0.0, help="percent of the samples")
    parser.add_argument("--gaps", action="store_true")
    options = parser.parse_args()
    print("  f_n Hz       ζ   s  noise  estimator         f: RMSE/bound   ζ: RMSE/bound   covered by 95 %: f, ζ")
    for number, case in enumerate(CASES):
        rng = np.random.default_rng(number)
        ratios: dict[str, list[FloatArray]] = {}
        covered = []
        for _ in range(options.trials):
            samples, phase = make_decay(case, rng, spikes=options.spikes / 100, gaps=options.gaps)
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
            for name, (value, half) in estimate(samples, even=not options.gaps).items():
                ratios.setdefault(name, []).append((value - truth) / unit)
                if name == "least squares":
                    covered.append(np.abs(value - truth) < half)
        for name, rows in ratios.items():
            table = np.array(rows)
            rms = [
                float(np.sqrt(np.mean(c[np.isfinite(c)] ** 2))) if np.any(np.isfinite(c)) else np.nan for c in table.T
            ]
            tail = "{:10.3f} {:.3f}".format(*np.mean(covered, axis=0)) if name == "least squares" else ""
            print(
                f"{case.frequency_hz:8.2f} {case.damping:7.2g} {case.duration_s:3g} {case.noise_mm:6g}  {name:15s}"
                f"{rms[0]:12.3f} {rms[1]:15.3f}      {tail}",
                flush=True,
            )


if __name__ == "__main__":
    main()
