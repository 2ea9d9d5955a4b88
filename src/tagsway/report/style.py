"""Colours and units that the figures and the page share."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from tagsway.model import Estimate, ExcitationCurve, FloatArray, Result, TrajectoryCurve

FIGURES = (
    "track",
    "decay",
    "spectrum",
    "estimators",
    "backbone",
    "excitation",
    "pendulum",
    "ridge",
    "residual",
    "trajectory",
)
"""Names of all that may be drawn of a measurement."""

SPECTRUM_SPAN = 6
"""How many times f_n a spectrum's axis reaches at first."""

LOWEST_SHARE = 3e-4
"""Of the largest value, to which a spectrum on a logarithmic axis is shown."""

LengthUnit = Literal["m", "px", "m/s2", "rad"]

LIKELY_COST = 3.84
"""Δχ² within which 95 of 100 true values lie."""

SENSOR_RECORDS: dict[str, LengthUnit] = {"acceleration_record": "m/s2", "angle_record": "rad"}
"""Warnings of records that hold no positions, and the unit of what they hold."""

# Okabe and Ito's palette: told apart with any colour vision; the dashes of each line tell them apart in grey.
INK = "#1b1f24"
GREY = "#8a929b"
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#E69F00"
VERMILION = "#D55E00"
RULE = "#e3e6ea"

LIGHT_PALETTE = {
    "@ink": INK,
    "@text": "#4a525b",
    "@grey": GREY,
    "@blue": BLUE,
    "@orange": VERMILION,
    "@green": GREEN,
    "@rule": RULE,
    "@band": "rgba(0, 114, 178, 0.16)",
    "@window": "rgba(0, 158, 115, 0.10)",
    "@paper": "#ffffff",
}
"""The page's chart colours by name, on a light page and in print."""

DARK_PALETTE = {
    "@ink": "#e8eaed",
    "@text": "#b3bac2",
    "@grey": "#7d868f",
    "@blue": SKY,
    "@orange": ORANGE,
    "@green": "#3fc79a",
    "@rule": "#2f353c",
    "@band": "rgba(86, 180, 233, 0.22)",
    "@window": "rgba(63, 199, 154, 0.12)",
    "@paper": "#1c2025",
}
"""The same names on a dark page."""


def length_unit(result: Result) -> LengthUnit:
    """Return the unit of a result's curves: pixels where nothing gave them a scale, or that of a sensor's record."""
    for code, unit in SENSOR_RECORDS.items():
        if any(notice.code == code for notice in result.warnings):
            return unit
    pcp, modal = result.tags.pcp, result.modal
    video_without_scale = result.video is not None and pcp is not None and pcp.mm_per_px is None
    modal_without_scale = modal is not None and modal.natural_frequency_hz is not None and modal.noise_m is None
    return "px" if video_without_scale or modal_without_scale else "m"


def drawn_length(unit: LengthUnit) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a length is drawn: metres become millimetres."""
    return {"m": (1000.0, "mm"), "px": (1.0, "px"), "m/s2": (1.0, "m/s²"), "rad": (1.0, "rad")}[unit]


def drawn_acceleration(unit: LengthUnit) -> str:
    """Return the unit in which an acceleration is drawn."""
    return f"{drawn_length(unit)[1]}/s²" if unit != "m" else "m/s²"


def excitation_unit(unit: LengthUnit) -> str:
    """Return the unit of an acceleration's spectrum, in which it is drawn."""
    return {"m": "m/s", "px": "px/s", "m/s2": "m/s³", "rad": "rad/s"}[unit]


def excitation_parts(curve: ExcitationCurve) -> list[tuple[str, list[tuple[str, FloatArray]]]]:
    """Return tool and product with their spectra and the names of the parts; without the tool where it was not seen."""
    ended = "" if curve.move_s is None else f", from {curve.move_s[1]:.2f} s"
    words = ("whole record", f"after the move{ended}", f"late, from {curve.late_s:.2f} s")
    tags = [
        ("tool (TCP)", (curve.tcp_whole, curve.tcp_after, curve.tcp_late)),
        ("product (PCP)", (curve.pcp_whole, curve.pcp_after, curve.pcp_late)),
    ]
    seen = [tag for tag in tags if np.any(np.isfinite(tag[1][0]))] or tags[1:]
    return [(who, list(zip(words, parts, strict=True))) for who, parts in seen]


def excitation_span(curve: ExcitationCurve, frequency_hz: Estimate | None) -> float:
    """Return the frequency to which the spectra are drawn."""
    top = float(np.nanmax(curve.frequency_hz, initial=0.0))
    if not top > 0:
        return 1.0
    return top if frequency_hz is None else min(top, SPECTRUM_SPAN * frequency_hz.value)


def excitation_range(parts: Sequence[FloatArray]) -> tuple[float, float] | None:
    """Return the range of a logarithmic axis; None where nothing is positive."""
    largest = max((float(np.nanmax(part, initial=0.0)) for part in parts), default=0.0)
    return (LOWEST_SHARE * largest, 2 * largest) if largest > 0 else None


def shaped_frequency(result: Result) -> Estimate | None:
    """Return the frequency that a shaper meets: at the operating amplitude, else for a small swing."""
    modal = result.modal
    if modal is None:
        return None
    return modal.operating_frequency_hz if modal.operating_frequency_hz is not None else modal.natural_frequency_hz


def sideways_axis(curve: TrajectoryCurve) -> tuple[int, str]:
    """Return index and name of the horizontal axis, x or y, along which a move goes farther."""
    way = np.ptp(curve.unshaped_m[:, :2], axis=0) if len(curve.unshaped_m) else np.zeros(2)
    return (1, "y") if way[1] > way[0] else (0, "x")


def to_decibel(amplitude: FloatArray) -> FloatArray:
    """Return amplitudes in dB of the largest, NaN where they are not positive."""
    largest = np.nanmax(amplitude, initial=0.0)
    decibel: FloatArray = np.full(amplitude.shape, np.nan)
    positive = amplitude > 0
    decibel[positive] = 20 * np.log10(amplitude[positive] / largest)
    return decibel


def shown_range(whole: Sequence[FloatArray], cut: Sequence[FloatArray] = ()) -> tuple[float, float] | None:
    """Return the range of values that a panel shows, so that a few spikes do not flatten all the rest.

    Parameters
    ----------
    whole : sequence of ndarray
        What is shown to its last sample.
    cut : sequence of ndarray
        What may run out of the panel: its outermost percent does not widen the range.

    Returns
    -------
    tuple of float or None
        Low and high, with a margin; None where nothing is finite.
    """
    ends = [values[np.isfinite(values)] for values in whole]
    for values in cut:
        finite = values[np.isfinite(values)]
        ends.append(np.percentile(finite, [0.5, 99.5]) if finite.size else finite)
    seen = np.concatenate([np.empty(0), *(end.ravel() for end in ends)])
    if not seen.size:
        return None
    low, high = float(seen.min()), float(seen.max())
    margin = 0.12 * (high - low) or 1.0
    return low - margin, high + margin


def thin(x: FloatArray, y: FloatArray, *, most: int) -> tuple[FloatArray, FloatArray]:
    """Return a line with at most `most` samples that looks the same.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        The line; NaN is a gap, and a stretch without any sample stays one.
    most : int
        Samples to return, at least 3.

    Returns
    -------
    x, y : ndarray, shape (m,)
        A selection of the samples, in their order: the first, the least and the greatest of each stretch. The extremes
        alone would leave the middle of a cloud of points empty.
    """
    if len(x) <= most:
        return x, y
    width = -(-len(x) // (most // 3))
    stretches = np.full((-(-len(x) // width), width), np.nan)
    stretches.flat[: len(y)] = y
    seen = np.isfinite(stretches)
    least = np.argmin(np.where(seen, stretches, np.inf), axis=1)
    greatest = np.argmax(np.where(seen, stretches, -np.inf), axis=1)
    first = width * np.arange(len(stretches))
    keep = np.unique(np.concatenate([first, first + least, first + greatest]))
    return x[keep], y[keep]
