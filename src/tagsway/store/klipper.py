"""A shaper in the terms of Klipper, a firmware for 3D printers."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from tagsway.errors import InputError
from tagsway.model import Shaper


@dataclass(frozen=True, slots=True, kw_only=True)
class _Accepted:
    """What Klipper's tuner proposes a type for, and up to which damping ratio its newer versions define it."""

    min_frequency_hz: float
    max_damping_ratio: float


KLIPPER_TYPES: Mapping[str, _Accepted] = MappingProxyType(
    {
        "zv": _Accepted(min_frequency_hz=21, max_damping_ratio=0.99),
        "mzv": _Accepted(min_frequency_hz=23, max_damping_ratio=0.99),
        "zvd": _Accepted(min_frequency_hz=29, max_damping_ratio=0.99),
        "ei": _Accepted(min_frequency_hz=29, max_damping_ratio=0.4),
        "2hump_ei": _Accepted(min_frequency_hz=39, max_damping_ratio=0.3),
        "3hump_ei": _Accepted(min_frequency_hz=48, max_damping_ratio=0.2),
    }
)
"""The types that it has, under its own names."""

FITTED = ("ei", "2hump_ei", "3hump_ei")
"""Types whose impulses it takes from a fit, for 5 %."""


def klipper_section(shaper: Shaper, *, axes: str = "x") -> str:
    """Return Klipper's `[input_shaper]` section for a shaper.

    Parameters
    ----------
    shaper : Shaper
        Of one mode, and of a type that Klipper has; the firmware makes the impulses itself, from the type, the
        undamped frequency in Hz and the damping ratio of each axis.
    axes : str
        "x", "y" or "xy": the axes that the mode was measured along.

    Returns
    -------
    str
        The section; what a reader should know stands in comments above it.

    Raises
    ------
    InputError
        For a type that Klipper does not have, several modes, or a prefilter that it cannot run.
    """
    if shaper.type not in KLIPPER_TYPES:
        raise InputError(
            f"Klipper has no shaper of type {shaper.type!r}: expected --type {', '.join(KLIPPER_TYPES)}, or another "
            "--format"
        )
    if len(shaper.modes) != 1 or shaper.box_s is not None or shaper.filter is not None or shaper.time_scale != 1:
        raise InputError(
            "Klipper shapes one mode with impulses alone: design the shaper for one mode, or use another --format"
        )
    (mode,) = shaper.modes
    lines = [*_comments(shaper), "[input_shaper]"]
    for axis in axes:
        lines += [
            f"shaper_type_{axis}: {shaper.type}",
            f"shaper_freq_{axis}: {mode.frequency_hz:.6g}",
            f"damping_ratio_{axis}: {mode.damping_ratio:.6g}",
        ]
    return "\n".join(lines) + "\n"


def _comments(shaper: Shaper) -> list[str]:
    (mode,), accepted = shaper.modes, KLIPPER_TYPES[shaper.type]
    lines = [
        f"# {shaper.type}: adds {1e3 * shaper.duration_s:.1f} ms to a move; undamped frequency in Hz, for each axis",
    ]
    if shaper.type in FITTED:
        lines.append("# Klipper's own impulses for this type come from a fit for 5 %: close to tagsway's, not the same")
    if mode.frequency_hz < accepted.min_frequency_hz:
        lines.append(
            f"# warning: its tuner proposes {shaper.type} from {accepted.min_frequency_hz:g} Hz up only; "
            f"{mode.frequency_hz:.6g} Hz works when it is stated, as here, but smooths corners strongly"
        )
    if mode.damping_ratio > accepted.max_damping_ratio:
        lines.append(
            f"# warning: a damping ratio of {mode.damping_ratio:.6g} is above the {accepted.max_damping_ratio:g} up to "
            f"which it defines {shaper.type}"
        )
    return lines
