"""What is believed before the data: of the camera, of drag and friction, and what the user states of the arm."""

import math
from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, Prior
from tagsway.pendulum.model import Unknown
from tagsway.pendulum.priors import RELATIVE_SCALE_STD, TILT_STD_RAD, VERTICAL_SCALE_STD

DRAG_STD_PER_RAD = 0.1
"""Air drag on payloads of this size is about 0.05 per rad, and stays below 0.2."""

FRICTION_STD_RAD = 0.005
"""Dry friction of a cup or a hinge holds a payload at less than a degree from straight down."""

POINT_MASS_TIE_STD = 0.002
"""How well r = l holds where it is stated: 0.1 mm on an arm of 50 mm."""

RULER_STD_M = 5e-4
"""Of a length that was measured by hand."""


NO_PUSH = Prior(name="stiffness", value=0.0, std=0.0, unit="N·m/rad", at_least=True)
"""A gripper that pushes the payload back, if at all: stated by the user, and held against the ridge."""

STATED = {"length_over_radius": "l/r", "length": "l"}
"""Names of the priors that a user states, and their signs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A prior on a weighted sum of unknowns.

    Parameters
    ----------
    weights : dict of Unknown to float
        Of the sum.
    value, std : float
        Its mean and standard deviation.
    printed : Prior or None
        What a result says of it; None for one that only keeps a search within reason.
    """

    weights: dict[Unknown, float]
    value: float
    std: float
    printed: Prior | None


def believe(radius_m: float, *, point_mass: bool, length_m: float | None, scale_std: float) -> tuple[Belief, ...]:
    """Return the priors of a fit.

    Parameters
    ----------
    radius_m : float
        Of the arc: r and l lie within a factor e of it.
    point_mass : bool
        Whether r = l is stated.
    length_m : float or None
        A stated length l.
    scale_std : float
        Of the lengths that the camera shows.
    """
    beliefs = [
        Belief(weights={unknown: 1.0}, value=math.log(radius_m), std=1.0, printed=None)
        for unknown in (Unknown.LOG_LENGTH, Unknown.LOG_RADIUS)
    ]
    zero = (
        (Unknown.DRAG, "quadratic_drag", DRAG_STD_PER_RAD, "1/rad"),
        (Unknown.FRICTION, "dry_friction", FRICTION_STD_RAD, "rad"),
        (Unknown.SCALE, "scale", scale_std, "1"),
        (Unknown.RELATIVE_SCALE, "relative_scale", RELATIVE_SCALE_STD, "1"),
        (Unknown.VERTICAL_SCALE, "vertical_scale", VERTICAL_SCALE_STD, "1"),
        (Unknown.TILT, "gravity_tilt", TILT_STD_RAD, "rad"),
    )
    for unknown, name, std, unit in zero:
        printed = Prior(name=name, value=0.0, std=std, unit=unit)
        beliefs.append(Belief(weights={unknown: 1.0}, value=0.0, std=std, printed=printed))
    if point_mass:
        printed = Prior(name="length_over_radius", value=1.0, std=POINT_MASS_TIE_STD, unit="1")
        weights = {Unknown.LOG_LENGTH: 1.0, Unknown.LOG_RADIUS: -1.0}
        beliefs.append(Belief(weights=weights, value=0.0, std=POINT_MASS_TIE_STD, printed=printed))
    if length_m is not None:
        printed = Prior(name="length", value=1e3 * length_m, std=1e3 * RULER_STD_M, unit="mm")
        weights = {Unknown.LOG_LENGTH: 1.0}
        beliefs.append(Belief(weights=weights, value=math.log(length_m), std=RULER_STD_M / length_m, printed=printed))
    return tuple(beliefs)


def rows_of(beliefs: tuple[Belief, ...]) -> tuple[FloatArray, FloatArray]:
    """Return W, shape (beliefs, 15), and w: a parameter vector p is W p - w standard deviations from each."""
    rows, target = np.zeros((len(beliefs), len(Unknown))), np.zeros(len(beliefs))
    for row, belief in enumerate(beliefs):
        for unknown, weight in belief.weights.items():
            rows[row, unknown] = weight / belief.std
        target[row] = belief.value / belief.std
    return rows, target
