"""Which payload to simulate, and how it varies: from options, a measurement, or many."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tagsway.cli.modes import Target, read_target
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, Mode, Notice, Pendulum

if TYPE_CHECKING:
    from numpy.random import Generator

    from tagsway.simulation import Payload

SAMPLES = 21
"""Over a spread, both ends and the middle among them."""

MOST_SAMPLES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadWish:
    """The options that say which payload.

    Parameters
    ----------
    origin : Path or None
        result.json of one measurement, or measurements.csv of many.
    length_mm, frequency_hz, damping_ratio, tag_radius_mm, stiffness : float or None
        Stated instead; the stiffness is k/J in 1/s².
    second : Mode or None
        A second body.
    gain : float or None
        Of the second body; None takes what the film of the move tells.
    spread_percent : float or None
        By how much f_n strays, up and down.
    samples : int or None
        How many.
    seed : int
        Of samples that are drawn from standard errors.
    """

    origin: Path | None
    length_mm: float | None
    frequency_hz: float | None
    damping_ratio: float | None
    tag_radius_mm: float | None
    stiffness: float | None
    second: Mode | None
    gain: float | None
    spread_percent: float | None
    samples: int | None
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPayload:
    """A payload's samples.

    Parameters
    ----------
    payload : Payload
        The samples; `nominal` of them is the one as measured.
    nominal : int
        Its place.
    source : str
        Where it came from and how it varies, in words.
    notices : tuple of Notice
        What was assumed.
    """

    payload: "Payload"
    nominal: int
    source: str
    notices: tuple[Notice, ...] = ()

    @property
    def mode(self) -> Mode:
        """The nominal one's, for a small swing."""
        return Mode(
            natural_frequency_hz=float(self.payload.frequency_hz[self.nominal]),
            damping_ratio=float(self.payload.damping_ratio[self.nominal]),
        )


def read_payload(wish: PayloadWish) -> KnownPayload:
    """Return the samples that the options of `identify simulate` ask for.

    Raises
    ------
    InputError
        Where the options say nothing, too much, or what cannot be.
    """
    _check(wish)
    target = _target(wish)
    pendulum, source = _pendulum(wish, target)
    known = _vary(wish, pendulum, source, target)
    body = wish.second if wish.second is not None else next(iter(target.swings[1:]), None)
    if body is None:
        if wish.gain is not None:
            raise InputError(
                f"--second-gain is {wish.gain:g}, and there is no second body: state --second-mode HZ:RATIO"
            )
        return known
    return _hang_second(known, body, wish, target)


def _hang_second(known: KnownPayload, body: Mode, wish: PayloadWish, target: Target) -> KnownPayload:
    from tagsway.simulation import add_second_body

    notices: list[Notice] = []
    if wish.gain is not None:
        gain = wish.gain
        notices.append(Notice(code="second_gain_assumed", message=f"the second body's gain of {gain:g} is stated"))
    elif wish.second is not None or wish.origin is None or target.result is None:
        gain = 1.0
        words = "the second body's gain is taken as 1, a point on a string, not measured: state --second-gain"
        notices.append(Notice(code="second_gain_assumed", message=words))
    else:
        from tagsway.pipeline.further import find_gains

        gains, notices = find_gains(
            target.result,
            wish.origin.parent,
            target.swings,
            length_m=target.length_m,
            radius_m=target.tag_radius_m,
        )
        gain = gains[0]
    payload = add_second_body(known.payload, body, gain=gain)
    words = f"{known.source}, a second body of {body.natural_frequency_hz:.4g} Hz (gain {gain:.3g})"
    return replace(known, payload=payload, source=words, notices=(*known.notices, *notices))


def _check(wish: PayloadWish) -> None:
    stated = {
        "--length": wish.length_mm,
        "--frequency": wish.frequency_hz,
        "--damping": wish.damping_ratio,
        "--tag-radius": wish.tag_radius_mm,
        "--stiffness": wish.stiffness,
    }
    named = [name for name, value in stated.items() if value is not None]
    if wish.origin is not None and named:
        raise InputError(f"--from and {named[0]} contradict each other: give one or the other")
    if wish.origin is None and (wish.damping_ratio is None or (wish.length_mm is None) == (wish.frequency_hz is None)):
        raise InputError(
            "a simulation needs a payload: give --from result.json or measurements.csv, or --frequency HZ or "
            "--length MM (one of them) with --damping RATIO"
        )
    for name in ("--length", "--frequency", "--tag-radius"):
        value = stated[name]
        if value is not None and not 0 < value < 1e5:
            raise InputError(f"{name} is {value:g}: expected more than 0")
    if wish.damping_ratio is not None and not 0 <= wish.damping_ratio < 1:
        raise InputError(f"--damping is {wish.damping_ratio:g}: expected a ratio from 0 to below 1, such as 0.05")
    if wish.frequency_hz is not None and wish.stiffness is not None:
        raise InputError("--stiffness goes with --length: a frequency already holds it")
    if wish.spread_percent is not None and not 0 < wish.spread_percent < 90:
        raise InputError(f"--spread is {wish.spread_percent:g}: expected more than 0 and less than 90 percent")
    if wish.gain is not None and not math.isfinite(wish.gain):
        raise InputError(f"--second-gain is {wish.gain:g}: expected a number, such as 0.1")
    if wish.samples is not None and not 1 <= wish.samples <= MOST_SAMPLES:
        raise InputError(f"--samples is {wish.samples}: expected 1 to {MOST_SAMPLES}")


def _target(wish: PayloadWish) -> Target:
    """Return what was measured, or the stated mode; a stated length has none yet."""
    if wish.origin is not None:
        return read_target(wish.origin, [], [], None)
    if wish.frequency_hz is not None:
        return read_target(None, [wish.frequency_hz], [wish.damping_ratio or 0.0], None)
    return Target(modes=(), spread=None, source="given", swings=())


def _pendulum(wish: PayloadWish, target: Target) -> tuple[Pendulum, str]:
    """Return the nominal payload, and where it came from."""
    from tagsway.simulation import pendulum_of_mode

    radius = target.tag_radius_m if wish.tag_radius_mm is None else wish.tag_radius_mm / 1e3
    if not target.swings:
        return _stated_pendulum(wish, radius)
    mode = target.swings[0]
    name = "" if wish.origin is None else f"{wish.origin.name}, "
    if target.length_m is None:
        if wish.origin is None:
            name = f"{mode.natural_frequency_hz:g} Hz, damping ratio {mode.damping_ratio:g}, "
        why = "" if target.result is None else " (l and k are not told apart there)"
        return pendulum_of_mode(mode, tag_radius_m=radius), f"{name}a pendulum without a spring{why}"
    wn = mode.angular_frequency_rad_s
    pendulum = Pendulum(
        length_m=target.length_m,
        tag_radius_m=target.length_m if radius is None else radius,
        stiffness_over_inertia_rad2_s2=wn**2 - GRAVITY_M_S2 / target.length_m,
        damping_over_inertia_rad_s=2 * mode.damping_ratio * wn,
        quadratic_drag_per_rad=target.drag_per_rad,
    )
    return pendulum, f"{name}the pendulum that was fitted"


def _stated_pendulum(wish: PayloadWish, radius_m: float | None) -> tuple[Pendulum, str]:
    zeta, length = wish.damping_ratio or 0.0, (wish.length_mm or 0.0) / 1e3
    bare = Pendulum(
        length_m=length,
        tag_radius_m=length if radius_m is None else radius_m,
        stiffness_over_inertia_rad2_s2=wish.stiffness or 0.0,
    )
    damped = replace(bare, damping_over_inertia_rad_s=2 * zeta * bare.angular_frequency_squared**0.5)
    return damped, f"{wish.length_mm:g} mm, {bare.natural_frequency_hz:.5g} Hz, damping ratio {zeta:g}"


def _vary(wish: PayloadWish, pendulum: Pendulum, source: str, target: Target) -> KnownPayload:
    """Return the samples: of a stated spread, of many measurements, of one's standard errors, or one alone."""
    import numpy as np

    from tagsway.simulation import hang_pendulums, vary_modes

    count, spread, said = wish.samples, wish.spread_percent, target.notices
    if spread is not None:
        if count == 1:
            raise InputError("--samples is 1, but --spread asks for both of its ends: give at least 2, or leave it out")
        share = np.union1d(np.linspace(-1, 1, count or SAMPLES), [0.0])
        frequency = pendulum.natural_frequency_hz * (1 + spread / 100 * share)
        payload = vary_modes(pendulum, frequency, pendulum.damping_ratio)
        words = f"{source}; f_n ± {spread:g} %, {len(share)} samples"
        return KnownPayload(payload=payload, nominal=int(np.argmin(np.abs(share))), source=words, notices=said)
    if target.repeats is not None:
        measured = target.repeats
        if count is not None:
            raise InputError(
                f"--samples is {count}, but the measurements are the samples: give --spread too, or leave it out"
            )
        frequency = np.append(pendulum.natural_frequency_hz, measured.frequency_hz)
        zeta = np.append(pendulum.damping_ratio, np.clip(measured.damping_ratio, 0, 0.99))
        words = f"{source}; the median and each of {len(measured.frequency_hz)} measurements"
        return KnownPayload(payload=vary_modes(pendulum, frequency, zeta), nominal=0, source=words, notices=said)
    if count is None or count == 1:
        return KnownPayload(payload=hang_pendulums(pendulum), nominal=0, source=source, notices=said)
    if target.result is None:
        raise InputError(f"--samples is {count}, but nothing varies: give --spread PERCENT too, or --from result.json")
    drawn = [pendulum, *_draw(pendulum, target, np.random.default_rng(wish.seed), count - 1)]
    words = f"{source}; {count} samples within its standard errors: one pick, not the next one's payload"
    return KnownPayload(payload=hang_pendulums(*drawn), nominal=0, source=words, notices=said)


def _draw(pendulum: Pendulum, target: Target, rng: "Generator", count: int) -> list[Pendulum]:
    """Draw f_n, l, r and ζ, whose errors are nearly independent, and derive k/J and b/J."""
    assert target.result is not None
    modal, fitted = target.result.modal, target.result.pendulum
    length = None if fitted is None or target.length_m is None else fitted.length_m
    radius = None if fitted is None else fitted.tag_radius_m
    known = [None if modal is None else modal.natural_frequency_hz, None if modal is None else modal.damping_ratio]
    stds = [0.0 if each is None else each.std for each in (*known, length, radius)]
    drawn = []
    for f, z, l_off, r_off in rng.normal(size=(count, 4)) * stds:
        wn = 2 * math.pi * max(pendulum.natural_frequency_hz + f, 1e-3)
        zeta = min(max(pendulum.damping_ratio + z, 0.0), 0.99)
        arm = GRAVITY_M_S2 / wn**2 if length is None else max(pendulum.length_m + l_off, 1e-4)
        drawn.append(
            replace(
                pendulum,
                length_m=arm,
                tag_radius_m=max(pendulum.tag_radius_m + r_off, 1e-4),
                stiffness_over_inertia_rad2_s2=wn**2 - GRAVITY_M_S2 / arm,
                damping_over_inertia_rad_s=2 * zeta * wn,
            )
        )
    return drawn
