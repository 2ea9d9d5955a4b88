"""Hammer blows at a robot, and the first frequency that answers."""

from dataclasses import dataclass
from typing import ClassVar

from tagsway.model.arrays import FloatArray
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate, Notice
from tagsway.model.repeats import RepeatSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class Blow:
    """What one channel answers to one blow, until it has died or the next blow falls.

    Parameters
    ----------
    channel : str
        The joint's name, as the file has it; with the file's name where there are several.
    start_s : float
        When the answer begins, in the record's time.
    step_s : float
        Between two samples.
    value : ndarray, shape (n,)
        Acceleration without its mean, in the file's unit.
    """

    channel: str
    start_s: float
    step_s: float
    value: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BlowResult:
    """The first frequency of one channel's answer to one blow.

    Parameters
    ----------
    channel, start_s
        As of the `Blow`.
    duration_s : float
        Of what was transformed.
    peak_hz : float
        Of the zero-padded spectrum, a parabola laid through it: a damped frequency.
    natural_frequency_hz, damping_ratio : Estimate or None
        Of damped modes fitted to the samples; None where they do not tell.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    channel: str
    start_s: float
    duration_s: float
    peak_hz: float
    natural_frequency_hz: Estimate | None
    damping_ratio: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadDistance:
    """How far the robot's first frequency is from the payload's.

    Parameters
    ----------
    payload_frequency_hz : float
        Of the payload.
    ratio : float
        The robot's over the payload's.
    amplification_percent : float
        100 / (ratio² - 1): by how much the arm's spring enlarges what is commanded at the payload's frequency.
    far_enough : bool
        Whether that is below 5 %: the ratio is above 4.6.
    shaper_leaves_percent : float or None
        Of a vibration of the robot's mode, what the payload's shaper leaves; None where no shaper is known.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    payload_frequency_hz: float
    ratio: float
    amplification_percent: float
    far_enough: bool
    shaper_leaves_percent: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpulseSpectra:
    """Zero-padded amplitude spectra of all blows, each over its own highest value.

    Parameters
    ----------
    frequency_hz : ndarray, shape (k,)
        Common to all.
    each : ndarray, shape (blows, k)
        One row a blow.
    mean : ndarray, shape (k,)
        Their average.
    """

    frequency_hz: FloatArray
    each: FloatArray
    mean: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpulseResult:
    """What impulse.json holds.

    Parameters
    ----------
    files : tuple of str
        Names of the records.
    first_frequency_hz : Estimate
        Mean of the blows' peaks; the error is that of the mean.
    peaks : RepeatSummary
        Median, ± deviation and s of the peaks, in Hz.
    natural_frequency_hz, damping_ratio : RepeatSummary or None
        The same of the fitted modes; None where fewer than two blows tell.
    resolution_hz, bin_hz : float
        Of the shortest answer, and of the zero-padded spectrum: the second is no accuracy.
    blows : tuple of BlowResult
        Each one.
    payload : PayloadDistance or None
        Where the payload's frequency is known.
    warnings : tuple of Notice
        What is odd.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    files: tuple[str, ...]
    first_frequency_hz: Estimate
    peaks: RepeatSummary
    natural_frequency_hz: RepeatSummary | None
    damping_ratio: RepeatSummary | None
    resolution_hz: float
    bin_hz: float
    blows: tuple[BlowResult, ...]
    payload: PayloadDistance | None
    warnings: tuple[Notice, ...]
