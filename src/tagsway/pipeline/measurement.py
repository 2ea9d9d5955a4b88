"""From a track to all that it tells."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tagsway import __version__
from tagsway.diagnose import diagnose
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.filters import clean_track
from tagsway.indicators import align_move, find_watched, measure_indicators
from tagsway.modal import ModalFit, identify_modes
from tagsway.modal.events import describe_events, find_events
from tagsway.modal.excitation import measure_excitation
from tagsway.modal.window import FreeVibration, find_free_vibration
from tagsway.model import (
    AlignedMove,
    CleanTrack,
    Creator,
    Curves,
    DesignMode,
    Event,
    FloatArray,
    Indicators,
    Move,
    Notice,
    PendulumEstimate,
    Progress,
    ResidualCurve,
    Result,
    Settings,
    Shaper,
    Sightings,
    Source,
    Spread,
    Track,
    TrackCurve,
    Window,
)
from tagsway.model.curves import AmplitudeCurve, BackboneCurve
from tagsway.pendulum import PendulumFit, fit_pendulum
from tagsway.pipeline.log import with_log
from tagsway.pipeline.other_mass import add_mass, read_other_mass
from tagsway.pipeline.recording import DECODER_THREADS, Recording, describe_tags, read_recording
from tagsway.pipeline.shaping import PlannedMove, plan_shaped_move
from tagsway.shapers import SHAPER_TYPES, design_shaper, residual_curve
from tagsway.store.documents import to_document
from tagsway.store.steps import StepStore, track_digest
from tagsway.trajectories import plan_move
from tagsway.video.opening import name_film

HARMLESS = frozenset(
    {
        "acceleration_record",
        "angle_record",
        "camera_from_motion",
        "further_mode",
        "linear_decay_rejected",
        "several_decays",
        "tool_from_log",
        "unit_assumed",
        "capture_rate_from_metadata",
        "damping_depends_on_amplitude",
        "fast_for_its_radius",
        "frequency_depends_on_amplitude",
        "no_mass",
        "no_move",
        "no_spring",
        "no_tag_size",
        "pendulum_indicative",
        "pendulum_not_determined",
        "pendulum_record_shortened",
        "plain_scale",
        "point_mass_equivalent",
        "prior_stated",
        "single_measurement",
        "slow_for_its_radius",
        "sways_across",
        "two_masses",
    }
)
"""Codes of warnings that say what a measurement cannot tell, not that something was wrong with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """Everything that one file told.

    Parameters
    ----------
    result : Result
        What result.json holds.
    track : Track
        Of the tags, raw.
    clean : CleanTrack
        The same without spikes.
    curves : Curves
        What the figures draw.
    sightings : Sightings or None
        The tags in the video's own pixels; None for a table.
    planned : PlannedMove or None
        The shaped move, where one was asked for.
    not_determined : str or None
        Why the data do not determine what was asked; None where they do.
    """

    result: Result
    track: Track
    clean: CleanTrack
    curves: Curves
    sightings: Sightings | None
    planned: PlannedMove | None
    not_determined: str | None

    @property
    def has_page(self) -> bool:
        """Whether there is something to look at: what was determined, or an event that is why nothing was."""
        return self.not_determined is None or bool(self.result.events)


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
    clean, events = clean_track(recording.track), find_events(recording.track)
    try:
        free, fit = _find_mode(recording.track, clean, events, settings)
    except NotIdentifiableError as reason:
        if reason.code == "pcp_not_seen" and recording.video is not None:
            reason = NotIdentifiableError(f"{reason}; {describe_tags(file)}", code=reason.code)
        return _undetermined(file, settings, recording, clean, events, reason)
    pendulum = steps.get(
        "pendulum",
        PendulumFit,
        lambda: fit_pendulum(
            recording.track,
            free.window,
            fit.estimate,
            mass_kg=settings.mass_kg,
            point_mass=settings.point_mass,
            length_m=settings.length_m,
            rng=np.random.default_rng(0),
        ),
        depends_on=[
            track_digest(recording.track),
            to_document(free.window),
            to_document(fit.estimate),
            settings.mass_kg,
            settings.sway_axis,
            settings.point_mass,
            settings.length_m,
        ],
    )
    if other is not None:
        pendulum = add_mass(pendulum, fit.estimate, other)
    shaper = _design(settings, fit, name_film(file))
    planned = None if move is None or shaper is None else plan_shaped_move(move, shaper)
    return _assemble(
        _empty_result(file, settings, recording), recording, clean, events, free, fit, pendulum, planned, shaper
    )


def aligned_move(measurement: Measurement) -> AlignedMove | None:
    """Return the move that a measurement's indicators are of, from its start on; None where it has none."""
    return align_result(measurement.result, measurement.track, measurement.clean)


def align_result(result: Result, track: Track, clean: CleanTrack) -> AlignedMove | None:
    """Return the move that a result's indicators are of, cut from its track."""
    window = result.window or find_watched(clean, events=result.events)
    return None if result.indicators is None or window is None else align_move(track, clean, window)


def _assemble(
    empty: Result,
    recording: Recording,
    clean: CleanTrack,
    events: tuple[Event, ...],
    free: FreeVibration,
    fit: ModalFit,
    pendulum: PendulumFit,
    planned: PlannedMove | None,
    shaper: Shaper | None,
) -> Measurement:
    """Return the measurement that all stages together make."""
    modal, window, settings = fit.estimate, free.window, empty.source.settings
    indicators = measure_indicators(recording.track, clean, window)
    frequency = modal.operating_frequency_hz or modal.natural_frequency_hz
    excited = None
    if frequency is not None:
        excited = measure_excitation(recording.track, clean, window, frequency_hz=frequency)
    notices = (
        *recording.notices,
        *describe_events(events),
        *free.notices,
        *fit.notices,
        *pendulum.notices,
        *diagnose(modal, pendulum.estimate, recording.video),
        *_notices_of_gaps(recording.track, pendulum.estimate, indicators, settings),
        *_shaper_notices(shaper, settings),
        *(planned.notices if planned else ()),
    )
    result = replace(
        empty,
        status="ok" if all(notice.code in HARMLESS for notice in notices) else "degraded",
        window_s=(window.start_s, window.end_s),
        modal=modal,
        pendulum=pendulum.estimate,
        indicators=indicators,
        events=events,
        estimator_details=fit.details,
        excitation=None if excited is None else excited.excitation,
        shaper=shaper,
        warnings=notices,
    )
    curves = Curves(
        track=_track_curve(recording.track, clean),
        decay=fit.decay,
        spectrum=fit.spectrum,
        pendulum=pendulum.curve,
        ridge=pendulum.ridge,
        excitation=None if excited is None else excited.curve,
        backbone=_backbone_curve(fit),
        residual=_residual_curve(shaper),
        trajectory=planned.curve if planned else None,
    )
    return Measurement(
        result=result,
        track=recording.track,
        clean=clean,
        curves=curves,
        sightings=recording.sightings,
        planned=planned,
        not_determined=None,
    )


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


def _notices_of_gaps(
    track: Track, pendulum: PendulumEstimate, indicators: Indicators | None, settings: Settings
) -> tuple[Notice, ...]:
    """Say why a number is null although nothing went wrong."""
    gaps = []
    if settings.mass_kg is None and pendulum.determined:
        gaps.append(Notice(code="no_mass", message="without --mass k/J and b/J are known, k and b are not"))
    if indicators is None and track.tcp is not None:
        gaps.append(Notice(code="no_move", message="the tool did not move: there is no move to judge"))
    return tuple(gaps)


def _shaper_notices(shaper: Shaper | None, settings: Settings) -> tuple[Notice, ...]:
    if shaper is None or settings.frequency_spread_percent is not None:
        return ()
    return (
        Notice(
            code="single_measurement",
            message="one video tells its own error, not how the payload varies from pick to pick: film repeats, or "
            "state --frequency-spread, to know what the shaper leaves on most of them",
        ),
    )


def _undetermined(
    file: Path,
    settings: Settings,
    recording: Recording,
    clean: CleanTrack,
    events: tuple[Event, ...],
    reason: NotIdentifiableError,
) -> Measurement:
    watched = find_watched(clean, events=events)
    result = replace(
        _empty_result(file, settings, recording),
        # A product that a shaped move leaves at rest does not swing: how the move ended is known all the same.
        indicators=None if watched is None else measure_indicators(recording.track, clean, watched),
        events=events,
        warnings=(*recording.notices, *describe_events(events), Notice(code=reason.code, message=str(reason))),
    )
    return Measurement(
        result=result,
        track=recording.track,
        clean=clean,
        curves=Curves(track=_track_curve(recording.track, clean)),
        sightings=recording.sightings,
        planned=None,
        not_determined=f"{file}: {reason}",
    )


def _empty_result(file: Path, settings: Settings, recording: Recording) -> Result:
    return Result(
        status="not_determined",
        created_by=Creator(name="tagsway", version=__version__),
        source=Source(file=name_film(file), sha256=recording.sha256, settings=settings),
        video=recording.video,
        frame=recording.frame,
        tags=recording.tags,
        window_s=None,
        modal=None,
        pendulum=None,
        indicators=None,
        shaper=None,
        warnings=(),
        controller_log=recording.controller_log,
    )


def _track_curve(track: Track, clean: CleanTrack) -> TrackCurve:
    unseen: FloatArray = np.full_like(track.pcp.position, np.nan)
    return TrackCurve(
        time_s=track.time_s,
        pcp=track.pcp.position,
        pcp_clean=clean.pcp.position,
        pcp_acceleration=clean.pcp.acceleration,
        tcp=unseen if track.tcp is None else track.tcp.position,
        tcp_clean=unseen if clean.tcp is None else clean.tcp.position,
        tcp_acceleration=unseen if clean.tcp is None else clean.tcp.acceleration,
    )


def _backbone_curve(fit: ModalFit) -> BackboneCurve | None:
    if len(fit.estimate.backbone) < 2:
        return None
    return BackboneCurve(fit=AmplitudeCurve.of(fit.estimate.backbone), pieces=AmplitudeCurve.of(fit.pieces))


def _residual_curve(shaper: Shaper | None) -> ResidualCurve | None:
    if shaper is None:
        return None
    mode = shaper.modes[0]
    return residual_curve(shaper, mode.frequency_hz * np.linspace(0.5, 1.5, 401), mode.damping_ratio)
