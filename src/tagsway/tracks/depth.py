"""Sway out of the plane and yaw: what the tag's looks tell of them, and what they do to the numbers."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from tagsway.model import FloatArray, Notice, TagSightings
from tagsway.tracks.attitude import measure_attitude

LIMIT, LEAST_YAW_RAD = 0.1, math.radians(1.5)
"""Out-of-plane over in-plane sway, and yaw, above which they are reported."""

SURE = 6.0
"""Standard errors by which an oscillation must stand out: some hundreds of frequencies are tried."""

HINTED = 3.0
"""The same where the tag nods along, as that of a product that sways towards the camera does."""

EDGE_PX = 0.005
"""By which a codec pulls the sides of a tag that moves: 0.015 px were seen at a swing of 1.4 px in VP9."""

LEAST_SAMPLES = 50
"""Below this many frames a search of frequencies fits any noise."""

MOST_CYCLES, MOST_SAMPLES = 40, 2000
"""Swings that are looked at, in so many means of neighbouring frames at most: memory and time are bounded."""

DECAYS = (0.0, 1.0, 3.0, 8.0)
"""Decay rates that are tried, over the record's length."""

SWAY_BAND, YAW_BAND = (0.7, 1.4), (0.3, 3.0)
"""Where the out-of-plane sway and the yaw are sought, over the in-plane sway's frequency."""

STILL_SHARE = 0.003
"""A tool within this share of its whole way from where it ends has arrived."""

LEAST_NOISE = 0.03
"""Of a series' own size: no oscillation is as pure as its pixels, and a misfit must not be left to the place."""

LEAST_SWAY = 5.0
"""In-plane sway over its standard error below which there is no sway to compare with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """A damped oscillation, A e^(-αt) cos(2πft + φ), in a series.

    Parameters
    ----------
    frequency_hz, frequency_std_hz : float
        f and its standard error.
    amplitude, amplitude_std : float
        A in the record's middle, where a doubtful decay rate matters least.
    """

    frequency_hz: float
    frequency_std_hz: float
    amplitude: float
    amplitude_std: float

    @property
    def sure(self) -> bool:
        """Whether no noise made it."""
        return self.amplitude > SURE * self.amplitude_std


@dataclass(frozen=True, slots=True, kw_only=True)
class OutOfPlane:
    """What of the product's motion the picture's plane does not show.

    Parameters
    ----------
    duration_s, middle_s : float
        Of the free sway that was looked at, and the time of its middle.
    sway : Oscillation
        In the plane, in the product's pixels.
    depth : Oscillation
        Towards the camera and away, in the product's pixels.
    yaw, pitch : Oscillation
        Of the product's tag, in rad.
    """

    duration_s: float
    middle_s: float
    sway: Oscillation
    depth: Oscillation
    yaw: Oscillation
    pitch: Oscillation

    @property
    def ratio(self) -> float:
        """Out-of-plane over in-plane amplitude."""
        return self.depth.amplitude / self.sway.amplitude


def find_depth_sway(
    time_s: FloatArray,
    sway_px: FloatArray,
    pcp: TagSightings,
    tcp: TagSightings | None,
    *,
    focal_px: float,
    principal_px: FloatArray,
    known: bool,
    mm_per_px: float | None = None,
) -> Notice | None:
    """Report a sway towards the camera and away that exceeds a tenth of the one in the plane, and a yaw beyond 1.5°.

    Parameters
    ----------
    time_s, sway_px, pcp, tcp, focal_px, principal_px
        As for `measure_out_of_plane`.
    known : bool
        Whether the focal length comes from a calibration.
    mm_per_px : float, optional
        The product's scale, for a length in mm.

    Returns
    -------
    Notice or None
        None where there is none, or none that the noise could not have made.
    """
    found = measure_out_of_plane(time_s, sway_px, pcp, tcp, focal_px=focal_px, principal_px=principal_px)
    if found is None:
        return None
    surely = found.depth.sure or _nods_along(found)
    sways = surely and found.depth.amplitude - 2 * found.depth.amplitude_std > LIMIT * found.sway.amplitude
    yaws = found.yaw.sure and found.yaw.amplitude > LEAST_YAW_RAD
    if not (sways or yaws):
        return None
    assumed = "" if known else f" (for a focal length of about {focal_px:.0f} px, assumed)"
    words = [_words_of_sway(found, mm_per_px, assumed)] if sways else []
    if yaws:
        yaw, std = math.degrees(found.yaw.amplitude), math.degrees(found.yaw.amplitude_std)
        words.append(
            f"the product yaws by {yaw:.1f} ± {std:.1f} degrees at {found.yaw.frequency_hz:.2f} Hz{assumed}: "
            f"its tag sways in the picture by {100 * math.sin(found.yaw.amplitude):.0f} % of how far it is off the "
            "axis of that turn, which may pass for a second mode"
        )
    return Notice(code="out_of_plane", message="; ".join(words))


def _nods_along(found: OutOfPlane) -> bool:
    """Whether the tag surely nods at the frequency at which its distance seems to change."""
    depth, nod = found.depth, found.pitch
    apart = abs(depth.frequency_hz - nod.frequency_hz)
    return (
        depth.amplitude > HINTED * depth.amplitude_std
        and nod.sure
        and nod.amplitude > LEAST_YAW_RAD
        and apart < HINTED * math.hypot(depth.frequency_std_hz, nod.frequency_std_hz)
    )


def _words_of_sway(found: OutOfPlane, mm_per_px: float | None, assumed: str) -> str:
    depth, ratio = found.depth, found.ratio
    size = (
        ""
        if mm_per_px is None
        else f", {mm_per_px * depth.amplitude:.1f} ± {mm_per_px * depth.amplitude_std:.1f} mm midway"
    )
    beat = abs(depth.frequency_hz - found.sway.frequency_hz)
    beats = f", a beat of {1 / beat:.0f} s" if beat > 2 * depth.frequency_std_hz else ""
    # If all of that energy came out of the plane, or went into it, during the record.
    damping = math.log1p(ratio**2) / 2 / (2 * math.pi * found.sway.frequency_hz * found.duration_s)
    pendulum_px = None if mm_per_px is None else 9810 / (2 * math.pi * found.sway.frequency_hz) ** 2 / mm_per_px
    slower = "" if pendulum_px is None else f", f_n by up to {100 * (depth.amplitude / pendulum_px) ** 2 / 16:.2g} %"
    return (
        f"the product sways towards the camera and away, by {100 * ratio:.0f} % of its sway in the picture{size}, at "
        f"{depth.frequency_hz:.2f} ± {depth.frequency_std_hz:.2f} Hz{beats}{assumed}: the measured swing is a "
        f"projection, which may change the damping ratio by up to {damping:.1g}{slower}, and r of the circle by up to "
        f"{100 * ratio**2:.1g} %; set the camera square to the motion, or release the product without a sideways push"
    )


def measure_out_of_plane(
    time_s: FloatArray,
    sway_px: FloatArray,
    pcp: TagSightings,
    tcp: TagSightings | None,
    *,
    focal_px: float,
    principal_px: FloatArray,
) -> OutOfPlane | None:
    """Measure the sway out of the plane, and the yaw and pitch, of the free sway after the tool's last move.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the frames.
    sway_px : ndarray, shape (n, 2)
        PCP minus TCP in the PCP's plane, in its pixels.
    pcp, tcp : TagSightings
        Their images; the tool's tells what the camera's tilt and lens do.
    focal_px : float
        Focal length in pixels.
    principal_px : ndarray, shape (2,)
        Where the optical axis meets the image.

    Returns
    -------
    OutOfPlane or None
        None where there is no sway in the plane to compare with.

    Notes
    -----
    Each series is fitted by one damped oscillation beside a parabola in time and the place's functions, whose freedom
    is what the tool's tag left of it: a swing in a plane that is turned away from the picture, and a lens, look alike
    without it. The residual's power around the frequency, where larger than white, is the noise of the errors.
    """
    attitude = measure_attitude(pcp, tcp, focal_px=focal_px, principal_px=principal_px)
    if attitude is None:
        return None
    seen = np.isfinite(attitude.depth_px) & np.isfinite(sway_px).all(axis=1)
    seen &= np.arange(len(seen)) >= _end_of_move(tcp)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return None
    series = np.column_stack([sway_px, attitude.depth_px, attitude.yaw_rad, attitude.pitch_rad, attitude.place])
    time, values = time_s[seen], series[seen]
    cycles = _cycles(time, values[:, :2]) if np.any(np.ptp(values[:, :2], axis=0) > 0) else None
    if cycles is None:
        return None
    start, keep = time[0], MOST_CYCLES / (cycles / (time[-1] - time[0]))
    time, values = _average(*_part(time, values, start + keep))
    cycles = _cycles(time, values[:, :2])
    if cycles is None or len(time) < LEAST_SAMPLES:
        return None
    rate = cycles / (time[-1] - time[0])
    axis = int(np.argmax(np.var(values[:, :2], axis=0)))
    sway = _fit(time, values[:, axis], rate, SWAY_BAND)
    if not sway.amplitude > LEAST_SWAY * sway.amplitude_std:
        return None
    place, freedom = values[:, 5:], attitude.place_covariance
    yaw, pitch = (_fit(time, values[:, 2 + i], sway.frequency_hz, YAW_BAND, place, freedom[i]) for i in (1, 2))
    # The second harmonic is what a nod makes of the tag's size.
    depth = _fit(time, values[:, 2], sway.frequency_hz, SWAY_BAND, place, freedom[0], harmonics=2)
    pulled = EDGE_PX / _side_px(pcp) * focal_px
    return OutOfPlane(
        duration_s=float(time[-1] - time[0]),
        middle_s=float((time[0] + time[-1]) / 2),
        sway=sway,
        depth=replace(depth, amplitude_std=math.hypot(depth.amplitude_std, pulled)),
        yaw=yaw,
        pitch=pitch,
    )


def _side_px(tag: TagSightings) -> float:
    """Return how long a side of the tag's image is in the middle of all frames."""
    sides = np.hypot(*np.moveaxis(np.diff(tag.corners_px, axis=1), -1, 0))
    return max(float(np.nanmedian(sides)), 1.0)


def _end_of_move(tcp: TagSightings | None) -> int:
    """Return the frame in which the tool arrived where it stays; 0 where it never moves, or never rests."""
    if tcp is None:
        return 0
    seen = np.flatnonzero(np.isfinite(tcp.centre_px).all(axis=1))
    if len(seen) < LEAST_SAMPLES:
        return 0
    centre = tcp.centre_px[seen]
    away = np.hypot(*(centre - np.median(centre[-max(len(seen) // 10, 5) :], axis=0)).T)
    moving = np.flatnonzero(away > max(STILL_SHARE * float(np.max(away)), 1.0))
    if not len(moving) or len(seen) - moving[-1] < LEAST_SAMPLES:
        return 0
    return int(seen[moving[-1]])


def _part(time: FloatArray, values: FloatArray, end_s: float) -> tuple[FloatArray, FloatArray]:
    return time[time <= end_s], values[time <= end_s]


def _average(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means of so many neighbouring frames that few enough are left."""
    size = -(-len(time) // MOST_SAMPLES)
    count = len(time) // size
    return time[: count * size].reshape(count, size).mean(axis=1), values[: count * size].reshape(
        count, size, values.shape[1]
    ).mean(axis=1)


def _cycles(time: FloatArray, sway: FloatArray) -> float | None:
    """Return how often the sway swings in the record; None for a record too short to tell."""
    grid = np.linspace(time[0], time[-1], min(len(time), 4096))
    even = np.column_stack([np.interp(grid, time, column) for column in sway.T])
    drift = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(grid)), 3)
    left = even - drift @ np.linalg.lstsq(drift, even, rcond=None)[0]
    power = np.sum(np.abs(np.fft.rfft(left * np.hanning(len(grid))[:, None], 4 * len(grid), axis=0)) ** 2, axis=1)
    best = int(np.argmax(power[12 : len(grid)])) + 12 if len(grid) > 12 else 0
    return best / 4 if best >= 12 else None


def _fit(
    time: FloatArray,
    values: FloatArray,
    centre_hz: float,
    band: tuple[float, float],
    place: FloatArray | None = None,
    place_covariance: FloatArray | None = None,
    *,
    harmonics: int = 1,
) -> Oscillation:
    """Return the damped oscillation that explains most, beside what the place explains within its freedom."""
    span = float(time[-1] - time[0])
    since = time - (time[0] + time[-1]) / 2
    scale = max(float(np.std(values)), 1e-12)
    base, target = np.polynomial.legendre.legvander(2 * since / span, 2), values / scale
    rows = 0
    if place is not None and place_covariance is not None:
        # Columns that the freedom allows to be of size one, held by a row of their own each.
        size, turn = np.linalg.eigh(place_covariance)
        free = (place - place.mean(axis=0)) @ turn * np.sqrt(np.maximum(size, 0.0))
        noise = max(float(np.std(np.diff(values, 3))) / math.sqrt(20), LEAST_NOISE * scale)
        rows = free.shape[1]
        base = np.block([[base, free / scale], [np.zeros((rows, 3)), noise / scale * np.eye(rows)]])
        target = np.concatenate([target, np.zeros(rows)])
    within = np.linalg.qr(base)[0]
    left = target - within @ (within.T @ target)

    def waves(frequency: FloatArray, decay: FloatArray) -> FloatArray:
        order = np.arange(1, harmonics + 1)
        exponent = np.multiply.outer(since, 2j * np.pi * frequency - decay)[..., None] * order
        both = np.exp(exponent)
        both = np.concatenate([both.real, both.imag], axis=-1)
        both = np.concatenate([both, np.zeros((rows, *both.shape[1:]))])
        return np.asarray(both - np.tensordot(within, np.tensordot(within.T, both, 1), 1))

    def solve(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        pair = waves(np.array([p[0]]), np.array([p[1]]))[:, 0]
        amplitude = np.linalg.lstsq(pair, left, rcond=None)[0]
        return np.asarray(amplitude, dtype=float), left - pair @ amplitude

    def miss(p: FloatArray) -> FloatArray:
        return solve(p)[1]

    count = int(np.clip(6 * span * centre_hz * (band[1] - band[0]), 12, 400))
    frequencies = centre_hz * np.linspace(*band, count)
    best, start = -1.0, np.array([centre_hz, 0.0])
    for decay in DECAYS:
        for part in np.array_split(frequencies, max(1, count // 25)):
            pair = waves(part, np.full(len(part), decay / span))
            gram, product = np.einsum("nfi,nfj->fij", pair, pair), np.einsum("nfi,n->fi", pair, left)
            gain = np.einsum(
                "fi,fi->f", product, np.linalg.solve(gram + 1e-9 * np.eye(2 * harmonics), product[..., None])[..., 0]
            )
            if float(np.max(gain)) > best:
                best, start = float(np.max(gain)), np.array([part[int(np.argmax(gain))], decay / span])
    limits = ([centre_hz * band[0] * 0.99, -1 / span], [centre_hz * band[1] * 1.01, 20 / span])
    polished = least_squares(miss, start, bounds=limits, x_scale=[0.1 / span, 1 / span], max_nfev=30)
    amplitude, rest = solve(polished.x)
    return _oscillation(polished.x, amplitude * scale, rest[: len(time)] * scale, time, waves)


def _oscillation(
    p: FloatArray,
    pair: FloatArray,
    rest: FloatArray,
    time: FloatArray,
    waves: Callable[[FloatArray, FloatArray], FloatArray],
) -> Oscillation:
    """Return the fitted oscillation with its errors."""
    step = np.array([1e-4 / float(time[-1] - time[0]), 1e-3 / float(time[-1] - time[0])])
    around = (p, p + step * [1, 0], p + step * [0, 1])
    own, sharper, shorter = (waves(np.array([a[0]]), np.array([a[1]]))[:, 0] for a in around)
    design = np.column_stack([own, (sharper - own) @ pair / step[0], (shorter - own) @ pair / step[1]])
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    inverse = np.linalg.pinv((design / size).T @ (design / size), hermitian=True) / np.outer(size, size)
    # The cosines of all harmonics come first, then their sines.
    first = np.zeros(design.shape[1])
    first[[0, len(pair) // 2]] = pair[[0, len(pair) // 2]]
    amplitude = float(np.linalg.norm(first))
    toward = first / max(amplitude, 1e-300)
    variance = _noise_around(rest, time, float(p[0]))
    return Oscillation(
        frequency_hz=float(p[0]),
        frequency_std_hz=math.sqrt(max(variance * float(inverse[-2, -2]), 0.0)),
        amplitude=amplitude,
        amplitude_std=math.sqrt(max(variance * float(toward @ inverse @ toward), 0.0)),
    )


def _noise_around(rest: FloatArray, time: FloatArray, frequency_hz: float) -> float:
    """Return the residual's variance as if it were white: the larger of its own and that around a frequency."""
    span = float(time[-1] - time[0])
    # Not down to half and up to twice the frequency: what foreshortening makes of a nod is there.
    first, last = max(int(0.65 * frequency_hz * span), 1), int(1.5 * frequency_hz * span) + 2
    cycles = np.arange(first, min(last, len(time) // 2))
    if not len(cycles):
        return float(np.mean(rest**2))
    wave = np.exp(-2j * np.pi * np.outer(cycles, (time - time[0]) / span)) @ rest
    return max(float(np.mean(rest**2)), float(np.mean(np.abs(wave) ** 2)) / len(time))
