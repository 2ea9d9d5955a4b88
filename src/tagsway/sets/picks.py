"""One clip, many picks: each move of the tool, with the rest after it, is a measurement."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.filters.moves import find_moves
from tagsway.model import CleanTagTrack, CleanTrack, Settings, TagTrack, Track, Window
from tagsway.pipeline import Measurement, identify
from tagsway.pipeline.log import with_log
from tagsway.pipeline.recording import Recording, read_recording
from tagsway.sets.manifest import as_text
from tagsway.store.steps import StepStore
from tagsway.store.tracks import write_track

LEAST_RANGE = 0.05
"""Share of the tool's whole range below which a motion is no move."""

LEAD_S = 0.1
"""Of the rest before a move that belongs to it: what the tool's place was."""

STEADY = 0.1
"""Share of a move's largest acceleration by which it may vary where the product swings freely."""

LEAST_SAMPLES = 20
"""Of a stretch that is worth a look."""


def identify_picks(
    file: Path, settings: Settings, *, steps: StepStore, decoder_threads: int = 1
) -> tuple[Measurement, ...]:
    """Identify the payload in each move of a clip.

    Parameters
    ----------
    file : Path
        A video or a track in which the tool moves again and again.
    settings : Settings
        What the user said about it, without a window: it is found in each move.
    steps : StepStore
        Where the sightings are kept.
    decoder_threads : int
        Of the decoder.

    Returns
    -------
    tuple of Measurement
        One a move, in their order. Where the rest after a move is too short to tell, the longest part of the move in
        which the tool's acceleration is steady: there the product swings freely about a rest that is merely shifted.

    Raises
    ------
    InputError
        Where the file cannot be used.
    NotIdentifiableError
        Where the tool never moves.
    """
    recording = read_recording(file, settings, steps=steps, decoder_threads=decoder_threads)
    if settings.log is not None:
        recording = with_log(recording, Path(settings.log))
    track = recording.track
    clean = clean_track(track)
    moves = _moves_of(track, clean)
    if not moves:
        raise NotIdentifiableError(f"{file}: the tool does not move, so there are no picks", code="no_move")
    ends = [move.start_s for move in moves[1:]] + [float(track.time_s[-1]) + 1.0]
    starts = [-np.inf, *(move.end_s for move in moves[:-1])]
    found = []
    for move, before, end in zip(moves, starts, ends, strict=True):
        piece = _cut(track, max(move.start_s - LEAD_S, before), end)
        found.append(_identify_pick(piece, move, clean.tcp, file, settings, recording))
    return tuple(found)


def settings_of_track(settings: Settings) -> Settings:
    """Return the settings of a film without what its track holds already: camera, log, rate, and where up is."""
    done = {"camera": None, "reference_id": None, "log": None, "columns": None, "fps_hz": None, "up": "image"}
    return replace(settings, **done)  # type: ignore[arg-type]


def _moves_of(track: Track, clean: CleanTrack) -> tuple[Window, ...]:
    if clean.tcp is None or not np.isfinite(clean.tcp.position).any():
        return ()
    travel = float(np.hypot(*(np.nanmax(clean.tcp.position, axis=0) - np.nanmin(clean.tcp.position, axis=0))))
    return find_moves(track.time_s, clean.tcp.position, clean.tcp.velocity, least=LEAST_RANGE * travel)


def _identify_pick(
    piece: Track, move: Window, tool: CleanTagTrack | None, file: Path, settings: Settings, recording: Recording
) -> Measurement:
    own = settings_of_track(settings)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "track.csv"
        write_track(path, piece, None)
        measured = identify(path, own)
        if measured.not_determined is not None and (stretch := _steady(recording.track, move, tool)) is not None:
            inside = identify(path, replace(own, window=stretch))
            measured = measured if inside.not_determined is not None else inside
        reason = measured.not_determined
    source = replace(measured.result.source, file=as_text(file.name), sha256=recording.sha256, settings=settings)
    result = replace(
        measured.result,
        source=source,
        video=recording.video,
        frame=recording.frame,
        warnings=(*recording.notices, *measured.result.warnings),
    )
    told = None if reason is None else f"{file}, move at {move.start_s:.2f} s{reason.removeprefix(str(path))}"
    return replace(measured, result=result, not_determined=told)


def _steady(track: Track, move: Window, tool: CleanTagTrack | None) -> Window | None:
    """Return the longest part of a move in which the tool's acceleration hardly changes."""
    if tool is None:
        return None
    within = np.flatnonzero((track.time_s >= move.start_s) & (track.time_s <= move.end_s))
    acceleration = tool.acceleration[within]
    if len(within) < LEAST_SAMPLES or not np.isfinite(acceleration).all():
        return None
    band = STEADY * float(np.max(np.hypot(*acceleration.T)))
    first, best = 0, (0, 0)
    for last in range(len(within)):
        while np.max(np.ptp(acceleration[first : last + 1], axis=0)) > 2 * band:
            first += 1
        best = max(best, (last - first, first))
    length, first = best
    if length < LEAST_SAMPLES:
        return None
    return Window(start_s=float(track.time_s[within[first]]), end_s=float(track.time_s[within[first + length]]))


def _cut(track: Track, start_s: float, end_s: float) -> Track:
    part = (track.time_s >= start_s) & (track.time_s < end_s)

    def cut(tag: TagTrack | None) -> TagTrack | None:
        if tag is None:
            return None
        return replace(
            tag,
            position=tag.position[part],
            position_std=tag.position_std[part],
            angle_rad=tag.angle_rad[part],
            angle_std_rad=tag.angle_std_rad[part],
        )

    pcp = cut(track.pcp)
    assert pcp is not None
    return replace(
        track, frame=track.frame[part], time_s=track.time_s[part], pcp=pcp, tcp=cut(track.tcp), reference=None
    )
