from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import example_result
from tagsway.model import Curves, Estimate, Residual, Spread, TrajectoryCurve
from tagsway.report import figures, style
from tagsway.report.charts import make_charts
from tagsway.report.estimators import disagrees, estimator_lines, find_disagreements
from tagsway.report.figures import (
    plot_backbone,
    plot_decay,
    plot_estimators,
    plot_excitation,
    plot_pendulum,
    plot_residual,
    plot_spectrum,
    plot_track,
    plot_trajectory,
    write_figures,
)
from tagsway.report.pendulum_figures import plot_ridge
from tagsway.report.style import length_unit, shown_range, sideways_axis

PLOTS: dict[str, Callable[..., Figure]] = {
    "track": plot_track,
    "decay": plot_decay,
    "spectrum": plot_spectrum,
    "backbone": plot_backbone,
    "excitation": plot_excitation,
    "pendulum": plot_pendulum,
    "ridge": plot_ridge,
    "residual": plot_residual,
    "trajectory": plot_trajectory,
}


@pytest.fixture(scope="module")
def curves() -> Curves:
    return example_result.example()[1]


def _changed(curve: Any, change: Callable[[Any], Any]) -> Any:
    if isinstance(curve, np.ndarray):
        return change(curve)
    if not is_dataclass(curve):
        return curve
    return replace(curve, **{field.name: _changed(getattr(curve, field.name), change) for field in fields(curve)})


def test_a_folder_holds_a_picture_of_each_curve(tmp_path: Path) -> None:
    written = write_figures(*example_result.example(), tmp_path / "figures")
    names = {f"{name}.png" for name in (*PLOTS, "estimators")}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == names
    assert {path.name for path in written} == names
    assert {f"{name}.png" for name in style.FIGURES} == names
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)


def test_the_same_result_gives_the_same_bytes(tmp_path: Path) -> None:
    result, curves = example_result.not_determined()
    (first,) = write_figures(result, curves, tmp_path / "a")
    (second,) = write_figures(result, curves, tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    assert b"atplotlib" not in first.read_bytes()


def test_a_picture_that_cannot_be_written_leaves_the_old_one_and_no_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, curves = example_result.not_determined()
    (tmp_path / "track.png").write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="no space"):
        write_figures(result, curves, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["track.png"]
    assert (tmp_path / "track.png").read_bytes() == b"old"


def test_positions_are_drawn_in_millimetres(curves: Curves) -> None:
    figure = plot_track(curves.track)
    upper = figure.axes[0]
    assert upper.get_ylabel() == "x (mm)"
    tool = next(line for line in upper.get_lines() if line.get_label() == "tool (TCP)")
    assert np.array_equal(tool.get_ydata(), 1000 * curves.track.tcp_clean[:, 0])  # identity


def test_a_track_without_a_scale_is_drawn_in_pixels() -> None:
    result, curves = example_result.in_pixels()
    assert length_unit(result) == "px"
    assert [axes.get_ylabel() for axes in plot_track(curves.track, unit="px").axes] == [
        "x (px)",
        "z (px)",
        "x acceleration\n(px/s²)",
    ]
    table = replace(result, video=None)
    assert length_unit(table) == "px"


def test_a_tool_that_was_never_seen_is_not_in_the_legend() -> None:
    _, curves = example_result.without_tool()
    labels = plot_track(curves.track).axes[0].get_legend_handles_labels()[1]
    assert "tool (TCP)" not in labels
    assert "product (PCP)" in labels


def test_the_sway_is_drawn_with_both_sides_of_its_envelope(curves: Curves) -> None:
    assert curves.decay is not None
    lines = plot_decay(curves.decay).axes[0].get_lines()
    drawn = [np.asarray(line.get_ydata()) for line in lines]
    envelope = 1000 * curves.decay.envelope
    assert any(np.array_equal(y, envelope) for y in drawn)  # identity
    assert any(np.array_equal(y, -envelope) for y in drawn)  # identity


def test_residual_vibration_is_drawn_in_percent_with_the_interval_as_a_band(curves: Curves) -> None:
    result, _ = example_result.example()
    assert curves.residual is not None
    assert result.modal is not None
    frequency = result.modal.operating_frequency_hz
    assert frequency is not None
    panel = plot_residual(curves.residual, frequency_hz=frequency, shaper=result.shaper).axes[0]
    assert np.array_equal(panel.get_lines()[0].get_ydata(), 100 * curves.residual.residual)  # identity
    band = next(patch for patch in panel.patches if patch.get_label() == "its 95 % interval")
    extents = band.get_path().transformed(band.get_patch_transform()).get_extents()
    assert (extents.x0, extents.x1) == pytest.approx(frequency.ci95)  # identity


def test_a_plot_draws_into_the_axes_it_is_given(curves: Curves) -> None:
    figure = Figure()
    axes = figure.subplots(2)
    assert curves.decay is not None
    assert plot_decay(curves.decay, axes=list(axes)) is figure
    assert axes[1].get_xlabel() == "time (s)"
    with pytest.raises(ValueError, match="2 panels"):
        plot_decay(curves.decay, axes=[axes[0]])


def test_no_figure_stays_behind_in_pyplot(curves: Curves, tmp_path: Path) -> None:
    import matplotlib.pyplot as plt

    write_figures(*example_result.not_determined(), tmp_path)
    assert plt.get_fignums() == []
    assert not hasattr(figures, "plt")


@pytest.mark.slow
@pytest.mark.parametrize("name", PLOTS)
@pytest.mark.parametrize(
    "change",
    [lambda a: a[:0], lambda a: a[:1], lambda a: a[:2], lambda a: np.full_like(a, np.nan), np.zeros_like],
    ids=["empty", "one sample", "two samples", "all missing", "all zero"],
)
def test_odd_curves_can_be_drawn(name: str, change: Callable[[Any], Any], curves: Curves, tmp_path: Path) -> None:
    curve = _changed(getattr(curves, name), change)
    PLOTS[name](curve).savefig(tmp_path / "odd.png", dpi=20)
    result, _ = example_result.example()
    make_charts(result, replace(curves, **{name: curve}))


def test_a_spike_does_not_flatten_the_rest() -> None:
    bulk, spiked = np.linspace(-1, 1, 500), np.linspace(-1, 1, 500)
    spiked[250] = 1000.0
    shown = shown_range([bulk], [spiked])
    assert shown is not None
    assert -1.5 < shown[0] < -1 < 1 < shown[1] < 1.5


def test_a_move_along_y_is_drawn_along_y(curves: Curves) -> None:
    move = curves.trajectory
    assert move is not None
    turned: TrajectoryCurve = replace(move, unshaped_m=move.unshaped_m[:, [1, 0, 2]])
    assert sideways_axis(turned) == (1, "y")
    assert plot_trajectory(turned).axes[4].get_xlabel() == "y (mm)"


def test_a_known_spread_is_a_wider_band_than_the_error_of_one_video(curves: Curves) -> None:
    result, _ = example_result.example()
    assert result.shaper is not None
    spread = Spread(source="stated", natural_frequency_std_percent=3.0, n=None)
    residual = Residual(at_mode=0.0, p95=0.09, spread=spread)
    wide = replace(result, shaper=replace(result.shaper, residual=residual))
    shapes = make_charts(wide, curves)["residual"]["layout"]["shapes"]
    bands = sorted(shape["x1"] - shape["x0"] for shape in shapes if shape["type"] == "rect")
    assert len(bands) == 2
    assert bands[1] == pytest.approx(2 * 1.96 * 0.03 * 2.4696)  # identity


def test_each_estimator_is_drawn_at_its_value_with_its_interval() -> None:
    result, _ = example_result.example()
    assert result.modal is not None
    panel = plot_estimators(result.modal, details=result.estimator_details).axes[0]
    names = [line.name for line in estimator_lines(result.modal, result.estimator_details)]
    fft = result.modal.estimates.fft.natural_frequency_hz
    assert fft is not None
    row = names.index("Fourier transform")
    drawn = [np.asarray(line.get_xdata()) for line in panel.get_lines() if set(line.get_ydata()) == {row}]
    assert any(x.tolist() == [fft.value] for x in drawn)  # identity
    assert any(x.tolist() == pytest.approx(list(fft.ci95)) for x in drawn)  # identity
    words = " ".join(text.get_text() for text in panel.texts)
    for stated in ("Hann window", "resolution 0.2 Hz", "padded bin 0.012 Hz", "decrement over 22 cycles"):
        assert stated in words


def test_an_estimator_that_disagrees_is_marked_and_named() -> None:
    result, _ = example_result.peeled_off()
    assert result.modal is not None
    assert find_disagreements(result.modal, result.estimator_details) == ["Fourier transform"]
    legend = plot_estimators(result.modal, details=result.estimator_details).axes[0].get_legend()
    assert legend is not None
    assert "disagrees" in [text.get_text() for text in legend.get_texts()]
    sound, _ = example_result.example()
    assert sound.modal is not None
    assert find_disagreements(sound.modal, sound.estimator_details) == []


@pytest.mark.parametrize(
    ("one", "apart"),
    [
        (Estimate.normal(2.53, 0.001), True),
        (Estimate.normal(2.53, 0.03), False),
        (Estimate.normal(2.51, 0.001), False),
        (None, False),
    ],
    ids=["apart", "intervals meet", "too small to matter", "not known"],
)
def test_estimators_disagree_where_intervals_part_and_it_matters(one: Estimate | None, apart: bool) -> None:
    assert disagrees(one, Estimate.normal(2.475, 0.001), share=0.02) is apart


def test_without_the_details_of_the_others_the_estimators_are_still_drawn() -> None:
    result, _ = example_result.example()
    assert result.modal is not None
    unknown = Estimate(value=2.47, std=np.inf, ci95=(-np.inf, np.inf))
    best = replace(result.modal.estimates.maximum_likelihood, natural_frequency_hz=unknown, damping_ratio=None)
    modal = replace(
        result.modal,
        operating_frequency_hz=None,
        bound=None,
        estimates=replace(result.modal.estimates, maximum_likelihood=best),
    )
    plot_estimators(modal).canvas.draw()


def test_the_backbone_has_a_line_points_with_intervals_and_the_design(curves: Curves) -> None:
    result, _ = example_result.example()
    assert curves.backbone is not None
    assert result.modal is not None
    panel = plot_backbone(curves.backbone, modal=result.modal).axes[0]
    labels = panel.get_legend_handles_labels()[1]
    assert labels == ["one nonlinear decay", "mean swing: the shaper's design", "plain decays, piece by piece"]
    assert np.array_equal(panel.get_lines()[0].get_ydata(), curves.backbone.fit.frequency_hz)  # identity


def test_a_tool_that_was_never_seen_excites_nothing_that_is_drawn() -> None:
    _, curves = example_result.without_tool()
    assert curves.excitation is not None
    (panel,) = plot_excitation(curves.excitation).axes
    assert panel.get_ylabel().startswith("product")


def test_what_lies_beyond_the_bandwidth_is_shaded(curves: Curves) -> None:
    assert curves.excitation is not None
    result, _ = example_result.example()
    assert result.modal is not None
    figure = plot_excitation(curves.excitation, frequency_hz=result.modal.operating_frequency_hz)
    assert all("beyond what was seen" in panel.get_legend_handles_labels()[1] for panel in figure.axes)
    wide = replace(curves.excitation, bandwidth_hz=60.0)
    assert "beyond what was seen" not in plot_excitation(wide).axes[0].get_legend_handles_labels()[1]


def test_an_event_is_a_line_in_the_track() -> None:
    result, curves = example_result.peeled_off()
    for panel in plot_track(curves.track, events=result.events).axes:
        line = next(line for line in panel.get_lines() if line.get_label() == "the product peeled off")
        assert list(line.get_xdata()) == [9.0, 9.0]
    layout = make_charts(result, curves)["track"]["layout"]
    assert any(shape["x0"] == shape["x1"] == 9.0 for shape in layout["shapes"])
    assert [note["text"] for note in layout["annotations"]] == ["the product peeled off"]
