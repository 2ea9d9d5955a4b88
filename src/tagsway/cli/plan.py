"""`identify plan`: what a measurement can tell, before it is made."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tagsway.model import Plan


def plan(
    frequency: Annotated[float, typer.Option(help="Expected natural frequency in Hz.")],
    damping: Annotated[float, typer.Option(help="Expected damping ratio.")],
    amplitude: Annotated[float, typer.Option(help="Swing at the beginning in mm.")] = 30.0,
    noise: Annotated[
        float | None,
        typer.Option(help="Of product against tool, a frame, in mm.", show_default="from --scale, or 0.05"),
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames a second.")] = 200.0,
    scale: Annotated[float | None, typer.Option(help="Millimetres to a pixel, in the tags' plane.")] = None,
    tag_size: Annotated[float | None, typer.Option(help="Side of the black square in mm.")] = None,
    duration: Annotated[float | None, typer.Option(help="Of one record of the free decay in s.")] = None,
    wanted_frequency_error: Annotated[float, typer.Option(help="Wanted 1σ of f_n in percent.")] = 0.1,
    wanted_damping_error: Annotated[float, typer.Option(help="Wanted 1σ of ζ in percent.")] = 5.0,
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Say how well a decay of some length can tell f_n and ζ, and what wanted errors take."""
    from tagsway.errors import InputError
    from tagsway.model import PlannedMeasurement
    from tagsway.pipeline.plan import USUAL_NOISE_M, expected_noise_m, plan_measurement
    from tagsway.store.documents import dump, to_document

    for name, value, low, high in (("--scale", scale, 1e-4, 1e3), ("--tag-size", tag_size, 0.01, 1e4)):
        if value is not None and not low <= value <= high:
            raise InputError(f"{name} is {value:g}: expected a number of mm, from {low:g} to {high:g}")
    tag_size_m = None if tag_size is None else tag_size / 1e3
    if noise is not None:
        noise_m = noise / 1e3
    else:
        noise_m = USUAL_NOISE_M if scale is None else expected_noise_m(scale, tag_size_m)
    planned = plan_measurement(
        PlannedMeasurement(
            frequency_hz=frequency, damping_ratio=damping, amplitude_m=amplitude / 1e3, noise_m=noise_m, fps_hz=fps
        ),
        duration_s=duration,
        frequency_error_percent=wanted_frequency_error,
        damping_error_percent=wanted_damping_error,
        scale_mm_per_px=scale,
        tag_size_m=tag_size_m,
    )
    if json:
        typer.echo(dump({"schema": "tagsway/plan/1", **to_document(planned)}), nl=False)
    else:
        typer.echo("\n".join(plan_lines(planned)))


def plan_lines(planned: "Plan") -> list[str]:
    """Return a plan in words and as a table, a line each."""
    m = planned.measurement
    lines = [
        f"{m.frequency_hz:g} Hz, damping ratio {m.damping_ratio:g}, {1e3 * m.amplitude_m:g} mm, noise "
        f"{1e3 * m.noise_m:.3g} mm, {m.fps_hz:g} frames a second",
        "at best (Cramér-Rao bound, 1σ; white noise, one mode):",
        f"{'seconds':>9} {'cycles':>8} {'f_n ± %':>10} {'ζ ± %':>10}",
    ]
    for row in planned.table:
        ratio = "–" if row.damping_error_percent is None else f"{row.damping_error_percent:.3g}"
        lines.append(f"{row.duration_s:>9.3g} {row.cycles:>8.1f} {row.frequency_error_percent:>10.3g} {ratio:>10}")
    for need in planned.needs:
        wanted = f"{need.quantity} to ± {need.wanted_error_percent:g} %"
        many = f"{need.repeats} record{'s' if need.repeats > 1 else ''} of {need.repeat_duration_s:.2g} s"
        single = (
            "no single record is long enough" if need.duration_s is None else f"{need.duration_s:.2g} s of free decay"
        )
        lines.append(
            f"{wanted}: {single}, or {many}" if need.duration_s is None or need.repeats > 1 else f"{wanted}: {single}"
        )
    lines.append("repeats with a new pick differ by far more than this: film several to know by how much")
    hints = planned.camera
    if hints is not None:
        noise = ", ".join(f"{kind.replace('_', ' ')} {value:.2g}" for kind, value in hints.expected_noise_mm.items())
        lines += [
            f"camera: expose at most {1e3 * hints.longest_exposure_s:.2g} ms (a pixel of blur at "
            f"{hints.peak_speed_m_s:.2g} m/s)",
            f"expected noise in mm: {noise}"
            + ("" if hints.tag_side_px is None else f"; the tag is {hints.tag_side_px:.0f} px wide"),
        ]
    return lines + [f"warning: {notice.message}" for notice in planned.notices]
