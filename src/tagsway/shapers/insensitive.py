"""Specified insensitivity: as short as a stated band of frequencies and damping ratios allows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import Mode
from tagsway.shapers.impulses import Impulses, convolve_impulses, zero_vibration
from tagsway.shapers.shortest import ComplexArray, shortest_within, shortest_zero

LONGEST_PERIODS = 4.0
"""Of the band's middle frequency; a shaper beyond it costs more than waiting."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """What a mode may be: a range of undamped frequencies and of damping ratios.

    Parameters
    ----------
    lowest_hz, highest_hz : float
        Of the natural frequency.
    least_damping, most_damping : float
        Of ζ, in [0, 1).
    """

    lowest_hz: float
    highest_hz: float
    least_damping: float
    most_damping: float

    def __post_init__(self) -> None:
        if not 0 < self.lowest_hz <= self.highest_hz < np.inf:
            raise InputError(
                f"a band of {self.lowest_hz:g} to {self.highest_hz:g} Hz cannot be: expected it to rise from above 0"
            )
        if not 0 <= self.least_damping <= self.most_damping < 1:
            raise InputError(
                f"damping ratios from {self.least_damping:g} to {self.most_damping:g} cannot be: expected them to "
                "rise within [0, 1)"
            )

    @classmethod
    def around(cls, mode: Mode, *, percent: float, damping_percent: float = 0.0) -> "Band":
        """Return the band of ± so many percent around a mode."""
        if not (0 <= percent < 100 and 0 <= damping_percent <= 100):
            raise InputError(
                f"a band of ±{percent:g} % (damping ±{damping_percent:g} %) contains 0: expected less than 100 %"
            )
        width, damping = percent / 100, damping_percent / 100
        return cls(
            lowest_hz=mode.natural_frequency_hz * (1 - width),
            highest_hz=mode.natural_frequency_hz * (1 + width),
            least_damping=mode.damping_ratio * (1 - damping),
            most_damping=min(mode.damping_ratio * (1 + damping), 0.99),
        )


def specified_insensitivity(band: Band, tolerance: float) -> Impulses:
    """Return the shortest positive impulses that keep V ≤ tolerance over a band [1]_.

    Parameters
    ----------
    band : Band
        All frequencies and damping ratios that the mode may have.
    tolerance : float
        In (0, 1).

    Returns
    -------
    Impulses
        As many as the band asks for: two for a narrow one, three from about ±5 %, four from about ±20 %.

    Raises
    ------
    InputError
        Where more than four periods would be needed.

    Notes
    -----
    With ±20 % and 5 % it is the EI, with ±36 % the two-hump EI; between those widths it is shorter than either, and
    with damping it is shorter than they are, as its band need not be centred.

    References
    ----------
    .. [1] W. E. Singhose, W. P. Seering and N. C. Singer, Proc. Japan-USA Symp. Flexible Automation (1996) 307-313.
    """
    unit = (band.lowest_hz + band.highest_hz) / 2

    def poles(steps: int) -> ComplexArray:
        ratio = np.linspace(band.lowest_hz, band.highest_hz, steps + 1) / unit
        zeta = np.unique(np.linspace(band.least_damping, band.most_damping, 3))[:, None]
        return np.asarray((2 * np.pi * ratio * (zeta + 1j * np.sqrt(1 - zeta**2))).ravel())

    found = shortest_within(poles, tolerance, LONGEST_PERIODS)
    return Impulses(time_s=found.time_s / unit, amplitude=found.amplitude)


def simultaneous_zero_vibration(modes: Sequence[Mode]) -> Impulses:
    """Return the shortest positive impulses with V = 0 on all of these modes at once.

    Parameters
    ----------
    modes : sequence of Mode
        One or more.

    Returns
    -------
    Impulses
        Never longer than the convolution of one ZV a mode, mostly shorter; for modes a few percent apart the gain is
        small, and the robustness less than the convolution's.
    """
    unit = modes[0].natural_frequency_hz
    each = [zero_vibration(mode) for mode in modes]
    together = convolve_impulses(*each)
    poles = np.array(
        [
            mode.angular_frequency_rad_s / unit * (mode.damping_ratio + 1j * np.sqrt(1 - mode.damping_ratio**2))
            for mode in modes
        ]
    )
    try:
        # Instants on a grid meet the equations only with a little room beyond the convolution's length.
        found = shortest_zero(poles, 1.05 * float(together.time_s[-1]) * unit)
    except InputError:
        return together
    if found.time_s[-1] / unit >= together.time_s[-1]:
        return together
    return Impulses(time_s=found.time_s / unit, amplitude=found.amplitude)
