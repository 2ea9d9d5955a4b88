"""From a track to all that it tells: the order of the stages."""

from pathlib import Path

import numpy as np

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.modal import ModalFit, identify_modes
from tagsway.modal.events import find_events
from tagsway.modal.window import FreeVibration, find_free_vibration
from tagsway.model import (
    CleanTrack,
    DesignMode,
    Event,
    ModalEstimate,
    Move,
    Progress,
    Settings,
    Shaper,
    Spread,
    Track,
    Window,
)
from tagsway.pendulum import PendulumFit, fit_pendulum
from tagsway.pipeline.assembling import Measurement, assemble, assemble_undetermined, empty_result
from tagsway.pipeline.log import with_log
from tagsway.pipeline.other_mass import add_mass, read_other_mass
from tagsway.pipeline.recording import DECODER_THREADS, describe_tags, read_recording
from tagsway.pipeline.shaping import plan_shaped_move
from tagsway.shapers import SHAPER_TYPES, design_shaper
from tagsway.store.documents import to_document
from tagsway.store.steps import StepStore, track_digest
from tagsway.tracks.arrangement import ARRANGEMENT_CODES
from tagsway.trajectories import plan_move
from tagsway.video.opening import name_film


def identify(
    file: Path,
    settings: Settings,
    *,
    move: Move | None = None,
    steps: StepStore | None = None,
    progress: Progress | None = None,
    decoder_threads: int = DECODER_THREADS,
) -> Measurement:
    """Identify a payload from a video or a track, and design what leaves it at rest.

    Parameters
    ----------
    file : Path
        A video, or a table with a time and positions.
    settings : Settings
        What the user said about it.
    move : Move, optional
        The move to be shaped.
    steps : StepStore, optional
        Where finished steps are kept; by default nowhere.
    progress : callable, optional
        Called with (frames done, frames in all) while a video is read.
    decoder_threads : int
        Of the decoder, beside the thread that tracks.

    Returns
    -------
    Measurement
        With a status of "not_determined" where the data are sound and do not tell; it then says why.

    Raises
    ------
    InputError
        Where the file, an option or the move cannot be used.
    """
    if settings.shaper not in SHAPER_TYPES:
        raise InputError(f"--shaper is {settings.shaper!r}: expected one of {', '.join(SHAPER_TYPES)}")
    if move is not None:
        plan_move(move)  # a move that cannot be is refused before the work
    steps = steps or StepStore()
    other = None if settings.other is None else read_other_mass(Path(settings.other))
    recording = read_recording(file, settings, steps=steps, progress=progress, decoder_threads=decoder_threads)
    if settings.log is not None:
        recording = with_log(recording, Path(settings.log), None if move is None else move.robot)
    empty = empty_result(file, settings, recording)
    clean, events = clean_track(recording.track), find_events(recording.track)
    try:
        free, fit = _find_mode(recording.track, clean, events, settings)
    except NotIdentifiableError as reason:
        if reason.code == "pcp_not_seen" and recording.video is not None:
            reason = NotIdentifiableError(f"{reason}; {describe_tags(file)}", code=reason.code)
        for hint in (notice for notice in recording.notices if notice.code in ARRANGEMENT_CODES):
            reason = NotIdentifiableError(f"{reason}; {hint.message}", code=reason.code)
        return assemble_undetermined(file, empty, recording, clean, events, reason)
    pendulum = _fit_pendulum(recording.track, free.window, fit.estimate, settings, steps)
    if other is not None:
        pendulum = add_mass(pendulum, fit.estimate, other)
    shaper = _design(settings, fit, name_film(file))
    planned = None if move is None or shaper is None else plan_shaped_move(move, shaper)
    return assemble(empty, recording, clean, events, free, fit, pendulum, planned, shaper)


def _find_mode(
    track: Track, clean: CleanTrack, events: tuple[Event, ...], settings: Settings
) -> tuple[FreeVibration, ModalFit]:
    if not np.isfinite(track.pcp.position).any():
        raise NotIdentifiableError(
            "the product's tag was never seen; --pcp-id says which one it is", code="pcp_not_seen"
        )
    free = (
        find_free_vibration(track, clean, events=events) if settings.window is None else _use(settings.window, events)
    )
    return free, identify_modes(track, free.window, sway_axis=settings.sway_axis)


def _use(window: Window, events: tuple[Event, ...]) -> FreeVibration:
    """Return the window that the user states, unless the product is no longer held in it."""
    lost = next(
        (event for event in events if event.ends_grip and window.start_s < event.time_s.value < window.end_s), None
    )
    if lost is not None:
        raise InputError(
            f"--window ends at {window.end_s:g} s, and the product comes off at {lost.time_s.value:.3f} s: a fall is "
            "no free vibration; end it before"
        )
    return FreeVibration(window=window, notices=())


def _fit_pendulum(
    track: Track, window: Window, modal: ModalEstimate, settings: Settings, steps: StepStore
) -> PendulumFit:
    """Fit the pendulum, or take the fit from the steps that are kept."""
    return steps.get(
        "pendulum",
        PendulumFit,
        lambda: fit_pendulum(
            track,
            window,
            modal,
            mass_kg=settings.mass_kg,
            point_mass=settings.point_mass,
            length_m=settings.length_m,
            nonnegative_stiffness=settings.nonnegative_stiffness,
            rng=np.random.default_rng(0),
        ),
        depends_on=[
            track_digest(track),
            to_document(window),
            to_document(modal),
            settings.mass_kg,
            settings.sway_axis,
            settings.point_mass,
            settings.length_m,
            settings.nonnegative_stiffness,
        ],
    )


def _design(settings: Settings, fit: ModalFit, source: str) -> Shaper | None:
    """Design for the operating amplitude: at a large swing the payload is slower, and drag damps it more."""
    modal = fit.estimate
    frequency = modal.operating_frequency_hz or modal.natural_frequency_hz
    damping = modal.operating_damping_ratio
    if frequency is None:
        return None
    mode = DesignMode(
        frequency_hz=frequency.value,
        damping_ratio=0.0 if damping is None else max(damping.value, 0.0),
        amplitude_m=None if modal.amplitude_m is None else modal.amplitude_m.value,
    )
    spread = None
    if settings.frequency_spread_percent is not None:
        percent = settings.frequency_spread_percent
        spread = Spread(source="--frequency-spread", natural_frequency_std_percent=percent, n=None)
    return design_shaper(settings.shaper, mode, spread=spread, source=source)
