"""The figure of what a pendulum's fit leaves open."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tagsway.model import Estimate, RidgeCurve
from tagsway.report.panels import draw_line, make_panels, name_panel
from tagsway.report.style import BLUE, GREY, INK, LIKELY_COST, VERMILION


def plot_ridge(curve: RidgeCurve, *, length_m: Estimate | None = None, axes: Sequence[Axes] | None = None) -> Figure:
    """Draw which pairs of length and stiffness fit: k/J over l, and what each costs in χ².

    Parameters
    ----------
    curve : RidgeCurve
        The profile of the likelihood over l.
    length_m : Estimate, optional
        Its 95 % interval is drawn as a band, where l is told.
    axes : sequence of two Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (upper, lower) = make_panels(axes, (1, 1), height_inch=4.8)
    length = 1e3 * curve.length_m
    draw_line(upper, length, curve.stiffness_over_inertia_rad2_s2, "-", color=INK, lw=1.2, label="best k/J of each l")
    draw_line(lower, length, curve.delta_chi2, "o-", color=VERMILION, ms=3, lw=1, label="cost")
    lower.axhline(LIKELY_COST, color=GREY, ls=":", lw=1.2, label="95 %")
    if length_m is not None:
        for panel in (upper, lower):
            panel.axvspan(
                *(1e3 * end for end in length_m.ci95), color=BLUE, alpha=0.2, lw=0, label="95 % interval of l"
            )
    lower.set_ylim(0, None)
    name_panel(upper, "Length against stiffness", "k/J (rad²/s²)", legend=True)
    name_panel(lower, None, "Δχ²", x="length l (mm)", legend=True)
    return figure
