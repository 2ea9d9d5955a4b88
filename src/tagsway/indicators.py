"""How a measured move ended: settling, overshoot, times and accelerations, by the definitions of `criteria`."""

from collections.abc import Sequence

import numpy as np

from tagsway.criteria import Criteria, judge_move, load_of
from tagsway.errors import InputError
from tagsway.filters import fit_smoothing_spline
from tagsway.filters.moves import find_moves
from tagsway.model import (
    GRAVITY_M_S2,
    AlignedMove,
    BoolArray,
    CleanTrack,
    Estimate,
    Event,
    FloatArray,
    Indicators,
    PeakAcceleration,
    ResidualAcceleration,
    Track,
    Window,
)

LEAST_TRAVEL_M = 5e-3
"""A tool that went less far did not move."""


def measure_indicators(
    track: Track, clean: CleanTrack, window: Window, *, reference_m: float | None = None
) -> Indicators | None:
    """Measure the indicators of the move before a free vibration.

    Parameters
    ----------
    track : Track
        Raw: the errors of the accelerations come from it.
    clean : CleanTrack
        The same cleaned.
    window : Window
        The free vibration; what comes after its end (a release, a contact) does not count.
    reference_m : float, optional
        Length that the percentages refer to, such as the place coordinate; by default the travel.

    Returns
    -------
    Indicators or None
        None where the tool was not seen or did not move (a release by hand), or lengths are not known.
    """
    if track.length_unit != "m" or clean.tcp is None or (found := _cut_move(clean, window)) is None:
        return None
    moving, used = found
    horizontal_std, vector_std = _peak_errors(track, clean, used)
    return indicators_of(
        clean.time_s[used],
        clean.tcp.position[used],
        clean.pcp.position[used],
        clean.pcp.acceleration[used],
        end_s=moving.end_s,
        reference_m=reference_m,
        horizontal_std=horizontal_std,
        vector_std=vector_std,
        bandwidth_hz=clean.pcp.bandwidth_hz,
    )


def align_move(track: Track, clean: CleanTrack, window: Window) -> AlignedMove | None:
    """Return the move before a free vibration from its start on, as it is laid over others.

    Parameters
    ----------
    track, clean, window
        As in `measure_indicators`.

    Returns
    -------
    AlignedMove or None
        None where there are no indicators, either. Its time 0 and its resting place are those of the indicators.
    """
    if track.length_unit != "m" or clean.tcp is None or (found := _cut_move(clean, window)) is None:
        return None
    moving, used = found
    time, tool, product = clean.time_s[used], clean.tcp.position[used], clean.pcp.position[used]
    final = _resting_place(time, product, moving.end_s)
    seen = tool[np.isfinite(tool).all(axis=1)]
    way = (seen[-1] - seen[0]) / np.linalg.norm(seen[-1] - seen[0])
    beyond = (product - final) @ way
    return AlignedMove(
        time_s=time - moving.start_s,
        sway_m=beyond - (tool - seen[-1]) @ way,
        beyond_m=beyond,
        acceleration_m_s2=clean.pcp.acceleration[used, 0],
        end_s=moving.end_s - moving.start_s,
    )


def find_watched(clean: CleanTrack, *, events: Sequence[Event] = ()) -> Window | None:
    """Return what is seen after the tool's last move, whether anything swings there or not.

    Parameters
    ----------
    clean : CleanTrack
        Of the tags.
    events : sequence of Event
        What happened to the grip: what follows its end does not count.

    Returns
    -------
    Window or None
        None where the tool was not seen or did not move, or nothing is left after the move.
    """
    if clean.tcp is None:
        return None
    last = min([float(clean.time_s[-1]), *(event.time_s.value for event in events if event.ends_grip)])
    moves = find_moves(clean.time_s, clean.tcp.position, clean.tcp.velocity, least=LEAST_TRAVEL_M)
    if not moves or not moves[-1].end_s < last:
        return None
    return Window(start_s=moves[-1].end_s, end_s=last)


def indicators_of(
    time_s: FloatArray,
    tcp_m: FloatArray,
    pcp_m: FloatArray,
    pcp_acceleration_m_s2: FloatArray,
    *,
    end_s: float,
    final_m: FloatArray | None = None,
    reference_m: float | None = None,
    horizontal_std: float = 0.0,
    vector_std: float = 0.0,
    bandwidth_hz: float,
) -> Indicators:
    """Return the indicators of a rest-to-rest move, measured or simulated.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        From the start of the tool's motion to the end of the record.
    tcp_m, pcp_m : ndarray, shape (n, 2)
        x and z of tool and product; NaN where not seen.
    pcp_acceleration_m_s2 : ndarray, shape (n, 2)
        Of the product.
    end_s : float
        When the tool stands again.
    final_m : ndarray, shape (2,), optional
        Where the product comes to rest; by default the mean of its positions after the move under a bell-shaped
        (Hann) weight, which leaves out whole and broken swings alike.
    reference_m : float, optional
        Length that the percentages refer to; by default the tool's travel.
    horizontal_std, vector_std : float
        Standard errors of the two peak accelerations, in m/s².
    bandwidth_hz : float
        Up to which the accelerations were seen; for a simulation half its sampling rate.

    Returns
    -------
    Indicators
        Settling and overshoot are taken along the tool's travel.

    Raises
    ------
    InputError
        Where the tool did not go anywhere, or the product was never seen.
    """
    reference = _find_reference(tcp_m, pcp_m, reference_m)
    final = _resting_place(time_s, pcp_m, end_s) if final_m is None else final_m
    found = judge_move(time_s, tcp_m, pcp_m, pcp_acceleration_m_s2, end_s=end_s, final_m=final, reference_m=reference_m)
    return Indicators(
        reference_m=reference,
        settling_time_s=_known(found.settling_time_s),
        overshoot_percent=float(found.overshoot_percent),
        trajectory_time_s=float(found.trajectory_time_s),
        motion_time_s=_known(found.motion_time_s),
        max_pcp_acceleration_m_s2=PeakAcceleration(
            horizontal=_peak(found.horizontal_m_s2, horizontal_std),
            vector_with_gravity=_peak(found.vector_m_s2, vector_std),
            bandwidth_hz=bandwidth_hz,
        ),
        residual_acceleration_m_s2=_residual(found),
        box_error_m=_known(found.box_error_m),
        place_error_m=_known(found.place_error_m),
    )


def find_last_move(clean: CleanTrack, window: Window) -> Window | None:
    """Return the tool's last move before a free vibration, cut where that begins."""
    if clean.tcp is None:
        return None
    for move in reversed(find_moves(clean.time_s, clean.tcp.position, clean.tcp.velocity, least=LEAST_TRAVEL_M)):
        if move.start_s < window.start_s:
            return Window(start_s=move.start_s, end_s=min(move.end_s, window.start_s))
    return None


def _cut_move(clean: CleanTrack, window: Window) -> tuple[Window, BoolArray] | None:
    """Return the move before a free vibration, and which samples belong to both; None where there is none to judge."""
    moving = find_last_move(clean, window)
    if clean.tcp is None or moving is None:
        return None
    used = (clean.time_s >= moving.start_s) & (clean.time_s <= window.end_s)
    path = clean.tcp.position[used & np.isfinite(clean.tcp.position).all(axis=1)]
    if not np.linalg.norm(path[-1] - path[0]) > LEAST_TRAVEL_M:
        return None
    if not np.isfinite(clean.pcp.position[used]).all(axis=1).any():
        return None
    return moving, used


def _find_reference(tcp_m: FloatArray, pcp_m: FloatArray, stated_m: float | None) -> float:
    """Return the length that percentages refer to, of a move that can be judged."""
    tool = tcp_m[np.isfinite(tcp_m).all(axis=1)]
    travel = tool[-1] - tool[0] if len(tool) else np.zeros(2)
    distance = float(np.linalg.norm(travel))
    reference = distance if stated_m is None else stated_m
    if not (distance > 0 and reference > 0):
        raise InputError(f"a move of {1000 * distance:g} mm and a reference of {1000 * reference:g} mm: expected more")
    if not np.isfinite(pcp_m).all(axis=1).any():
        raise InputError("the product was never seen during or after the move: there is nothing to measure")
    return reference


def _residual(found: Criteria) -> ResidualAcceleration | None:
    largest, effective = float(found.residual_max_m_s2), float(found.residual_rms_m_s2)
    return ResidualAcceleration(max=largest, rms=effective) if np.isfinite([largest, effective]).all() else None


def _resting_place(time_s: FloatArray, pcp_m: FloatArray, end_s: float) -> FloatArray:
    seen = np.isfinite(pcp_m).all(axis=1)
    after = seen & (time_s >= end_s)
    if np.count_nonzero(after) < 3:
        return np.asarray(pcp_m[seen][-1])
    time = time_s[after]
    weight = np.sin(np.pi * (time - time[0]) / (time[-1] - time[0])) ** 2 * np.gradient(time)
    return np.asarray(weight @ pcp_m[after] / weight.sum())


def _known(value: FloatArray) -> float | None:
    """Return None for NaN: what does not settle has no settling time."""
    return float(value) if np.isfinite(value) else None


def _peak(value: FloatArray, std: float) -> Estimate | None:
    return Estimate.normal(float(value), std, low=0.0) if np.isfinite(value) else None


def _peak_errors(track: Track, clean: CleanTrack, used: BoolArray) -> tuple[float, float]:
    """Return the standard errors of the two peak accelerations: of the smoothing spline, where they are."""
    acceleration = np.where(used[:, None], clean.pcp.acceleration, np.nan)
    horizontal, vector = load_of(acceleration)
    if not np.isfinite(vector).any():
        return 0.0, 0.0
    noise, bandwidth = clean.pcp.sample_std, clean.pcp.bandwidth_hz
    position = np.where(np.isfinite(noise), track.pcp.position, np.nan)
    x, z = (
        fit_smoothing_spline(track.time_s, position[:, axis], noise[:, axis], bandwidth_hz=bandwidth) for axis in (0, 1)
    )
    first, second = int(np.nanargmax(horizontal)), int(np.nanargmax(vector))
    at = clean.time_s[second]
    share = acceleration[second, 0] / vector[second], (acceleration[second, 1] + GRAVITY_M_S2) / vector[second]
    error = np.hypot(share[0] * x.std(at, 2), share[1] * z.std(at, 2))
    return float(x.std(clean.time_s[first], 2)), float(error)
