"""A realistic result and its curves, made by hand: a payload of 2.47 Hz, moved by 0.7 m, then left to sway."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from example_curves import DAMPING, END_S, FREQUENCY_HZ, LENGTH_M, draw_curves
from tagsway.model import (
    BackbonePoint,
    Bound,
    CoordinateFrame,
    Creator,
    Curves,
    DesignMode,
    Estimate,
    Estimates,
    EstimatorResult,
    Event,
    Excitation,
    Implied,
    Impulse,
    Indicators,
    ModalEstimate,
    ModeEstimate,
    Notice,
    PeakAcceleration,
    PendulumEstimate,
    PointMassFit,
    Prior,
    Residual,
    ResidualAcceleration,
    Result,
    Settings,
    Shaper,
    Source,
    TagsSummary,
    TagSummary,
    VideoInfo,
)
from tagsway.model.result import EstimatorDetails

HOSTILE_NAME = 'bag <script>alert("1")</script> & "co".mp4'
SINGLE = Notice(
    code="single_measurement",
    message="One video gives the measurement's own error only: how the frequency varies between picks is not known.",
)


def example() -> tuple[Result, Curves]:
    """A good measurement of a move, with everything that a result can hold."""
    result = Result(
        status="ok",
        created_by=Creator(name="tagsway", version="0.1.0"),
        source=Source(
            file="flexible.mp4",
            sha256="3a7bd3e2360a3d29eea436fcfb7e44c735d117c42d1c1835420b6b9942dd4f1b",
            settings=Settings(tcp_tag_size_m=0.02, pcp_tag_size_m=0.02, mass_kg=0.225),
        ),
        video=VideoInfo(
            frames=2400,
            fps_hz=200.0,
            time_source="container",
            pts_rounding_s=1e-5,
            dropped=2,
            duplicated=0,
            width=1280,
            height=720,
            duration_s=END_S,
        ),
        frame=CoordinateFrame(
            origin="first position of the TCP", axes="x right, z up, y away from the camera", up_source="image"
        ),
        tags=TagsSummary(
            tcp=TagSummary(id=0, detected=0.9996, mm_per_px=Estimate.normal(0.8123, 0.0009)),
            pcp=TagSummary(id=1, detected=0.987, mm_per_px=Estimate.normal(0.8131, 0.0009)),
            reference=None,
        ),
        window_s=(1.71, 11.9),
        modal=_modal(),
        pendulum=_pendulum(),
        indicators=Indicators(
            reference_m=0.7,
            settling_time_s=1.41,
            overshoot_percent=1.62,
            trajectory_time_s=1.12,
            motion_time_s=1.41,
            max_pcp_acceleration_m_s2=PeakAcceleration(
                horizontal=Estimate.normal(10.41, 0.22),
                vector_with_gravity=Estimate.normal(14.3, 0.24),
                bandwidth_hz=24.0,
            ),
            residual_acceleration_m_s2=ResidualAcceleration(max=3.1, rms=0.94),
            box_error_m=0.0164,
        ),
        shaper=Shaper(
            type="zv",
            modes=(DesignMode(frequency_hz=2.4696, damping_ratio=DAMPING, amplitude_m=0.0098),),
            impulses=(Impulse(time_s=0.0, amplitude=0.50314), Impulse(time_s=0.202464, amplitude=0.49686)),
            insensitivity_5_percent=0.0637,
            residual=Residual(at_mode=3e-16),
            source="flexible.mp4",
        ),
        warnings=(SINGLE,),
        estimator_details=EstimatorDetails(
            spectrum_window="Hann",
            spectrum_resolution_hz=0.196,
            spectrum_bin_hz=0.0123,
            half_power=EstimatorResult(
                natural_frequency_hz=Estimate.normal(2.471, 0.012), damping_ratio=Estimate.normal(0.022, 0.019, low=0)
            ),
            decrement_cycles=22,
            decrement_over_cycles=EstimatorResult(
                natural_frequency_hz=None, damping_ratio=Estimate.normal(0.0041, 0.0004)
            ),
        ),
        excitation=Excitation(
            frequency_hz=2.4696,
            share_of_peak=Estimate.normal(0.231, 0.002),
            share_of_push=Estimate.normal(0.142, 0.001),
            sway_m=Estimate.normal(0.0187, 0.0002),
            strongest_hz=0.84,
        ),
    )
    return result, draw_curves()


def peeled_off() -> tuple[Result, Curves]:
    """The product fell at 9 s; a second mode was found, and one estimator disagrees."""
    result, curves = example()
    assert result.modal is not None
    event = Event(
        kind="peel_off",
        time_s=Estimate.normal(9.0, 0.002),
        horizontal_acceleration_m_s2=Estimate.normal(0.8, 0.1),
        held_acceleration_m_s2=Estimate.normal(9.9, 0.1),
    )
    notice = Notice(code="peel_off", message="the product peeled off at 9.000 ± 0.002 s; what follows is not used")
    second = ModeEstimate(
        natural_frequency_hz=Estimate.normal(5.431, 0.012),
        damping_ratio=Estimate.normal(0.011, 0.002),
        amplitude_m=0.00041,
    )
    fft = EstimatorResult(natural_frequency_hz=Estimate.normal(2.61, 0.004), damping_ratio=None)
    estimates = replace(result.modal.estimates, fft=fft)
    modal = replace(result.modal, modes=(*result.modal.modes, second), estimates=estimates)
    return replace(result, status="degraded", modal=modal, events=(event,), warnings=(notice, SINGLE)), curves


def in_pixels() -> tuple[Result, Curves]:
    """A video without a tag size: frequency and damping are known, no length is."""
    result, curves = example()
    assert result.modal is not None
    assert curves.decay is not None
    modes = tuple(replace(mode, amplitude_m=None) for mode in result.modal.modes)
    modal = replace(result.modal, amplitude_m=None, noise_m=None, modes=modes, backbone=())
    per_px = 1 / 0.8123e-3
    lengths = ("pcp", "pcp_clean", "pcp_acceleration", "tcp", "tcp_clean", "tcp_acceleration")
    swaying = ("sway", "fit", "envelope", "residual", "peak_sway")
    tags = TagsSummary(
        tcp=TagSummary(id=0, detected=0.9996, mm_per_px=None),
        pcp=TagSummary(id=1, detected=0.987, mm_per_px=None),
        reference=None,
    )
    warning = Notice(
        code="no_scale", message="No tag size was given: frequency and damping are known, lengths are not."
    )
    result = replace(
        result,
        status="degraded",
        source=replace(result.source, settings=Settings()),
        tags=tags,
        modal=modal,
        pendulum=PendulumEstimate.unknown("without a tag size there is no length to fit"),
        excitation=None,
        indicators=None,
        warnings=(warning, SINGLE),
    )
    return result, Curves(
        track=_scaled(curves.track, lengths, per_px),
        decay=_scaled(curves.decay, swaying, per_px),
        spectrum=curves.spectrum,
        residual=curves.residual,
    )


def not_determined() -> tuple[Result, Curves]:
    """A video in which nothing swings."""
    result, curves = example()
    still = np.zeros_like(curves.track.pcp)
    missing = np.full_like(curves.track.tcp, np.nan)
    track = replace(
        curves.track, pcp=still, pcp_clean=still, pcp_acceleration=still,
        tcp=missing, tcp_clean=missing, tcp_acceleration=missing,
    )  # fmt: skip
    warning = Notice(
        code="no_swing", message="Nothing swings in this video: no free vibration above the noise was found."
    )
    result = replace(
        result, status="not_determined", window_s=None, modal=None, pendulum=None, indicators=None, shaper=None,
        estimator_details=None, excitation=None,
        tags=replace(result.tags, tcp=None), warnings=(warning,),
    )  # fmt: skip
    return result, Curves(track=track)


def without_tool() -> tuple[Result, Curves]:
    """The tool's tag was never seen; the decay alone was used."""
    result, curves = example()
    missing = np.full_like(curves.track.tcp, np.nan)
    track = replace(curves.track, tcp=missing, tcp_clean=missing, tcp_acceleration=missing)
    warning = Notice(code="no_tcp", message="The tool's tag was never seen: positions are those of the product alone.")
    result = replace(
        result,
        status="degraded",
        excitation=None,
        tags=replace(result.tags, tcp=None),
        pendulum=PendulumEstimate.unknown("the tool's tag was never seen", mass_kg=0.225),
        warnings=(warning, SINGLE),
    )
    assert curves.excitation is not None
    unseen = np.full_like(curves.excitation.tcp_whole, np.nan)
    spectra = replace(curves.excitation, tcp_whole=unseen, tcp_after=unseen, tcp_late=unseen, move_s=None)
    return result, replace(curves, track=track, excitation=spectra, pendulum=None, trajectory=None)


def hostile() -> tuple[Result, Curves]:
    """Markup and control characters wherever a user's text can get in, and many warnings."""
    result, curves = example()
    bad = tuple(
        Notice(code=f"odd_{i}", message=f"<img src=x onerror=alert({i})> in {HOSTILE_NAME} \x1b[31m{{{{ 7 * 7 }}}}")
        for i in range(14)
    )
    source = replace(
        result.source, file=HOSTILE_NAME, settings=replace(result.source.settings, camera="</script>.json")
    )
    return replace(result, status="degraded", source=source, warnings=bad), curves


def _modal() -> ModalEstimate:
    frequency, ratio = Estimate.normal(FREQUENCY_HZ, 0.00031), Estimate.normal(0.00402, 0.000094, low=0)
    return ModalEstimate(
        natural_frequency_hz=frequency,
        damping_ratio=ratio,
        covariance=((0.00031**2, 1e-10), (1e-10, 0.000094**2)),
        amplitude_m=Estimate.normal(0.01134, 0.00004),
        operating_damping_ratio=None,
        operating_frequency_hz=Estimate.normal(2.4696, 0.00033),
        noise_m=0.00019,
        cycles=25.2,
        bound=Bound(natural_frequency_hz=0.00029, damping_ratio=0.00009),
        estimates=Estimates(
            maximum_likelihood=EstimatorResult(natural_frequency_hz=frequency, damping_ratio=ratio),
            fft=EstimatorResult(natural_frequency_hz=Estimate.normal(2.4721, 0.0024), damping_ratio=None),
            log_decrement=EstimatorResult(
                natural_frequency_hz=Estimate.normal(2.4733, 0.0031), damping_ratio=Estimate.normal(0.0043, 0.0006)
            ),
            periods=EstimatorResult(natural_frequency_hz=Estimate.normal(2.4733, 0.0031), damping_ratio=None),
        ),
        modes=(ModeEstimate(natural_frequency_hz=frequency, damping_ratio=ratio, amplitude_m=0.01134),),
        backbone=tuple(
            BackbonePoint(
                amplitude_m=a,
                frequency_hz=Estimate.normal(FREQUENCY_HZ - 24 * a**2, 0.0009),
                damping_ratio=Estimate.normal(0.0039 + 0.02 * a, 0.0002),
            )
            for a in (0.0105, 0.0078, 0.0052, 0.0031)
        ),
    )


def _pendulum() -> PendulumEstimate:
    per_rad = 180 / math.pi
    return PendulumEstimate(
        length_m=Estimate.normal(LENGTH_M, 0.00021),
        tag_radius_m=Estimate.normal(0.04571, 0.00009),
        pivot_offset_m=Estimate.normal(-0.0121, 0.0003),
        mass_kg=0.225,
        point_mass=True,
        stiffness_n_m_per_rad=Estimate.normal(2.264e-4 * per_rad, 6e-6 * per_rad),
        damping_n_m_s_per_rad=Estimate.normal(5.9e-5, 1.4e-6),
        stiffness_over_inertia_rad2_s2=Estimate.normal(27.4, 0.8),
        damping_over_inertia_rad_s=Estimate.normal(0.1249, 0.0029),
        quadratic_drag_per_rad=None,
        determined=True,
        reason="",
        implied=Implied(natural_frequency_hz=2.4719, damping_ratio=0.00402),
        rms_residual_m=0.00021,
        max_residual_m=0.00094,
        comparison=PointMassFit(
            length_m=0.04571,
            stiffness_over_inertia_rad2_s2=26.5,
            damping_over_inertia_rad_s=0.1249,
            stiffness_n_m_per_rad=0.01246,
            damping_n_m_s_per_rad=5.87e-5,
            rms_residual_m=0.00034,
            max_residual_m=0.00151,
        ),
        priors=(
            Prior(name="scale", value=0.0, std=0.003, unit="1"),
            Prior(name="gravity_tilt", value=0.0, std=0.0087, unit="rad"),
            Prior(name="length", value=45.85, std=0.5, unit="mm"),
        ),
    )


def _scaled(curve: Any, names: tuple[str, ...], factor: float) -> Any:
    return replace(curve, **{name: factor * getattr(curve, name) for name in names})
