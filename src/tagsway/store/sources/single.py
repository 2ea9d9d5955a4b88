"""One column of numbers without times, as an encoder's log has it."""

import re
from pathlib import Path

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray
from tagsway.store.sources.build import TrackSource, TrackUnit, make_tag, make_track
from tagsway.store.sources.columns import NOTICES
from tagsway.store.sources.units import ANGLES, LENGTHS

LEAST_ROWS = 8
"""Fewer numbers below one another are no record."""

_RATE = re.compile(r"rate|fps|frequency|hz", re.IGNORECASE)
_WORDS = re.compile(r"[^\W\d_]+|°")


def find_single(text: str) -> tuple[list[str], FloatArray] | None:
    """Return what stands above a column of numbers, and the numbers; None where a text is nothing of that kind."""
    lines = [line.strip() for line in text.split("\n") if line.strip()]
    values: list[float] = []
    for line in reversed(lines):
        try:
            values.append(float(line))
        except ValueError:
            break
    if len(values) < LEAST_ROWS:
        return None
    return lines[: len(lines) - len(values)], np.array(values[::-1])


def read_single(head: list[str], values: FloatArray, path: Path, *, fps_hz: float | None) -> TrackSource:
    """Return the track of a column of numbers: x, at the rate that its header or `--fps` states.

    Raises
    ------
    InputError
        Where neither states a rate.
    """
    rate_hz = fps_hz or _rate_of(head)
    if rate_hz is None:
        raise InputError(f"{path} is one column of numbers without times: say --fps, how many there are in a second")
    if not rate_hz > 0:
        raise InputError(f"{path}: its rate is {rate_hz:g} Hz; expected more than 0, say --fps")
    unit, factor = _unit_of(head)
    index = np.arange(len(values))
    tag = make_tag(np.column_stack([values * factor, np.full(len(values), np.nan)]))
    track = make_track(index, index / rate_hz, unit, {"pcp": tag}, path=path, first_line=len(head) + 1)
    notices = () if unit == "m" else (NOTICES[unit],)
    return TrackSource(track=track, program="a column of numbers", notices=notices)


def _rate_of(head: list[str]) -> float | None:
    """Return the number below, or behind, a name that speaks of a rate."""
    cells = [[cell.strip() for cell in re.split(r"[,;\t]", line)] for line in head]
    for names, below in zip(cells, [*cells[1:], []], strict=False):
        for place, name in enumerate(names):
            if not _RATE.search(name):
                continue
            beside = [below[place]] if place < len(below) else []
            for text in (*beside, *names[place + 1 :], *re.findall(r"[\d.]+", name)):
                try:
                    return float(text)
                except ValueError:
                    continue
    return None


def _unit_of(head: list[str]) -> tuple[TrackUnit, float]:
    words = [word.lower() for line in head for word in _WORDS.findall(line)]
    angle = next((ANGLES[word] for word in words if word in ANGLES), None)
    if angle is not None:
        return "rad", angle
    length = next((word for word in words if word in LENGTHS and len(word) > 1), None)
    if length is None:
        return "m", 1e-3
    return ("px", 1.0) if length.startswith("p") else ("m", LENGTHS[length])
