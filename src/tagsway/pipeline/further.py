"""How far a move excites the further modes: from the film of a move and the decay after it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tagsway.design import FurtherMode, PayloadSpread, make_payloads
from tagsway.design.motion import simulate_swing
from tagsway.filters import clean_track
from tagsway.indicators import find_last_move
from tagsway.model import GRAVITY_M_S2, CleanTrack, FloatArray, Mode, Notice, Result, Track, Window
from tagsway.pipeline.retuning import seen_velocity
from tagsway.store.tracks import read_track

STEP_S = 2e-3

LEAST_SHARE = 0.02
"""Of what the hardest push of that size could do: a move that excites a mode less says nothing of its gain."""


def find_gains(
    result: Result, folder: Path, modes: Sequence[Mode], *, length_m: float | None, radius_m: float | None
) -> tuple[tuple[float, ...], list[Notice]]:
    """Return the gain of each further mode of a measurement, and where it came from.

    Parameters
    ----------
    result : Result
        Of a film.
    folder : Path
        Where track.csv lies and shows the move before the decay, the gains are measured, else they are 1, that of a
        point on a string.
    modes : sequence of Mode
        Of that result, for a small swing, the pendulum's first.
    length_m, radius_m : float or None
        Equivalent length, by default that of a pendulum without a spring, and radius of the tag's arc, by default l.
    """
    free = GRAVITY_M_S2 / modes[0].angular_frequency_rad_s ** 2
    length = max(length_m or free, free)
    amplitudes = [] if result.modal is None else [mode.amplitude_m for mode in result.modal.modes[1:]]
    measured: tuple[float | None, ...] = (None,) * len(amplitudes)
    path = folder / "track.csv"
    if result.window_s is not None and path.is_file():
        window = Window(start_s=result.window_s[0], end_s=result.window_s[1])
        radius = radius_m or length
        measured = measure_gains(read_track(path), window, modes, amplitudes, length_m=length, radius_m=radius)
    notices = []
    for mode, gain in zip(modes[1:], measured, strict=True):
        name = f"the further mode of {mode.natural_frequency_hz:.4g} Hz"
        if gain is None:
            words = f"{name} is taken to sway like a point on a string (gain 1): no move before the decay tells better"
            notices.append(Notice(code="further_gain_assumed", message=words))
        else:
            words = f"{name} has a gain of {gain:.2g}, as the filmed move and the decay after it tell"
            notices.append(Notice(code="further_gain_measured", message=words))
    return tuple(1.0 if gain is None else gain for gain in measured), notices


def measure_gains(
    track: Track,
    window: Window,
    modes: Sequence[Mode],
    amplitudes_m: Sequence[float | None],
    *,
    length_m: float,
    radius_m: float,
) -> tuple[float | None, ...]:
    """Return the gain of each further mode: its amplitude in the decay over that of a point on a string.

    Parameters
    ----------
    track : Track
        In metres, with the tool: the move and the free vibration after it.
    window : Window
        The free vibration.
    modes : sequence of Mode
        The pendulum's first.
    amplitudes_m : sequence of (float or None)
        Of each further mode, the root of twice its mean square over the window.
    length_m, radius_m : float
        Of the pendulum.

    Returns
    -------
    tuple of (float or None)
        None where no move is seen, or it hardly excites that mode: the decay alone does not tell.

    Notes
    -----
    The pendulum is driven by the tool's seen velocity, and carries the further bodies with a gain of 1; their motion in
    the window is split into the modes' decays, as the measured one was. Only the gain's size is found, not its sign.
    """
    none: tuple[float | None, ...] = (None,) * len(amplitudes_m)
    if track.length_unit != "m" or track.tcp is None or not amplitudes_m:
        return none
    clean = clean_track(track)
    moved = None if clean.tcp is None else find_last_move(clean, window)
    if moved is None:
        return none
    time, bodies, hardest = _drive(clean, moved, window, modes, length_m=length_m, radius_m=radius_m)
    inside = time >= window.start_s
    gains = []
    for index, (mode, amplitude, body) in enumerate(zip(modes[1:], amplitudes_m, bodies, strict=True), start=1):
        excited = _amplitude_of(time[inside] - window.start_s, body[inside], modes, index)
        most = hardest / mode.angular_frequency_rad_s
        gains.append(None if amplitude is None or not excited > LEAST_SHARE * most else amplitude / excited)
    return tuple(gains)


def _drive(
    clean: CleanTrack, moved: Window, window: Window, modes: Sequence[Mode], *, length_m: float, radius_m: float
) -> tuple[FloatArray, list[FloatArray], float]:
    """Return times, each further body's place beside the tag for a gain of 1, and ∫ |X''| dt of the tool."""
    first, *others = modes
    spread = PayloadSpread(
        mode=first,
        frequency_percent=1.0,
        damping_low=first.damping_ratio,
        damping_high=first.damping_ratio,
        length_m=length_m,
        tag_radius_m=radius_m,
        further=tuple(FurtherMode(mode=mode, frequency_percent=1.0) for mode in others),
    )
    payloads = make_payloads(spread, np.array([first.natural_frequency_hz]), np.array([first.damping_ratio]))
    count = int(np.ceil((window.end_s - moved.start_s) / STEP_S))
    halves = np.linspace(moved.start_s, window.end_s, 2 * count + 1)
    velocity = seen_velocity(clean, moved)(halves)
    swing = simulate_swing(payloads, halves[::2], velocity[..., None])
    return halves[::2], [place[:, 0] for place, _ in swing.carried], float(np.abs(np.diff(velocity[:, 0])).sum())


def _amplitude_of(time_s: FloatArray, place_m: FloatArray, modes: Sequence[Mode], index: int) -> float:
    """Return the root of twice the mean square of one mode's share in a decay."""
    columns = [np.ones_like(time_s)]
    for mode in modes:
        omega = mode.angular_frequency_rad_s
        decay = np.exp(-mode.damping_ratio * omega * time_s)
        phase = omega * np.sqrt(1 - mode.damping_ratio**2) * time_s
        columns += [decay * np.cos(phase), decay * np.sin(phase)]
    table = np.column_stack(columns)
    found = np.linalg.lstsq(table, place_m, rcond=None)[0]
    own = slice(1 + 2 * index, 3 + 2 * index)
    return float(np.sqrt(2 * np.mean((table[:, own] @ found[own]) ** 2)))
