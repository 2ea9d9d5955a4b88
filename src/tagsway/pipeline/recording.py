"""From a file to a track: a video's tags, or a table that somebody wrote."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from tagsway.camera import find_view, straighten_sightings, undistort_sightings
from tagsway.errors import InputError
from tagsway.model import (
    CoordinateFrame,
    Frame,
    GreyArray,
    LogAgreement,
    Notice,
    Progress,
    Settings,
    Sightings,
    TagsSummary,
    TagSummary,
    TagTrack,
    Track,
    VideoInfo,
)
from tagsway.store.cameras import read_camera
from tagsway.store.steps import StepStore, file_sha256
from tagsway.store.tracks import quantise, read_source
from tagsway.tags.families import tag_pattern
from tagsway.tags.follow import follow_tags
from tagsway.tags.others import find_other_tags
from tagsway.tracks import join_tags
from tagsway.tracks.repeats import drop_repeats
from tagsway.tracks.shutter import correct_shutter
from tagsway.video.opening import is_pattern, list_files
from tagsway.video.reading import read_clock, read_frames

TABLES = frozenset({".csv", ".tsv", ".txt", ".tab", ".dat", ".xml", ".nc", ".h5", ".kva", ".trk"})
"""Endings of a track; anything else is taken for a video."""

DECODER_THREADS = min(max(os.cpu_count() or 1, 2), 4)
"""More than four decode faster than the tracker follows."""
REPORT_EVERY = 20
LOOK_FRAMES = 300
"""How far into a video other tags are looked for when the wanted ones are not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A track, and where it came from.

    Parameters
    ----------
    sha256 : str
        Of the file's content.
    track : Track
        Of the tags; the PCP's is all NaN where it was never seen.
    frame : CoordinateFrame
        What the track's axes mean.
    tags : TagsSummary
        How well each tag was seen.
    video : VideoInfo or None
        None for a table.
    sightings : Sightings or None
        The tags in the video's own pixels; None for a table.
    notices : tuple of Notice
        What to know about it.
    controller_log : LogAgreement or None
        How the log that moves the tool agrees with the tool's tag.
    """

    sha256: str
    track: Track
    frame: CoordinateFrame
    tags: TagsSummary
    video: VideoInfo | None
    sightings: Sightings | None
    notices: tuple[Notice, ...]
    controller_log: LogAgreement | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is kept of a video once it was tracked."""

    sightings: Sightings
    notices: tuple[Notice, ...]
    turns: int
    """Quarter turns, counter-clockwise, from the sensor's image to the upright one."""


def read_recording(
    file: Path,
    settings: Settings,
    *,
    steps: StepStore,
    progress: Progress | None = None,
    decoder_threads: int = DECODER_THREADS,
) -> Recording:
    """Read a video or a table.

    Parameters
    ----------
    file : Path
        A video, numbered images (a pattern, or their folder), or a table (`.csv`, `.tsv`, `.txt`).
    settings : Settings
        What the user said about it.
    steps : StepStore
        Where the sightings of a video are kept.
    progress : callable, optional
        Called now and then while a video is read.
    decoder_threads : int
        Of the decoder.

    Returns
    -------
    Recording
        Its track.

    Raises
    ------
    InputError
        Where the file cannot be used, or shows none of the wanted tags.
    """
    check_file(file)
    if file.suffix.lower() in TABLES:
        return _read_table(file, settings)
    if settings.columns is not None:
        raise InputError(f"--columns names the columns of a table, and {file} is taken for a video: leave it out")
    camera = None if settings.camera is None else read_camera(Path(settings.camera))
    digest = file_sha256(*list_files(file))
    film = steps.get(
        "film",
        Film,
        lambda: track_video(file, settings, progress=progress, decoder_threads=decoder_threads),
        depends_on=[digest, settings.family, settings.fps_hz, settings.tcp_id, settings.pcp_id, settings.reference_id],
    )
    if not film.sightings.tags:
        raise InputError(_what_was_seen(file, settings))
    sightings = film.sightings
    if camera is not None:
        sightings = correct_shutter(sightings, readout_s=camera.readout_s, turns=film.turns)
        sightings = undistort_sightings(sightings, camera)
    view, view_notices = find_view(sightings, settings, camera=camera)
    if view is not None:
        sightings = straighten_sightings(sightings, view)
    track, frame, notices = join_tags(sightings, settings, camera, view=view)
    return Recording(
        sha256=digest,
        track=quantise(track),
        frame=frame,
        tags=_summarise_tags(film.sightings, track, settings),
        video=film.sightings.video,
        sightings=film.sightings,
        notices=(*film.notices, *view_notices, *notices),
    )


def track_video(
    file: Path, settings: Settings, *, progress: Progress | None = None, decoder_threads: int = DECODER_THREADS
) -> Film:
    """Track the wanted tags through a whole video, decoding beside the tracking.

    Parameters
    ----------
    file : Path
        The video.
    settings : Settings
        Family and ids of the tags, and the capture rate.
    progress : callable, optional
        Called now and then with (frames done, frames in all).
    decoder_threads : int
        Of the decoder, beside the one that tracks.

    Returns
    -------
    Film
        Without any tag where none of the wanted ones was seen.
    """
    wanted = [settings.tcp_id, settings.pcp_id, *([] if settings.reference_id is None else [settings.reference_id])]
    for tag_id in wanted:
        tag_pattern(settings.family, tag_id)
    clock = read_clock(file, fps_hz=settings.fps_hz)
    with read_frames(file, clock, decoder_threads=decoder_threads, full_range=False) as reader:
        frames = _reporting(reader, len(clock.stamps), progress)
        followed = follow_tags(frames, family=settings.family, tag_ids=wanted)
    sightings = Sightings(
        video=reader.info,
        frame=followed.frame,
        time_s=followed.time_s,
        tags=followed.tags,
        detector_calls=followed.detector_calls,
    )
    sightings, repeats = drop_repeats(sightings, reader.repeated[followed.frame])
    return Film(sightings=sightings, notices=(*reader.notices, *repeats, *followed.notices), turns=reader.turns)


def _reporting(frames: Iterable[Frame], total: int, progress: Progress | None) -> Iterator[Frame]:
    for done, frame in enumerate(frames, start=1):
        yield frame
        del frame
        if progress is not None and (done % REPORT_EVERY == 0 or done == total):
            progress(done, total)


def check_file(file: Path) -> None:
    """Raise an InputError where a file is missing or empty, or where there are no images of a sequence."""
    if file.is_dir() or is_pattern(file):
        list_files(file)
        return
    if not file.exists():
        raise InputError(f"{file}: no such file; give a video or a track as CSV")
    if file.stat().st_size == 0:
        raise InputError(f"{file} is empty; give a video or a track as CSV")


def _read_table(file: Path, settings: Settings) -> Recording:
    for name, value in {"--camera": settings.camera, "--reference-id": settings.reference_id}.items():
        if value is not None:
            raise InputError(f"{name} says something of a video, and {file} is a table: leave it out")
    source = read_source(file, columns=settings.columns, fps_hz=settings.fps_hz)
    track = source.track
    return Recording(
        sha256=file_sha256(file),
        track=track,
        frame=CoordinateFrame(origin="as in the file", axes="x right, z up, y away from the camera", up_source="file"),
        tags=_summarise_columns(track),
        video=None,
        sightings=None,
        notices=source.notices,
    )


def describe_tags(file: Path) -> str:
    """Return in words which tags a video shows, of whatever family, be they mirrored or in negative."""
    greys = _look(file)
    others, how = find_other_tags(greys), ""
    if not others:
        others = find_other_tags([*(grey[:, ::-1] for grey in greys), *(255 - grey for grey in greys)])
        how = " mirrored, or white on black, as no detector reads them: flip or invert the film, or print the tags anew"
    if not others:
        return "it shows no tag of any known family"
    return "it shows " + ", ".join(f"{family} {tag_id}" for family, tag_id in others) + how


def _what_was_seen(file: Path, settings: Settings) -> str:
    wanted = f"{settings.family} {settings.tcp_id} (TCP) and {settings.pcp_id} (PCP)"
    return f"{file} does not show {wanted} (--family, --tcp-id, --pcp-id); {describe_tags(file)}"


def _summarise_tags(sightings: Sightings, track: Track, settings: Settings) -> TagsSummary:
    def summary(tag_id: int | None, tag: TagTrack | None) -> TagSummary | None:
        seen = None if tag_id is None else sightings.tag(tag_id)
        if tag_id is None:
            return None
        share = 0.0 if seen is None else float(np.mean(seen.seen))
        return TagSummary(id=tag_id, detected=share, mm_per_px=None if tag is None else tag.scale_mm_per_px)

    return TagsSummary(
        tcp=summary(settings.tcp_id, track.tcp),
        pcp=summary(settings.pcp_id, track.pcp),
        reference=summary(settings.reference_id, track.reference),
    )


def _summarise_columns(track: Track) -> TagsSummary:
    def summary(tag: TagTrack | None) -> TagSummary | None:
        if tag is None:
            return None
        return TagSummary(id=None, detected=float(np.mean(np.isfinite(tag.position[:, 0]))), mm_per_px=None)

    return TagsSummary(tcp=summary(track.tcp), pcp=summary(track.pcp), reference=summary(track.reference))


def _look(file: Path) -> list[GreyArray]:
    """Return a handful of images from the beginning of a video."""
    with read_frames(file, read_clock(file, fps_hz=1.0)) as frames:
        return [frame.grey.copy() for frame in islice(frames, 0, LOOK_FRAMES, LOOK_FRAMES // 5)]
