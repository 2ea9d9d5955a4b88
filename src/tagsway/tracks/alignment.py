"""A controller's log laid over the video: two clocks, one motion."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import least_squares
from scipy.signal import correlate, find_peaks

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.filters import find_track_spikes, fit_smoothing_spline
from tagsway.model import AlignedLog, BoolArray, ControllerLog, Estimate, FloatArray, LogAgreement, Notice, Track

LEAST_SAMPLES = 30
LEAST_TRAVEL_M = 0.005
"""Below this the tool stands still, and nothing tells when."""

LEAST_CORRELATION = 0.8
"""Of the two speeds at the best offset; another move's is mostly below 0.6."""

GRID_HZ = 1000.0
"""Rate at which the speeds are correlated; the rest is left to least squares."""

CANDIDATES = 5
"""Offsets that are tried."""

RIVAL_PEAK, RIVAL_RMS = 0.8, 1.5
"""Offsets whose correlation reaches this share of the best are tried; an rms within this factor rivals it."""

APART_S = 0.05
"""Offsets nearer to one another are the same."""

LEAST_COVER = 0.5
"""Share of the tag's motion that the log has to hold."""

CLIP = 5.0
"""Median residuals beyond which a sample is a spike that the cleaning left."""

STEP = 1e-6
"""Of the numerical derivatives, in s, 1 and m: far above rounding, far below what bends."""

RATE_TOLERANCE = 1e-3
"""Quartz clocks agree to 1e-4; a larger difference is a wrong frame rate, or a wrong log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """What is compared: the tag where it was seen, and the log in the plane of its motion."""

    time_s: FloatArray
    tag_m: FloatArray
    log_s: FloatArray
    log: BSpline

    def log_at(self, time_s: FloatArray) -> FloatArray:
        """Return the log's path, standing still before its first and after its last line."""
        return np.asarray(self.log(np.clip(time_s, self.log_s[0], self.log_s[-1])), dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """A clock (the log's time at the middle of the video, and its rate), and tag = c + S log by (a, b, c_x, c_z)."""

    clock: FloatArray
    similarity: FloatArray
    mirror: float
    residual_m: FloatArray
    kept: BoolArray

    @property
    def rms_m(self) -> float:
        return float(np.sqrt(np.mean(np.sum(self.residual_m[self.kept] ** 2, axis=1))))


def align_log(track: Track, log: ControllerLog) -> AlignedLog:
    """Return a controller's log at the video's times.

    Parameters
    ----------
    track : Track
        In metres, with the tool's tag; the tool has to move in it.
    log : ControllerLog
        Of the tool (joints: turn them into its position first), moving in a vertical plane that faces the camera.

    Returns
    -------
    AlignedLog

    Raises
    ------
    InputError
        Where the log holds joints, is too short, or is not of this motion.
    NotIdentifiableError
        Where the track has no tool that moves, or no lengths.

    Notes
    -----
    The speeds are cross-correlated for the offset; then tag = c + S log(offset + rate t) is fitted to all samples, with
    S a rotation times a scale: c and S follow by linear least squares, so that only the clock is searched. Spikes are
    dropped at 5 standard deviations. The errors are those of the fit, made larger by the residuals' correlation over
    time: what the arms do beyond the motors is no white noise. A log of the *commanded* position is late or early by
    the drive's lag: the offset then holds that too.
    """
    samples = _prepare(track, log)
    fits = [_fit(samples, start, mirror) for start in _starts(samples) for mirror in (1.0, -1.0)]
    # Of a level move both fit: the camera stands behind the robot rather than on its head.
    fits = sorted((fit for fit in fits if fit.similarity[0] > 0), key=lambda fit: fit.rms_m)
    if not fits:
        raise InputError("the controller's log runs against the filmed motion: its z must point up")
    best = fits[0]
    agreement = _agreement(samples, best)
    notices = []
    rivals = [
        fit for fit in fits[1:] if fit.rms_m < RIVAL_RMS * best.rms_m and abs(fit.clock[0] - best.clock[0]) > APART_S
    ]
    if rivals:
        repeats = "repeats itself" if rivals[0].mirror == best.mirror else "goes to and fro, filmed from either side"
        message = (
            f"the video fits the log almost as well {rivals[0].clock[0] - best.clock[0]:+.2f} s away from where it was "
            f"laid: the move {repeats}; cut the log to the filmed one"
        )
        notices.append(Notice(code="log_offset_ambiguous", message=message))
    rate = agreement.rate
    if abs(rate.value - 1) > max(RATE_TOLERANCE, 3 * rate.std):
        message = (
            f"a second of the video takes {rate.value:.4f} s in the controller's log: the video's frame rate is wrong "
            f"by {100 * (rate.value - 1):+.2f} %, or the log is"
        )
        notices.append(Notice(code="log_rate_differs", message=message))
    return AlignedLog(position=_place(track, samples, best), agreement=agreement, notices=tuple(notices))


def _prepare(track: Track, log: ControllerLog) -> _Samples:
    if log.holds != "tool":
        raise InputError("a log of joints needs the robot's kinematics before it is aligned: give [robot] in --move")
    if track.tcp is None or track.length_unit != "m":
        raise NotIdentifiableError(
            "a log is laid over the tool's tag in mm: the track has none; give --tag-size and show the tag",
            code="log_not_aligned",
        )
    seen = np.all(np.isfinite(track.tcp.position), axis=1) & ~find_track_spikes(track.time_s, track.tcp)
    written = np.all(np.isfinite(log.values), axis=1)
    if np.count_nonzero(seen) < LEAST_SAMPLES or np.count_nonzero(written) < LEAST_SAMPLES:
        raise InputError(
            f"{np.count_nonzero(seen)} frames show the tool and {np.count_nonzero(written)} lines of the log hold it: "
            f"expected at least {LEAST_SAMPLES} of each"
        )
    tag, path = track.tcp.position[seen], log.values[written]
    if not (np.ptp(tag, axis=0).max() > LEAST_TRAVEL_M and np.ptp(path, axis=0).max() > LEAST_TRAVEL_M):
        raise NotIdentifiableError(
            "the tool stands still, so nothing tells which moment of the log the video shows", code="log_not_aligned"
        )
    # The camera sees one vertical plane: that of the log's main horizontal direction.
    level = path[:, :2] - path[:, :2].mean(axis=0)
    direction = np.linalg.svd(level, full_matrices=False)[2][0]
    plane = np.column_stack([level @ direction, path[:, 2]])
    log_s = log.time_s[written]
    return _Samples(time_s=track.time_s[seen], tag_m=tag, log_s=log_s, log=make_interp_spline(log_s, plane, k=3))


def _starts(samples: _Samples) -> list[float]:
    """Return the log's time at the middle of the video where the two speeds agree, best first."""
    tag = _speed_of_tag(samples)
    grid = np.arange(samples.log_s[0], samples.log_s[-1], 1 / GRID_HZ)
    log = np.hypot(*samples.log(grid, nu=1).T)
    # Normalised by what lies under the tag's record: a log may hold many moves, or only a part of this one.
    under = np.maximum(correlate(log**2, np.ones_like(tag), method="fft"), 1e-9 * float(log @ log))
    covered = correlate(np.ones_like(log), tag**2, method="fft") / float(tag @ tag)
    score = np.where(covered > LEAST_COVER, correlate(log, tag, method="fft") / np.sqrt(under * float(tag @ tag)), 0.0)
    best = float(score.max())
    if not best >= LEAST_CORRELATION:
        raise InputError(
            f"the controller's log does not hold the filmed motion: the speeds agree to {best:.2f} at best, expected "
            f"at least {LEAST_CORRELATION:g}; give the log of this take"
        )
    peaks = find_peaks(np.pad(score, 1), height=RIVAL_PEAK * best, distance=int(APART_S * GRID_HZ))[0] - 1
    lags = (peaks[np.argsort(-score[peaks])][:CANDIDATES] - (len(tag) - 1)) / GRID_HZ
    return [float(samples.log_s[0] + lag + samples.time_s.mean() - samples.time_s[0]) for lag in lags]


def _speed_of_tag(samples: _Samples) -> FloatArray:
    grid = np.arange(samples.time_s[0], samples.time_s[-1], 1 / GRID_HZ)
    paths = [fit_smoothing_spline(samples.time_s, column) for column in samples.tag_m.T]
    return np.hypot(*(np.nan_to_num(path(grid, 1)) for path in paths))


def _fit(samples: _Samples, start_s: float, mirror: float) -> _Fit:
    """Fit the clock, and with it rotation, scale and place; what lies far out is dropped once."""
    clock = np.array([start_s, 1.0])
    kept = _covered(samples, clock)

    def left(wanted: FloatArray, kept: BoolArray) -> FloatArray:
        return _residual(samples, wanted, mirror, kept)[1][kept].ravel()

    for _ in range(2):
        clock = least_squares(left, clock, args=(kept,)).x
        similarity, residual = _residual(samples, clock, mirror, kept)
        size = np.hypot(*residual.T)
        covered = _covered(samples, clock)
        kept = covered & (size <= CLIP * max(float(np.median(size[covered])), 1e-9))
    similarity, residual = _residual(samples, clock, mirror, kept)
    return _Fit(clock=clock, similarity=similarity, mirror=mirror, residual_m=residual, kept=kept)


def _covered(samples: _Samples, clock: FloatArray) -> BoolArray:
    when = _log_time(samples, clock, samples.time_s)
    return np.asarray((when >= samples.log_s[0]) & (when <= samples.log_s[-1]), dtype=bool)


def _log_time(samples: _Samples, clock: FloatArray, time_s: FloatArray) -> FloatArray:
    return np.asarray(clock[0] + clock[1] * (time_s - samples.time_s.mean()), dtype=float)


def _residual(samples: _Samples, clock: FloatArray, mirror: float, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return (a, b, c_x, c_z) of tag = c + [[a, -b], [b, a]] log for a clock, and what is left of each sample."""
    x, z = (samples.log_at(_log_time(samples, clock, samples.time_s)) * [mirror, 1.0]).T
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.stack([np.column_stack([x, -z, one, none]), np.column_stack([z, x, none, one])], axis=1)
    similarity = np.linalg.lstsq(rows[kept].reshape(-1, 4), samples.tag_m[kept].ravel(), rcond=None)[0]
    return similarity, samples.tag_m - rows @ similarity


def _agreement(samples: _Samples, fit: _Fit) -> LogAgreement:
    """Return clock, scale and roll with their errors."""
    covariance = _covariance(samples, fit)
    a, b = fit.similarity[:2]
    scale = float(np.hypot(a, b))

    def estimate(value: float, slope: FloatArray) -> Estimate:
        variance = float(slope @ covariance[:4, :4] @ slope)
        return Estimate.normal(value, float(np.sqrt(max(variance, 0.0))))

    back = np.array([1.0, -float(samples.time_s.mean()), 0.0, 0.0])  # from the middle of the video to its zero
    as_is = samples.tag_m[fit.kept] - _turned(samples, fit, samples.time_s[fit.kept])
    as_is = as_is - as_is.mean(axis=0)
    return LogAgreement(
        offset_s=estimate(float(back[:2] @ fit.clock), back),
        rate=estimate(float(fit.clock[1]), np.array([0.0, 1.0, 0.0, 0.0])),
        scale=estimate(scale, np.array([0.0, 0.0, a, b]) / scale),
        roll_rad=estimate(float(np.arctan2(b, a)), np.array([0.0, 0.0, -b, a]) / scale**2),
        rms_m=float(np.sqrt(np.mean(np.sum(as_is**2, axis=1)))),
        rms_scaled_m=fit.rms_m,
        samples=int(np.count_nonzero(fit.kept)),
    )


def _covariance(samples: _Samples, fit: _Fit) -> FloatArray:
    """Return the covariance of (time at the middle, rate, a, b, c_x, c_z), all fitted together."""

    def predicted(p: FloatArray) -> FloatArray:
        x, z = (samples.log_at(_log_time(samples, p[:2], samples.time_s[fit.kept])) * [fit.mirror, 1.0]).T
        return np.column_stack([p[4] + p[2] * x - p[3] * z, p[5] + p[3] * x + p[2] * z]).ravel()

    p = np.concatenate([fit.clock, fit.similarity])
    columns = [(predicted(p + step) - predicted(p - step)) / (2 * STEP) for step in STEP * np.eye(len(p))]
    jacobian = np.column_stack(columns)
    residual = fit.residual_m[fit.kept]
    variance = float(np.sum(residual**2)) / max(residual.size - len(p), 1) * _correlated(residual)
    return np.asarray(variance * np.linalg.pinv(jacobian.T @ jacobian), dtype=float)


def _correlated(residual: FloatArray) -> float:
    """Return by how much residuals that hang together over time say less than as many independent ones."""
    left = residual - residual.mean(axis=0)
    power = float(np.sum(left**2))
    if not power > 0:
        return 1.0
    total = 1.0
    for lag in range(1, len(left) // 4):
        share = float(np.sum(left[lag:] * left[:-lag])) / power
        if share < 0.05:
            break
        total += 2 * share
    return total


def _turned(samples: _Samples, fit: _Fit, time_s: FloatArray) -> FloatArray:
    """Return the log at times of the video, in the track's axes and the log's own scale."""
    a, b = fit.similarity[:2] / np.hypot(*fit.similarity[:2])
    path = samples.log_at(_log_time(samples, fit.clock, time_s)) * [fit.mirror, 1.0]
    return np.asarray(path @ np.array([[a, b], [-b, a]]), dtype=float)


def _place(track: Track, samples: _Samples, fit: _Fit) -> FloatArray:
    """Return the log at all times of the track, where the tag was on average; NaN outside the log."""
    when = _log_time(samples, fit.clock, track.time_s)
    path = _turned(samples, fit, track.time_s)
    path += (samples.tag_m[fit.kept] - _turned(samples, fit, samples.time_s[fit.kept])).mean(axis=0)
    path[(when < samples.log_s[0]) | (when > samples.log_s[-1])] = np.nan
    return path
