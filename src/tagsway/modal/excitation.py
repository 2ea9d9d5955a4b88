"""What a move excites, and how much of that falls on the payload's own frequency."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import zoom_fft

from tagsway.filters.moves import find_moves
from tagsway.modal.noise import grid_places
from tagsway.modal.rests import estimate_noise
from tagsway.model import SCALE_STD, CleanTrack, Estimate, Excitation, ExcitationCurve, FloatArray, Track, Window

LEAST_SHARE = 0.1
"""Of the tool's range, below which its motion is not the move that is judged."""

HIGHEST_HZ, TIMES_FREQUENCY = 50.0, 10.0
"""The spectra go up to the larger of a frequency and so many times the payload's, as far as the frames allow."""

FEWEST_LINES, MOST_LINES = 1024, 8192
"""Of a spectrum."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationFit:
    """The spectra, and what they say of the move; None where there was none."""

    excitation: Excitation | None
    curve: ExcitationCurve


def measure_excitation(track: Track, clean: CleanTrack, window: Window, *, frequency_hz: Estimate) -> ExcitationFit:
    """Measure how much of the move before a free vibration falls on the payload's frequency.

    Parameters
    ----------
    track : Track
        Raw: the noise of the tool's path comes from it.
    clean : CleanTrack
        With accelerations.
    window : Window
        The free vibration; what comes after its end does not count.
    frequency_hz : Estimate
        Of the payload at its operating amplitude.

    Returns
    -------
    ExcitationFit

    Notes
    -----
    To a pendulum that is small against its arc, x'' + ω² x = -X'', a move of the tool leaves a sway of amplitude
    |A(f)| / ω with A(f) = ∫ X'' exp(-iωt) dt over the move: its spectrum at the payload's frequency is what it excites
    [1]_, and an impulse shaper works by making it zero there. Three spectra of each tag are kept, as in the thesis: of
    the whole record, after the move, and over the second half of that. They are zero-padded, without a taper.

    Not a forecast where the tool also moves up and down, or the swing is large: a lift changes the weight that brings
    the payload back, and what is left may be anything from a twentieth to one and a half of the sway given.

    References
    ----------
    .. [1] N. C. Singer and W. P. Seering, J. Dyn. Sys. Meas. Control 112 (1990) 76-82.
    """
    time = clean.time_s
    nothing = np.full(len(time), np.nan)
    tool = nothing if clean.tcp is None else clean.tcp.acceleration[:, 0]
    move = _find_move(clean, window)
    begun = max(float(time[0]), window.start_s) if move is None else move.end_s
    late = (begun + window.end_s) / 2
    parts = [(float(time[0]), window.end_s), (begun, window.end_s), (late, window.end_s)]
    step = float(np.median(np.diff(time)))
    top = min(max(HIGHEST_HZ, TIMES_FREQUENCY * frequency_hz.value), 0.5 / step)
    count = int(np.clip(2 * top * (window.end_s - float(time[0])), FEWEST_LINES, MOST_LINES))
    lines = np.linspace(0.0, top, count)
    spectra = [
        [_transform(time, signal, start, end, lines) for start, end in parts]
        for signal in (tool, clean.pcp.acceleration[:, 0])
    ]
    curve = ExcitationCurve(
        frequency_hz=lines,
        tcp_whole=spectra[0][0],
        tcp_after=spectra[0][1],
        tcp_late=spectra[0][2],
        pcp_whole=spectra[1][0],
        pcp_after=spectra[1][1],
        pcp_late=spectra[1][2],
        move_s=None if move is None else (move.start_s, move.end_s),
        late_s=late,
        bandwidth_hz=clean.pcp.bandwidth_hz if clean.tcp is None else clean.tcp.bandwidth_hz,
    )
    excitation = None if move is None else _judge(track, time, tool, move, frequency_hz, lines)
    return ExcitationFit(excitation=excitation, curve=curve)


def _find_move(clean: CleanTrack, window: Window) -> Window | None:
    """Return the tool's last move that began before the window."""
    if clean.tcp is None or not np.isfinite(clean.tcp.position).all(axis=1).any():
        return None
    least = LEAST_SHARE * float(np.hypot(*(np.nanmax(clean.tcp.position, 0) - np.nanmin(clean.tcp.position, 0))))
    moves = find_moves(clean.time_s, clean.tcp.position, clean.tcp.velocity, least=least)
    return next((move for move in reversed(moves) if move.end_s <= window.start_s + 1e-9), None)


def _transform(
    time_s: FloatArray, signal: FloatArray, start_s: float, end_s: float, lines_hz: FloatArray
) -> FloatArray:
    """Return |∫ signal exp(-2πi f t) dt| over a part; what was not seen adds nothing."""
    used = np.isfinite(signal) & (time_s >= start_s) & (time_s <= end_s)
    if np.count_nonzero(used) < 2:
        return np.full(len(lines_hz), np.nan)
    time = time_s[used]
    place = grid_places(time)
    grid = np.zeros(int(place[-1]) + 1)
    grid[place] = signal[used]
    step = float(time[-1] - time[0]) / max(int(place[-1]), 1)
    top = float(lines_hz[-1])
    return np.asarray(step * np.abs(zoom_fft(grid, [0.0, top], len(lines_hz), fs=1 / step, endpoint=True)), dtype=float)


def _judge(
    track: Track, time_s: FloatArray, tool: FloatArray, move: Window, frequency: Estimate, lines_hz: FloatArray
) -> Excitation | None:
    """Return what a move excites at a frequency."""
    assert track.tcp is not None
    step = float(np.median(np.diff(time_s)))
    # The smoothing spreads the jolts at its ends by a few samples.
    inside = (time_s >= move.start_s - 5 * step) & (time_s <= move.end_s + 5 * step) & np.isfinite(tool)
    time, signal = time_s[inside], tool[inside]
    if len(time) < 8:
        return None
    weight = np.gradient(time)
    push = float(np.sum(np.abs(signal) * weight))
    spectrum = _transform(time, signal, move.start_s - 1, move.end_s + 1, lines_hz)
    peak = float(np.max(spectrum))
    near = frequency.value + np.array([-1.0, 0.0, 1.0]) * max(frequency.std, 1e-3 * frequency.value)
    left, size, right = (float(abs(np.sum(weight * signal * np.exp(-2j * np.pi * f * time)))) for f in near)
    if not (push > 0 and peak > 0):
        return None
    omega = 2 * np.pi * frequency.value
    # White noise of the path, twice differentiated: ω² σ √(T Δt / 2) of the spectrum's magnitude.
    # Of the moving tag: a codec freezes the noise of one at rest.
    seen = track.tcp.position[inside & np.isfinite(track.tcp.position[:, 0]), 0]
    noise = omega**2 * estimate_noise(seen) * float(np.sqrt(step * (time[-1] - time[0]) / 2))
    slope = (right - left) / float(near[2] - near[0])
    std = float(np.hypot(noise, slope * frequency.std))
    return Excitation(
        frequency_hz=frequency.value,
        share_of_peak=Estimate.normal(size / max(peak, size), std / peak, low=0.0, high=1.0),
        share_of_push=Estimate.normal(size / push, std / push, low=0.0, high=1.0),
        sway_m=Estimate.normal(size / omega, float(np.hypot(std, SCALE_STD * size)) / omega, low=0.0)
        if track.length_unit == "m"
        else None,
        strongest_hz=float(lines_hz[int(np.argmax(spectrum))]),
    )
