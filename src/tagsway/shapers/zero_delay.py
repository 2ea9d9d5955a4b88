"""Zero time delay: the move is hastened so that with its shaper it lasts as long as it did."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter

from tagsway.errors import InputError
from tagsway.model import DigitalFilter, FloatArray, Impulse, Mode, Shaper
from tagsway.shapers.impulses import Impulses
from tagsway.shapers.judging import Design

HOLDS = ("foh", "tustin")
"""How a filter is put on a grid: a command of straight pieces, or the trapezium rule. Zero-order hold leaves 300 times
as much."""

CANCELLED = 1e-6
"""V of a base shaper below which it stops the compensator."""

MOST_SAMPLES = 5_000_000

Command = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPrice:
    """What one way to shape a move asks of the robot, and what it leaves.

    Parameters
    ----------
    method : str
        "none", the base shaper, "ztd" or "mztd".
    end_s : float
        When the command is at rest.
    peak_velocity, peak_acceleration, rms_jerk : float
        Of the command, in its unit per s, s² and s³, by differences over the sample time; the RMS over its duration.
        Where the command's acceleration jumps, the jerk grows as the sample time falls.
    residual : ndarray, shape (n,)
        Largest swing of the mode after the end, in the command's unit, for each of the frequency errors.
    """

    method: str
    end_s: float
    peak_velocity: float
    peak_acceleration: float
    rms_jerk: float
    residual: FloatArray


def hasten(impulses: Impulses, mode: Mode, move_duration_s: float, *, modified: bool = False) -> Design:
    """Return the zero-delay version of an impulse shaper for a move of a given duration.

    Parameters
    ----------
    impulses : Impulses
        The shaper, of length Δ.
    mode : Mode
        What it was designed for.
    move_duration_s : float
        T, of the move as it would be unshaped. For any other move the delay is not zero.
    modified : bool
        False: the move is hastened by α = (T - Δ)/T; it needs T > Δ, and as T approaches Δ its acceleration grows as
        1/α². True [1]_: move and impulses by α' = T/(T + Δ), with a compensator that hastens the mode likewise.

    Returns
    -------
    Design
        Impulses, a time scale below 1, and for the modified version the compensator

            F(s) = (s² + 2ζωs + ω²) / ((α's)² + 2ζω α's + ω²).

    Raises
    ------
    InputError
        For T ≤ Δ, for a mode without damping (the compensator would not be stable), and for base impulses that do not
        stop the compensator.

    Notes
    -----
    F(0) = 1 and F(∞) = 1/α'²: jumps of the command pass it enlarged, so the command's acceleration should not jump.
    The modified version loses the base shaper's robustness: the pole is cancelled by a single zero, whatever the base.
    At -10 % it leaves 40 times as much as the plain ZVD (see `zero_delay_prices`).

    References
    ----------
    .. [1] Y. Zhao and M. Tomizuka, Modified zero time delay input shaping for industrial robot with flexibility.
    """
    length = float(impulses.time_s[-1])
    if not (move_duration_s > 0 and math.isfinite(move_duration_s)):
        raise InputError(f"a move's duration must be positive, not {move_duration_s:g} s")
    if modified:
        return _hasten_mode(impulses, mode, move_duration_s)
    if not move_duration_s > length:
        raise InputError(
            f"zero time delay needs a move longer than its shaper: {move_duration_s:g} s is not more than "
            f"{length:.6g} s; use a shorter shaper, or mztd"
        )
    return Design(impulses=impulses, time_scale=(move_duration_s - length) / move_duration_s)


def _hasten_mode(impulses: Impulses, mode: Mode, move_duration_s: float) -> Design:
    """Return the modified version: move, impulses and, by a compensator, the mode are hastened alike."""
    length = float(impulses.time_s[-1])
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    pole = w * complex(zeta, math.sqrt(1 - zeta**2))
    if not zeta > 0:
        raise InputError("modified zero time delay needs a mode with damping: its compensator rings for ever; use ztd")
    if abs(np.exp(pole * (impulses.time_s - length)) @ impulses.amplitude) > CANCELLED:
        raise InputError("modified zero time delay needs a shaper that leaves nothing at the mode: use zv, zvd or zvdd")
    scale = move_duration_s / (move_duration_s + length)
    compensator = DigitalFilter(numerator=(1.0, 2 * zeta * w, w**2), denominator=(scale**2, 2 * zeta * w * scale, w**2))
    return Design(
        impulses=Impulses(time_s=scale * impulses.time_s, amplitude=impulses.amplitude),
        filter=compensator,
        time_scale=scale,
    )


def apply_to_command(
    command: Command, duration_s: float, shaper: Shaper, sample_time_s: float, *, hold: str = "foh"
) -> tuple[FloatArray, FloatArray]:
    """Return a shaped command on a grid, with its filter discretised: what a controller can compute.

    Parameters
    ----------
    command : callable
        u(t) of the unshaped move for an array of times within [0, duration_s], from 0, at rest at both ends.
    duration_s : float
        T.
    shaper : Shaper
        Impulses, time scale and filter; no box.
    sample_time_s : float
        Of the grid.
    hold : str
        One of `HOLDS`.

    Returns
    -------
    time_s, position : ndarray, shape (n,)
        Until the filter's tail has ended; the impulses act at their own times, not on the grid.

    Raises
    ------
    InputError
        For a shaper with a box (its exact average is that of a trajectory), and a sample time that cannot be.
    """
    if shaper.box_s is not None:
        raise InputError("a command on a grid takes no box: shape the trajectory itself")
    if hold not in HOLDS:
        raise InputError(f"a filter is put on a grid by one of {', '.join(HOLDS)}, not {hold!r}")
    moving = duration_s * shaper.time_scale
    end = moving + shaper.duration_s
    if not (sample_time_s > 0 and end / sample_time_s < MOST_SAMPLES):
        raise InputError(f"a sample time of {sample_time_s:g} s cannot be used for {end:.3g} s of motion")
    time: FloatArray = np.arange(math.ceil(end / sample_time_s - 1e-9) + 1.0) * sample_time_s
    position: FloatArray = np.zeros(len(time))
    for impulse in shaper.impulses:
        local = np.clip((time - impulse.time_s) / shaper.time_scale, 0.0, duration_s)
        position += impulse.amplitude * command(local)
    if shaper.filter is not None:
        position = _filtered(position, shaper.filter.numerator, shaper.filter.denominator, sample_time_s, hold)
    return time, position


def swing_after(time_s: FloatArray, position: FloatArray, mode: Mode, end_s: float) -> float:
    """Return the largest swing |y - u| of a mode after a command ended, in the command's unit.

    Notes
    -----
    y'' + 2ζω y' + ω² y = ω² u with a command of straight pieces, exactly; the swing is the envelope's maximum that is
    reached in the first period after `end_s`.
    """
    w, zeta = mode.angular_frequency_rad_s, mode.damping_ratio
    step = float(time_s[1] - time_s[0])
    rest = np.full(math.ceil(mode.damped_period_s / step) + 1, position[-1])
    driven = np.concatenate([position, rest])
    answer = _filtered(driven, (w**2,), (1.0, 2 * zeta * w, w**2), step, "foh")
    after = np.arange(len(driven)) * step >= end_s - 1e-9
    return float(np.max(np.abs(answer[after] - position[-1])))


def zero_delay_prices(
    command: Command,
    duration_s: float,
    mode: Mode,
    shaped: Sequence[Shaper],
    *,
    sample_time_s: float = 1e-3,
    frequency_error: Sequence[float] = (-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15),
    hold: str = "foh",
) -> tuple[MotionPrice, ...]:
    """Return what each way to shape one move costs, and what it leaves where the frequency is wrong.

    Parameters
    ----------
    command, duration_s : callable, float
        As for `apply_to_command`; a smooth one, or the compensator enlarges its jumps.
    mode : Mode
        The mode designed for.
    shaped : sequence of Shaper
        To be compared, such as zvd, ztd-zvd and mztd-zvd for this duration; the unshaped move comes first of itself.
    sample_time_s, hold : float, str
        As for `apply_to_command`.
    frequency_error : sequence of float
        Actual over designed frequency, less 1.
    """
    plain = Shaper(type="none", modes=(), impulses=(Impulse(time_s=0.0, amplitude=1.0),))
    errors = [
        Mode(natural_frequency_hz=mode.natural_frequency_hz * (1 + error), damping_ratio=mode.damping_ratio)
        for error in frequency_error
    ]
    prices = []
    for shaper in (plain, *shaped):
        time, position = apply_to_command(command, duration_s, shaper, sample_time_s, hold=hold)
        end = duration_s * shaper.time_scale + shaper.duration_s
        # At rest before and after: the first and last differences count as well.
        padded = np.concatenate([np.zeros(3), position, np.full(3, position[-1])])
        velocity, acceleration, jerk = (np.diff(padded, order) / sample_time_s**order for order in (1, 2, 3))
        prices.append(
            MotionPrice(
                method=shaper.type,
                end_s=end,
                peak_velocity=float(np.max(np.abs(velocity))),
                peak_acceleration=float(np.max(np.abs(acceleration))),
                rms_jerk=float(np.sqrt(np.sum(jerk**2) * sample_time_s / end)),
                residual=np.array([swing_after(time, position, actual, end) for actual in errors]),
            )
        )
    return tuple(prices)


def _filtered(
    signal: FloatArray, numerator: Sequence[float], denominator: Sequence[float], step_s: float, hold: str
) -> FloatArray:
    """Return what a filter in continuous time makes of samples, from rest."""
    system = (np.array(numerator, dtype=float), np.array(denominator, dtype=float))
    above, below, _ = cont2discrete(system, step_s, method="foh" if hold == "foh" else "bilinear")
    return np.asarray(lfilter(np.ravel(above), np.ravel(below), signal), dtype=float)
