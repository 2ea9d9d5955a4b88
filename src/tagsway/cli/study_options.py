"""The options of `identify simulate` that say which moves to study."""

import re
from enum import StrEnum
from typing import TYPE_CHECKING

from tagsway.errors import InputError

if TYPE_CHECKING:
    from tagsway.studies import Limit

SCAN = "1:25:0.25"
MOST_SCANNED = 2000


class Study(StrEnum):
    """What is varied."""

    DEVIATIONS = "deviations"
    ACCELERATIONS = "accelerations"
    LIMITS = "limits"


def choose_study(study: Study | None, accelerations: str | None, limited: bool) -> Study | None:
    """Return the study that is asked for, also where only its options say so; refuse options of another."""
    if study is None:
        return Study.LIMITS if limited else Study.ACCELERATIONS if accelerations is not None else None
    if limited and study is not Study.LIMITS:
        raise InputError(f"--study {study} knows no limits: leave them out, or give --study limits")
    if accelerations is not None and study is Study.DEVIATIONS:
        raise InputError("--study deviations runs the move's own acceleration: leave --accelerations out")
    return study


def read_limits(acceleration: float | None, overshoot: float | None, box_mm: float | None) -> "list[Limit]":
    """Return the limits that the options state."""
    from tagsway.studies import Limit

    for name, value in (
        ("--max-pcp-acceleration", acceleration),
        ("--max-overshoot", overshoot),
        ("--box", box_mm),
    ):
        if value is not None and not 0 < value < 1e6:
            raise InputError(f"{name} is {value:g}: expected more than 0")
    found = []
    if acceleration is not None:
        found.append(Limit(quantity="pcp_acceleration_m_s2", most=acceleration))
    if overshoot is not None:
        found.append(Limit(quantity="overshoot_percent", most=overshoot))
    if box_mm is not None:
        found.append(Limit(quantity="box_error_m", most=box_mm / 1e3))
    return found


def read_scan(text: str) -> list[float]:
    """Return the accelerations of FROM:TO:STEP, both ends among them, or of A,B,C."""
    import numpy as np

    words = f"--accelerations is {text!r}: expected FROM:TO:STEP or A,B,C in m/s², rising, such as 2:10:0.5"
    try:
        parts = [float(part) for part in re.split("[:,]", text)]
    except ValueError:
        raise InputError(words) from None
    if ":" in text:
        if len(parts) != 3 or not (0 < parts[0] <= parts[1] < 1e4 and parts[2] > 0):
            raise InputError(words)
        low, high, step = parts
        count = int((high - low) / step + 1e-9) + 1
        if count > MOST_SCANNED:
            raise InputError(f"--accelerations {text} are {count} moves: expected at most {MOST_SCANNED}")
        return [float(round(low + i * step, 12)) for i in range(count)]
    if not (all(0 < a < 1e4 for a in parts) and np.all(np.diff(parts) > 0)):
        raise InputError(words)
    return parts
