"""What the stages found, put together: the result, its warnings, and the curves that the figures draw."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tagsway import __version__
from tagsway.diagnose import diagnose
from tagsway.errors import NotIdentifiableError
from tagsway.indicators import align_move, find_watched, measure_indicators
from tagsway.modal import ModalFit
from tagsway.modal.events import describe_events
from tagsway.modal.excitation import ExcitationFit, measure_excitation
from tagsway.modal.window import FreeVibration
from tagsway.model import (
    AlignedMove,
    CleanTrack,
    Creator,
    Curves,
    Event,
    FloatArray,
    Indicators,
    ModalEstimate,
    Notice,
    PendulumEstimate,
    ResidualCurve,
    Result,
    Settings,
    Shaper,
    Sightings,
    Source,
    Track,
    TrackCurve,
    Window,
)
from tagsway.model.curves import AmplitudeCurve, BackboneCurve
from tagsway.pendulum import PendulumFit
from tagsway.pipeline.recording import Recording
from tagsway.pipeline.shaping import PlannedMove
from tagsway.shapers import residual_curve
from tagsway.video.opening import name_film


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


def aligned_move(measurement: Measurement) -> AlignedMove | None:
    """Return the move that a measurement's indicators are of, from its start on; None where it has none."""
    return align_result(measurement.result, measurement.track, measurement.clean)


def align_result(result: Result, track: Track, clean: CleanTrack) -> AlignedMove | None:
    """Return the move that a result's indicators are of, cut from its track."""
    window = result.window or find_watched(clean, events=result.events)
    return None if result.indicators is None or window is None else align_move(track, clean, window)


def assemble(
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
    """Return the measurement that all stages together make, from an empty result."""
    modal, window, settings = fit.estimate, free.window, empty.source.settings
    indicators = measure_indicators(recording.track, clean, window)
    excited = _find_excitation(recording.track, clean, window, modal)
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
        status="ok" if all(notice.is_remark for notice in notices) else "degraded",
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


def _find_excitation(track: Track, clean: CleanTrack, window: Window, modal: ModalEstimate) -> ExcitationFit | None:
    """Return how much of the move falls on the payload's frequency; None where that is not known."""
    frequency = modal.operating_frequency_hz or modal.natural_frequency_hz
    return None if frequency is None else measure_excitation(track, clean, window, frequency_hz=frequency)


def assemble_undetermined(
    file: Path,
    empty: Result,
    recording: Recording,
    clean: CleanTrack,
    events: tuple[Event, ...],
    reason: NotIdentifiableError,
) -> Measurement:
    """Return the measurement of a file that does not tell a mode: its track, its move, and why."""
    watched = find_watched(clean, events=events)
    result = replace(
        empty,
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


def empty_result(file: Path, settings: Settings, recording: Recording) -> Result:
    """Return the result of a file of which nothing but its recording is known yet."""
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


def _notices_of_gaps(
    track: Track, pendulum: PendulumEstimate, indicators: Indicators | None, settings: Settings
) -> tuple[Notice, ...]:
    """Say why a number is null although nothing went wrong."""
    gaps = []
    if settings.mass_kg is None and pendulum.determined:
        gaps.append(Notice(code="no_mass", message="without --mass k/J and b/J are known, k and b are not"))
    # Without a scale no move is looked for: that is said where the scale is.
    if indicators is None and track.tcp is not None and track.length_unit == "m":
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
