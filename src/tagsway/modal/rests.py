"""The parts of a record in which the tool stands."""

import numpy as np

from tagsway.filters.moves import find_moves
from tagsway.modal.sway import MAD_TO_STD
from tagsway.model import CleanTagTrack, CleanTrack, FloatArray, TagTrack, Track, Window

LEAST_RANGE = 0.02
"""Share of the tool's own range, and of the product's, below which a motion of the tool is none."""

LEAST_SAMPLES = 8
"""In a rest, or of a tool that is to be believed."""


def find_rests(track: Track, clean: CleanTrack) -> tuple[Window, ...]:
    """Return the parts of a record in which the tool is at rest.

    Parameters
    ----------
    track : Track
        Raw.
    clean : CleanTrack
        The same without spikes; of the tool, its velocity.

    Returns
    -------
    tuple of Window
        The whole record where there is no tool or it never moves beyond its noise.

    Notes
    -----
    After a move, the tool may ring: the rest begins when it stays at its place, unless it rings on and on.
    """
    time = track.time_s
    whole = (Window(start_s=float(time[0]), end_s=float(time[-1])),) if time[-1] > time[0] else ()
    if track.tcp is None or clean.tcp is None:
        return whole
    seen = np.isfinite(clean.tcp.position).all(axis=1)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return whole
    noise = _noise_of(track.tcp)
    travel = float(np.hypot(*np.ptp(clean.tcp.position[seen], axis=0)))
    product = np.nanpercentile(track.pcp.position, [2, 98], axis=0)
    least = max(8 * noise, LEAST_RANGE * float(np.nanmax(product[1] - product[0])), LEAST_RANGE * travel)
    moves = find_moves(time, clean.tcp.position, clean.tcp.velocity, least=least)
    if not moves:
        return whole
    # The clean track has spread the ends of a motion over its own response: half of it is left out.
    blur = 0.5 / clean.tcp.bandwidth_hz if clean.tcp.bandwidth_hz > 0 else 0.0
    starts = [float(time[0]), *(move.end_s + blur for move in moves)]
    ends = [*(move.start_s - blur for move in moves), float(time[-1])]
    rests = []
    for start, end in zip(starts, ends, strict=True):
        first, last = int(np.searchsorted(time, start)), int(np.searchsorted(time, end, side="right")) - 1
        first = _settled(clean.tcp, first, last, tolerance=max(5 * noise, 5e-4 * travel))
        if last - first >= LEAST_SAMPLES:
            rests.append(Window(start_s=float(time[first]), end_s=float(time[last])))
    return tuple(rests)


def estimate_noise(value: FloatArray) -> float:
    """Return the white noise of a smooth signal, from its third differences.

    Parameters
    ----------
    value : ndarray, shape (n,)
        Finite.

    Returns
    -------
    float
        Its standard deviation; 0 for fewer than 4 samples.
    """
    if len(value) < 4:
        return 0.0
    return MAD_TO_STD * float(np.median(np.abs(np.diff(value, 3)))) / float(np.sqrt(20))


def _noise_of(tag: TagTrack) -> float:
    return max((estimate_noise(axis[np.isfinite(axis)]) for axis in tag.position.T), default=0.0)


def _settled(tool: CleanTagTrack, first: int, last: int, *, tolerance: float) -> int:
    """Return from where the tool stays at its place; the rest's first sample where it rings on and on, or drifts."""
    position = tool.position[first : last + 1]
    seen = np.isfinite(position[len(position) // 2 :]).all(axis=1)
    if not seen.any():
        return first
    final = np.median(position[len(position) // 2 :][seen], axis=0)
    outside = np.flatnonzero(np.hypot(*(position - final).T) > tolerance)
    if outside.size == 0 or outside[-1] > 0.5 * len(position):
        return first
    return first + int(outside[-1]) + 1
