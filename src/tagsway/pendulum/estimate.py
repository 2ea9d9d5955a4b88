"""From a track to its pendulum."""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import (
    GRAVITY_M_S2,
    SCALE_STD,
    Estimate,
    Implied,
    ModalDeviation,
    ModalEstimate,
    Notice,
    PendulumCurve,
    PendulumEstimate,
    PointMassFit,
    Prior,
    RidgeCurve,
    TagTrack,
    Track,
    Window,
)
from tagsway.pendulum.arc import LARGEST_RADIUS_STD, MOST_SAMPLES, Arc, fit_arc
from tagsway.pendulum.assumed import NO_PUSH, Belief, believe
from tagsway.pendulum.checks import compare_with_mode, doubt_by_mode
from tagsway.pendulum.fit import LARGEST_EXCESS, Solution, fit_record
from tagsway.pendulum.model import (
    Unknown,
    angular_frequency,
    coulomb_friction,
    damping_over_inertia,
    length_m,
    pivot_offset_m,
    stiffness_over_inertia,
    tag_radius_m,
)
from tagsway.pendulum.point_mass import fit_positions
from tagsway.pendulum.record import FALLBACK_STD_M, Record, choose_record, fit_turn, part_of
from tagsway.pendulum.ridge import Ridge
from tagsway.pendulum.shortfall import find_shortfall
from tagsway.pendulum.start import find_arc, find_starts
from tagsway.pendulum.verdict import describe, is_point_mass, judge, not_determined

LEAST_SWAY_OVER_NOISE = 10.0
"""A payload that sways less than this many times its tags' noise shows no pendulum."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumFit:
    """A pendulum, the curve that shows it, and what goes with it.

    Parameters
    ----------
    estimate : PendulumEstimate
        What the track tells.
    curve : PendulumCurve or None
        Measured against simulated sway; None where nothing was fitted.
    ridge : RidgeCurve or None
        Which (l, k/J) fit how well: the profile of the likelihood; None where nothing was fitted.
    notices : tuple of Notice
        Codes `pendulum_not_determined`, `pendulum_indicative`, `no_spring`, `point_mass_equivalent`,
        `pendulum_record_shortened`, `arc_witnesses_disagree`, `pendulum_disagrees`, `pendulum_unmodelled`,
        `prior_stated`, `prior_disagrees`.
    """

    estimate: PendulumEstimate
    curve: PendulumCurve | None
    ridge: RidgeCurve | None = None
    notices: tuple[Notice, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fitted:
    """All that the data and the priors made."""

    record: Record
    against_mode: tuple[ModalDeviation | None, Notice | None]
    arc: Arc
    solution: Solution
    ridge: Ridge
    priors: tuple[Prior, ...]
    comparison: PointMassFit | None


def fit_pendulum(
    track: Track,
    window: Window,
    modal: ModalEstimate,
    *,
    mass_kg: float | None = None,
    point_mass: bool = False,
    length_m: float | None = None,
    nonnegative_stiffness: bool = False,
    scale_std: float = SCALE_STD,
    rng: np.random.Generator,
) -> PendulumFit:
    """Fit the pendulum to the sway that the tool's measured motion makes.

    Parameters
    ----------
    track : Track
        The motion of tool and product, in metres.
    window : Window
        The free vibration; the move before it is fitted with it.
    modal : ModalEstimate
        f_n and ζ of the decay: where the fit starts.
    mass_kg : float, optional
        Mass of the payload, for k and b.
    point_mass : bool
        State that the payload is a point at its tag: r = l within 0.2 %. Then a decay alone tells k.
    length_m : float, optional
        State the equivalent length, as measured by hand to 0.5 mm.
    nonnegative_stiffness : bool
        State that k ≥ 0. It cuts the intervals of l and k; it does not tell them apart where the motion does not.
    scale_std : float
        Relative standard error of the track's scale: that of the tags' side.
    rng : Generator
        For the draws of the pivot's path that carry its noise into the errors.

    Returns
    -------
    PendulumFit
        Never without a reason where l and k are not determined.

    Raises
    ------
    InputError
        A mass or a length that is not positive.

    Notes
    -----
    q'' + (b/J) q' + d q' |q'| + c sign q' + (k/J) q + [(g + Z'') sin q + X'' cos q] / l = 0, simulated in the momentum
    form of `tagsway.dynamics` from the TCP's smoothed velocity; unknowns are f_n, l, r, ζ, d, c, the pivot's offset
    from the TCP tag, the state at the start, the tag's own zero, and the camera's scale, relative scale, vertical scale
    and tilt with priors of 0.3 %, 0.5 %, 0.2 % and 0.5°, which enter the errors: 1 % of scale moves k by 4 to 7 % and
    leaves no trace in the residual.

    Intervals of l and k are those of a profile of the likelihood over l, the ridge; errors are the larger of those of
    the fit and of a block bootstrap of its residuals. What was assumed stands in `PendulumEstimate.priors`.

    k = (k/J) m l² and b = (b/J) m l². They are the spring's and the damper's own where the payload is a point mass
    (r = l); else they are those of the point mass m at l that moves alike, with the notice `point_mass_equivalent`:
    then k/J and b/J are what is known, since a body's J = m l_c l holds its centre of mass, which no motion shows.

    What one pendulum does not explain (a light second body, a spring that stiffens, a slip, a sway out of the plane)
    is sized from the residuals and widens the errors; the largest light body that leaves no trace always does. Not for
    a payload of two like bodies, whose l is no one's, nor across a regrip or a contact.
    """
    if mass_kg is not None and not (mass_kg > 0 and np.isfinite(mass_kg)):
        raise InputError(f"the mass must be positive, not {mass_kg:g} kg: give the payload's mass, or none")
    if length_m is not None and not (length_m > 0 and np.isfinite(length_m)):
        raise InputError(f"the length must be positive, not {1e3 * length_m:g} mm: give the equivalent length, or none")
    try:
        record = _choose(track, window, modal, rng)
        fitted = _fit(record, modal, _Stated(mass_kg, point_mass, length_m, nonnegative_stiffness, scale_std))
    except NotIdentifiableError as problem:
        return _without_dynamics(str(problem), track, window, mass_kg)
    curve = PendulumCurve(
        time_s=record.time_s, measured=record.sway_m, simulated=np.ascontiguousarray(fitted.solution.predicted[:2].T)
    )
    estimate, notices = _report(fitted, modal, mass_kg)
    return PendulumFit(estimate=estimate, curve=curve, ridge=fitted.ridge.curve(), notices=(*record.notices, *notices))


class _Stated(NamedTuple):
    """What the user says of the payload."""

    mass_kg: float | None
    point_mass: bool
    length_m: float | None
    nonnegative_stiffness: bool
    scale_std: float


def _choose(track: Track, window: Window, modal: ModalEstimate, rng: np.random.Generator) -> Record:
    """Return the record to be fitted; `NotIdentifiableError` where it holds no sway."""
    if track.tcp is None:
        raise _undetermined("the tool's tag was never seen: the pivot's motion is not known")
    if track.length_unit != "m":
        raise _undetermined("positions are in pixels: give the tags' size for lengths")
    if modal.natural_frequency_hz is not None:
        omega = 2 * np.pi * modal.natural_frequency_hz.value
    else:
        omega = float(np.sqrt(GRAVITY_M_S2 / _arc_of_window(track, track.tcp, window).radius_m))
    record = choose_record(track, window, angular_frequency_rad_s=omega, rng=rng)
    noise = float(np.nanmedian(record.sway_std_m))
    swept = float(np.ptp(np.nanpercentile(record.sway_m[:, 0], [2, 98])))
    if not swept > LEAST_SWAY_OVER_NOISE * noise:
        raise _undetermined(f"the payload sways over {1e3 * swept:.2f} mm only, with {1e3 * noise:.2f} mm of noise")
    return record


def _fit(record: Record, modal: ModalEstimate, stated: _Stated) -> _Fitted:
    arc = find_arc(record, GRAVITY_M_S2 / record.angular_frequency_rad_s**2)
    beliefs = believe(arc.radius_m, point_mass=stated.point_mass, length_m=stated.length_m, scale_std=stated.scale_std)
    try:
        problem, fitted = fit_record(record, beliefs, find_starts(record, arc, modal))
        solution = fitted if record.moved else doubt_by_mode(fitted, modal)
        return _Fitted(
            record=record,
            against_mode=compare_with_mode(record, fitted, modal),
            arc=arc,
            solution=solution,
            ridge=Ridge.of(problem, solution, springs_only=stated.nonnegative_stiffness),
            priors=(*_printed(beliefs, solution), *([NO_PUSH] if stated.nonnegative_stiffness else [])),
            comparison=fit_positions(record, solution.parameters, modal, radius_m=arc.radius_m, mass_kg=stated.mass_kg),
        )
    except (ValueError, np.linalg.LinAlgError) as fault:
        raise _undetermined("no pendulum follows this motion: check the window and the tags' sizes") from fault


def _printed(beliefs: tuple[Belief, ...], solution: Solution) -> list[Prior]:
    """Return what a result says of the beliefs that took part."""
    took_part = (belief for belief in beliefs if solution.rubbed or Unknown.FRICTION not in belief.weights)
    return [belief.printed for belief in took_part if belief.printed is not None]


def _arc_of_window(track: Track, tool: TagTrack, window: Window) -> Arc:
    """Return the arc of the free vibration, which needs no dynamics; `NotIdentifiableError` where there is none."""
    inside = np.flatnonzero((track.time_s >= window.start_s) & (track.time_s <= window.end_s))
    inside = inside[:: max(1, len(inside) // MOST_SAMPLES)]
    time, tool, pcp = track.time_s[inside], part_of(tool, inside), part_of(track.pcp, inside)
    std = np.hypot(pcp.position_std, tool.position_std)
    return fit_arc(
        pcp.position - tool.position,
        np.where(std > 0, std, FALLBACK_STD_M),
        pcp.angle_rad,
        pcp.angle_std_rad,
        angle_short_rad=find_shortfall(pcp),
        tool_turn_rad=fit_turn(time, tool)(time),
    )


def _without_dynamics(reason: str, track: Track, window: Window, mass_kg: float | None) -> PendulumFit:
    """Return what stands where no pendulum could be fitted: at most the arc."""
    estimate, notices = PendulumEstimate.unknown(reason, mass_kg=mass_kg), [not_determined(reason)]
    if track.tcp is not None and track.length_unit == "m":
        with suppress(NotIdentifiableError):
            arc = _arc_of_window(track, track.tcp, window)
            radius, x, z = _geometry(arc, None)
            estimate = replace(estimate, tag_radius_m=radius, pivot_offset_m=z, pivot_offset_x_m=x)
            notices += [slip] if (slip := arc.disagreement()) else []
    return PendulumFit(estimate=estimate, curve=None, notices=tuple(notices))


def _report(
    fitted: _Fitted, modal: ModalEstimate, mass_kg: float | None
) -> tuple[PendulumEstimate, tuple[Notice, ...]]:
    solution, ridge = fitted.solution, fitted.ridge
    verdict = judge(fitted.record, solution, ridge, fitted.priors)
    told = verdict.kind != "refuse"
    follows = solution.excess <= LARGEST_EXCESS
    slip = fitted.arc.disagreement()
    radius, offset_x, offset_z = _geometry(fitted.arc, fitted if follows and slip is None else None)
    stiffness: Estimate | None = None
    damper: Estimate | None = None
    if told and mass_kg is not None:
        mass = mass_kg
        stiffness = ridge.estimate(lambda p: stiffness_over_inertia(p) * mass * length_m(p) ** 2)
        damper = solution.estimate(lambda p: damping_over_inertia(p) * mass * length_m(p) ** 2, low=0.0)
    omega = float(angular_frequency(solution.parameters))
    deviation, disagreement = fitted.against_mode
    estimate = PendulumEstimate(
        length_m=ridge.estimate(length_m) if told else None,
        tag_radius_m=radius,
        pivot_offset_m=offset_z,
        pivot_offset_x_m=offset_x,
        mass_kg=mass_kg,
        point_mass=is_point_mass(solution) if told else None,
        stiffness_n_m_per_rad=stiffness,
        damping_n_m_s_per_rad=damper,
        stiffness_over_inertia_rad2_s2=ridge.estimate(stiffness_over_inertia) if told else None,
        damping_over_inertia_rad_s=solution.estimate(damping_over_inertia, low=0.0) if follows else None,
        quadratic_drag_per_rad=solution.estimate(lambda p: p[Unknown.DRAG]) if follows else None,
        coulomb_friction_rad_s2=solution.estimate(coulomb_friction) if follows and solution.rubbed else None,
        determined=verdict.kind == "claim",
        reason=verdict.reason,
        implied=Implied(
            natural_frequency_hz=omega / (2 * np.pi),
            damping_ratio=float(solution.parameters[Unknown.DAMPING_RATIO]),
        ),
        rms_residual_m=solution.rms_m,
        max_residual_m=solution.max_m,
        deviation=deviation,
        comparison=fitted.comparison,
        priors=fitted.priors,
    )
    notices = [notice for notice in (slip, disagreement) if notice is not None]
    return estimate, (*notices, *describe(verdict, estimate, solution))


def _geometry(arc: Arc, fitted: _Fitted | None) -> tuple[Estimate, Estimate, Estimate] | tuple[None, None, None]:
    """Return r, and x and z of the pivot: of the fit, or of the arc alone where no pendulum follows the motion."""
    if fitted is not None:
        radius = fitted.solution.estimate(tag_radius_m, low=0.0)
        x, z = (_offset_of(fitted, axis) for axis in (0, 1))
    elif arc.known:
        radius, (x, z) = arc.radius(), arc.offset()
    else:
        return None, None, None
    return (radius, x, z) if radius.std <= LARGEST_RADIUS_STD * radius.value else (None, None, None)


def _offset_of(fitted: _Fitted, axis: int) -> Estimate:
    """Return x or z of the pivot from the TCP tag.

    The relative scale e shifts the two tags against each other by e times the way to the image's middle, which the
    track does not hold: about as long as the tool's own way.
    """
    offset = fitted.solution.estimate(lambda p: pivot_offset_m(p)[axis])
    relative = fitted.solution.estimate(lambda p: p[Unknown.RELATIVE_SCALE])
    way = float(np.max(np.abs(fitted.record.tool_m[:, axis])))
    return Estimate.normal(offset.value, float(np.hypot(offset.std, (abs(relative.value) + relative.std) * way)))


def _undetermined(message: str) -> NotIdentifiableError:
    return NotIdentifiableError(message, code="pendulum_not_determined")
