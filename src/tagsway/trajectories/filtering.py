"""A filter's response to a move: exact, with a tail that ends."""

import math

import numpy as np
from numpy.polynomial import polynomial
from scipy.linalg import expm
from scipy.signal import tf2ss

from tagsway.errors import InputError
from tagsway.model import DigitalFilter, FloatArray, Trajectory
from tagsway.trajectories.fitting import Derivatives, fit_pieces, join_pieces

SETTLED_M = 1e-6
"""What is left of the tail when it is over, as the shaper's own `tail_s` has it for a move of 1 m."""

EXACT = 1e-10
"""In m and m/s: what needs no tail at all."""

LONGEST_TAIL = 20.0
"""Times the move; a filter that rings longer is not one to lay over it."""

FADE_CONSTANTS = 2.0
"""Slowest time constants, at the end of the tail, in which what is left fades: there it is below 10 µm."""

FADE = np.array([1.0, 0, 0, 0, -35, 84, -70, 20])
"""From 1 to 0 with three derivatives of 0 at both ends."""

LOOKS, LOOKS_A_CONSTANT = 800, 8
"""How often, and how densely, the tail is looked at: over a hundred time constants."""


def apply_filter(trajectory: Trajectory, filter: DigitalFilter, *, tail_s: float = 0.0) -> Trajectory:  # noqa: A002
    """Return what a linear filter makes of a move.

    Parameters
    ----------
    trajectory : Trajectory
        From rest to rest.
    filter : DigitalFilter
        Stable, and of gain 1 at rest, as its type demands.
    tail_s : float
        How long it rings on at least; longer where more than 1 µm would be left.

    Returns
    -------
    Trajectory
        The response of all three axes within 1e-10 m. In the last two time constants of the tail what is left, below
        10 µm, fades smoothly, and the motion ends exactly where the move does, at rest.

    Raises
    ------
    InputError
        For a filter that rings for more than 20 times the move.

    Notes
    -----
    In each piece the input is a polynomial, to which the filter's state answers with another one and a matrix
    exponential: x(t) = p(t) + exp(A t) (x0 - p(0)), A p_k + B c_k = (k + 1) p_(k + 1). So no grid is involved.
    """
    if len(filter.denominator) == 1:
        return trajectory
    A, B, C, D = _state_space(filter)
    start = trajectory(0.0)
    state = np.zeros((len(A), 3))
    parts = []
    for index, piece in enumerate(trajectory.coefficients):
        command = piece.copy()
        command[0] -= start
        begin, end = float(trajectory.breaks_s[index]), float(trajectory.breaks_s[index + 1])
        response = _Response(A, B, C, D, command, state)
        breaks, coefficients = fit_pieces(response.since(begin), begin, end)
        coefficients[:, 0] += start
        parts.append((breaks, coefficients))
        state = response.state_at(end - begin)
    gone = (trajectory(trajectory.duration_s) - start)[None]
    rest = _Response(A, B, C, D, gone, state)
    end = trajectory.duration_s
    tail, fade = _tail_s(rest, gone[0], tail_s, LONGEST_TAIL * end)
    if tail > fade:
        parts.append(fit_pieces(rest.since(end), end, end + tail - fade))
        parts[-1][1][:, 0] += start
    if tail > 0:
        begin = end + tail - fade
        parts.append(fit_pieces(lambda t: _fade(rest.at(t - end), gone[0], t - begin, fade), begin, end + tail))
        parts[-1][1][:, 0] += start
    return join_pieces(parts)


class _Response:
    """The filter's answer to one polynomial: shapes (n, n), (n, 1), (1, n), float, (k, 3) and (n, 3)."""

    def __init__(
        self, A: FloatArray, B: FloatArray, C: FloatArray, D: float, command: FloatArray, state: FloatArray
    ) -> None:
        self.A, self.C, self.D, self.command = A, C, D, command
        self.forced = np.zeros((len(command), len(A), 3))
        rising = np.zeros_like(state)
        for power in range(len(command) - 1, -1, -1):
            self.forced[power] = np.linalg.solve(A, rising - B * command[power])
            rising = power * self.forced[power]
        self.free = state - self.forced[0]

    def state_at(self, time_s: float) -> FloatArray:
        forced: FloatArray = np.tensordot(time_s ** np.arange(len(self.forced)), self.forced, axes=1)
        state: FloatArray = forced + expm(self.A * time_s) @ self.free
        return state

    def since(self, start_s: float) -> Derivatives:
        """Return the output as a function of the time that is `start_s` when this polynomial begins."""
        return lambda time_s: self.at(time_s - start_s)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the output and its three derivatives, shape (4, n, 3)."""
        free = expm(self.A * np.asarray(time_s)[:, None, None]) @ self.free
        output = self.C[0] @ self.forced.transpose(1, 0, 2).reshape(len(self.A), -1)
        polynomials = output.reshape(self.command.shape) + self.D * self.command
        results = []
        for order in range(4):
            forced = polynomial.polyval(time_s, polynomial.polyder(polynomials, order))
            results.append((self.C @ free)[:, 0] + forced.T)
            free = self.A @ free
        return np.stack(results)


def _state_space(filter: DigitalFilter) -> tuple[FloatArray, FloatArray, FloatArray, float]:  # noqa: A002
    """Return (A, B, C, D), its states scaled so that A's entries are of the size of the poles."""
    A, B, C, D = tf2ss(np.trim_zeros(filter.numerator, "f"), filter.denominator)
    unit = abs(filter.denominator[-1] / filter.denominator[0]) ** (1 / len(A))
    scale = unit ** -np.arange(len(A), dtype=float)
    return A * scale / scale[:, None], B / scale[:, None], C * scale, float(D[0, 0])


def _tail_s(rest: _Response, gone: FloatArray, least_s: float, longest_s: float) -> tuple[float, float]:
    """Return how long the tail is, and how long its end that fades; both 0 where nothing is left to ring."""
    constant = 1 / float(np.min(-np.linalg.eigvals(rest.A).real))
    time: FloatArray = np.arange(LOOKS, dtype=np.float64) * constant / LOOKS_A_CONSTANT
    left = np.abs(rest.at(time)[:2] - np.stack([gone, np.zeros(3)])[:, None])
    if not np.max(left) > EXACT:
        return 0.0, 0.0
    loud = np.flatnonzero(np.max(left[0], axis=1) > SETTLED_M)
    settled = float(time[min(loud[-1] + 1, LOOKS - 1)]) if len(loud) else 0.0
    fade = FADE_CONSTANTS * constant
    tail = max(settled, least_s, fade)
    if not tail <= longest_s:
        raise InputError(
            f"the filter rings on for {tail:.3g} s after a move of {longest_s / LONGEST_TAIL:.3g} s: expected one with "
            "more damping, or of a higher frequency"
        )
    return tail, fade


def _fade(response: FloatArray, gone: FloatArray, time_s: FloatArray, length_s: float) -> FloatArray:
    """Return the response with what it still lacks multiplied by 1 - 35 u⁴ + 84 u⁵ - 70 u⁶ + 20 u⁷."""
    share = time_s / length_s
    window = [polynomial.polyval(share, polynomial.polyder(FADE, n))[:, None] / length_s**n for n in range(4)]
    left = response.copy()
    left[0] -= gone
    faded = np.stack([sum(math.comb(n, k) * left[k] * window[n - k] for k in range(n + 1)) for n in range(4)])
    faded[0] += gone
    return faded
