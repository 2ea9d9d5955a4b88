"""What a worker does with a file of a set, on this machine or another."""

import json
import os
import socket
import time
import traceback
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2

from tagsway.errors import TagswayError
from tagsway.model import AlignedMove, Estimate, Result
from tagsway.pipeline import Measurement, aligned_move, identify
from tagsway.report.page import render_page
from tagsway.sets.jobs import FILE, Job, Outcome, has_result, page_ending, result_key
from tagsway.sets.manifest import Item
from tagsway.sets.moves import to_plain_move
from tagsway.sets.picks import identify_picks
from tagsway.sets.remote import local_copy
from tagsway.store.documents import result_document
from tagsway.store.steps import StepStore, file_sha256
from tagsway.video.opening import list_files

DECODER_THREADS = 1

MOST_DRAWN = 400
"""Points of a kept decay."""


def measure_file(job: Job) -> Outcome:
    """Measure one file of a set; whatever is wrong with it is part of the outcome.

    Parameters
    ----------
    job : Job
        The file.

    Returns
    -------
    Outcome
        Without lines where a result of the same content and settings is kept already: then it is only drawn.
    """
    cv2.setNumThreads(1)  # a worker holds one core
    start, cpu = time.perf_counter(), time.process_time()
    try:
        outcome = _measure(job)
    except TagswayError as fault:
        outcome = Outcome(error=_one_line(fault), failed=True)
    except Exception as fault:  # one file must not cost the others
        error = f"{type(fault).__name__}: {_one_line(fault)}"
        outcome = Outcome(error=error, failed=True, trace=traceback.format_exc())
    return replace(
        outcome,
        seconds=time.perf_counter() - start,
        cpu_seconds=time.process_time() - cpu,
        worker=f"{socket.gethostname()}:{os.getpid()}",
    )


def _measure(job: Job) -> Outcome:
    item, out = job.item, Path(job.out)
    with local_copy(item.path) as file:
        sha256 = file_sha256(*list_files(file))
        key = result_key(sha256, job.settings_digest)
        kept = has_result(out, key)
        if kept and not job.pages:
            return Outcome(key=key, sha256=sha256)
        shared = out.is_dir()
        steps = StepStore(folder=out / "steps" / sha256[:2] / sha256[:40] if shared else None)
        try:
            measured = _identify(file, item, steps)
        except TagswayError as fault:
            error = _one_line(fault).replace(str(file), FILE)
            head = {"rows": [{"status": "failed", "error": error}]}
            return Outcome(key=key, sha256=sha256, lines=(_line(head),), failed=True)
        pages = tuple(_page(m, number, item) for number, m in measured if job.pages and m.not_determined is None)
        if kept:
            return Outcome(key=key, sha256=sha256, pages=pages)
        rows = [_row(each, number, file) for number, each in measured]
        frames = sum(len(each.track.time_s) for _, each in measured)
        documents = [
            {"result": result_document(m.result), "decay": _decay(m), "move": to_plain_move(aligned_move(m))}
            for _, m in measured
        ]
        if shared:
            steps.keep()
        return Outcome(
            key=key,
            sha256=sha256,
            lines=(_line({"rows": rows}), *(_line(document) for document in documents)),
            pages=pages,
            frames=frames,
            failed=any(row["status"] == "not_determined" for row in rows),
        )


def _identify(file: Path, item: Item, steps: StepStore) -> list[tuple[int | None, Measurement]]:
    if item.picks:
        found = identify_picks(file, item.settings, steps=steps, decoder_threads=DECODER_THREADS)
        return list(enumerate(found, start=1))
    return [(None, identify(file, item.settings, steps=steps, decoder_threads=DECODER_THREADS))]


def _page(measurement: Measurement, pick: int | None, item: Item) -> tuple[str, str]:
    title = item.name if pick is None else f"{item.name}, pick {pick}"
    return page_ending(pick), render_page(measurement.result, measurement.curves, title=title, set_url="../..")


def _row(measurement: Measurement, number: int | None, file: Path) -> dict[str, Any]:
    """Return what measurements.csv says of a measurement, but for its name and its factors."""
    reason = measurement.not_determined
    error = None if reason is None else _one_line(reason).replace(str(file), FILE)
    return {"pick": number, "error": error, **row_of_result(measurement.result, aligned_move(measurement))}


def row_of_result(result: Result, move: AlignedMove | None) -> dict[str, Any]:
    """Return the numbers of a row of measurements.csv; `move` tells how long it was watched."""
    modal, pendulum, indicators = result.modal, result.pendulum, result.indicators
    row: dict[str, Any] = {
        "status": result.status,
        "warnings": " ".join(sorted({notice.code for notice in result.warnings})),
        "frames": None if result.video is None else result.video.frames,
    }

    def tell(name: str, std_name: str, estimate: Estimate | None, factor: float = 1.0) -> None:
        row[name] = None if estimate is None else estimate.value * factor
        row[std_name] = None if estimate is None else estimate.std * factor

    if result.window_s is not None:
        row["window_start_s"], row["window_end_s"] = result.window_s
    if modal is not None:
        tell("natural_frequency_hz", "natural_frequency_std_hz", modal.natural_frequency_hz)
        tell("damping_ratio", "damping_ratio_std", modal.damping_ratio)
        tell("operating_frequency_hz", "operating_frequency_std_hz", modal.operating_frequency_hz)
        tell("amplitude_mm", "amplitude_std_mm", modal.amplitude_m, 1e3)
        row["cycles"] = modal.cycles
    if pendulum is not None:
        tell("length_mm", "length_std_mm", pendulum.length_m, 1e3)
        tell("tag_radius_mm", "tag_radius_std_mm", pendulum.tag_radius_m, 1e3)
    if indicators is not None:
        row["settling_time_s"] = indicators.settling_time_s
        row["overshoot_percent"] = indicators.overshoot_percent
        row["trajectory_time_s"] = indicators.trajectory_time_s
        row["motion_time_s"] = indicators.motion_time_s
        peak, rest = indicators.max_pcp_acceleration_m_s2, indicators.residual_acceleration_m_s2
        tell("max_pcp_acceleration_m_s2", "max_pcp_acceleration_std_m_s2", peak.horizontal)
        tell("max_pcp_vector_m_s2", "max_pcp_vector_std_m_s2", peak.vector_with_gravity)
        row["bandwidth_hz"] = peak.bandwidth_hz
        row["residual_max_m_s2"] = None if rest is None else rest.max
        row["residual_rms_m_s2"] = None if rest is None else rest.rms
        for name, error_m in (("box_error_mm", indicators.box_error_m), ("place_error_mm", indicators.place_error_m)):
            row[name] = None if error_m is None else 1e3 * error_m
        row["reference_mm"] = 1e3 * indicators.reference_m
        row["watched_s"] = None if move is None else float(move.time_s[-1])
    return row


def _decay(measurement: Measurement) -> dict[str, Any] | None:
    """Return the free decay as it is drawn over others: time from its begin, sway, its unit."""
    decay = measurement.curves.decay
    if decay is None:
        return None
    step = max(1, len(decay.time_s) // MOST_DRAWN)
    time_s, sway = decay.time_s[::step] - decay.time_s[0], decay.fit[::step]
    unit, factor = ("mm", 1e3) if measurement.track.length_unit == "m" else (measurement.track.length_unit, 1.0)
    rounded = [[float(f"{value:.6g}") for value in values] for values in (time_s, factor * sway)]
    return {"time_s": rounded[0], "sway": rounded[1], "unit": unit}


def _line(document: Any) -> str:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _one_line(fault: object) -> str:
    return " ".join(str(fault).split())
