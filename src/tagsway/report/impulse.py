"""The figure of a hammer test."""

import numpy as np
from matplotlib.figure import Figure

from tagsway.model import ImpulseResult, ImpulseSpectra
from tagsway.report.panels import make_panels, name_panel
from tagsway.report.style import BLUE, GREEN, GREY, VERMILION

SHOWN = 4.0
"""Multiples of the first frequency to which the spectra are drawn."""


def plot_impulse(result: ImpulseResult, spectra: ImpulseSpectra) -> Figure:
    """Draw the spectra of all blows, their average, each blow's first peak, and the payload's frequency."""
    figure, (panel,) = make_panels(None, (1,), height_inch=4.2)
    shown = spectra.frequency_hz <= SHOWN * result.first_frequency_hz.value
    for each in spectra.each:
        panel.plot(spectra.frequency_hz[shown], each[shown], color=GREY, lw=0.6, alpha=0.6, label="each blow")
    panel.plot(spectra.frequency_hz[shown], spectra.mean[shown], color=BLUE, lw=1.8, label="average")
    peaks = [blow.peak_hz for blow in result.blows]
    heights = np.interp(peaks, spectra.frequency_hz, spectra.mean)
    panel.plot(peaks, heights, "v", color=VERMILION, ms=5, label="first peak of each blow")
    if result.payload is not None:
        hz = result.payload.payload_frequency_hz
        panel.axvline(hz, color=GREEN, ls="--", lw=1.2, label=f"payload, {hz:.3g} Hz")
    panel.set_ylim(0, 1.05)
    title = f"Answer to the hammer: {result.first_frequency_hz.value:.2f} Hz"
    name_panel(panel, title, "amplitude (1 = largest of the blow)", x="frequency (Hz)", legend=True)
    return figure
