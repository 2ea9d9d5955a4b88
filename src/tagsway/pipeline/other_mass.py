"""`--with`: another payload mass at the same arm, from its own result.json."""

from dataclasses import dataclass, replace
from pathlib import Path

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Estimate, ModalEstimate, Notice
from tagsway.pendulum import PendulumFit, combine_masses
from tagsway.store.documents import read_result


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherMass:
    """What a result says of another payload at the same arm."""

    file: str
    mass_kg: float
    frequency_hz: Estimate


def read_other_mass(path: Path) -> OtherMass:
    """Read another payload's mass and small-swing frequency from its result.json.

    Raises
    ------
    InputError
        Where it is no result, or one without a mass or a frequency.
    """
    result = read_result(path)
    mass = result.source.settings.mass_kg
    if mass is None:
        raise InputError(f"--with {path}: this result has no mass: identify its video again with --mass")
    if result.modal is None or result.modal.natural_frequency_hz is None:
        raise InputError(f"--with {path}: this result has no natural frequency: film its payload again")
    return OtherMass(file=result.source.file, mass_kg=mass, frequency_hz=result.modal.natural_frequency_hz)


def add_mass(fit: PendulumFit, modal: ModalEstimate, other: OtherMass) -> PendulumFit:
    """Return a fit with what the other payload adds to it, or a notice that it adds nothing."""
    frequency, mass = modal.natural_frequency_hz, fit.estimate.mass_kg
    if frequency is None or mass is None:
        return fit
    try:
        both, notice = combine_masses(frequency, mass, other.frequency_hz, other.mass_kg, file=other.file)
    except NotIdentifiableError as problem:
        return replace(fit, notices=(*fit.notices, Notice(code="two_masses_disagree", message=str(problem))))
    return replace(fit, estimate=replace(fit.estimate, two_masses=both), notices=(*fit.notices, notice))
