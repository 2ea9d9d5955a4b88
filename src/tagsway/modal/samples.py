"""What is fitted, what is known before, and what a fit says."""

from dataclasses import dataclass, replace
from typing import Self

from tagsway.modal.decay import Terms
from tagsway.model import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """What is fitted.

    Parameters
    ----------
    time_s, value, spread : ndarray, shape (n,)
        Times from the window's start, values, and each one's relative standard error.
    stated : float
        Standard error that the images' own noise leaves in the best samples; 0 where the source states none.
    pulled : float
        Standard error that a coder left in the samples, as their source states it: no average makes it smaller.
    drive : ndarray, shape (n,), optional
        Position of the point of suspension along the axis of the sway, where it is to be an input.
    drive_std : float
        Standard error of each of its samples.
    common : ndarray, shape (n, k), optional
        What one standard error of each thing that errs for all samples together does to their values.
    """

    time_s: FloatArray
    value: FloatArray
    spread: FloatArray
    stated: float = 0.0
    pulled: float = 0.0
    drive: FloatArray | None = None
    drive_std: float = 0.0
    common: FloatArray | None = None

    def part(self, chosen: slice) -> Self:
        """Return some of the samples."""
        return replace(
            self,
            time_s=self.time_s[chosen],
            value=self.value[chosen],
            spread=self.spread[chosen],
            drive=None if self.drive is None else self.drive[chosen],
            common=None if self.common is None else self.common[chosen],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Softening:
    """What geometry says of the softening before the fit: a normal prior; held where the decay contradicts it.

    `doubt` is by how much it does: the softening is wrong by that, or the decay shows something else beside it.
    """

    mean: float
    std: float
    held: bool = False
    doubt: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayFit:
    """A fitted decay.

    Parameters
    ----------
    parameters : ndarray, shape (11 + 4 k,)
        In the order of `tagsway.modal.decay`.
    terms : Terms
        Which of them were fitted.
    residual : ndarray, shape (n,)
        In the signal's unit.
    scale : float
        Standard deviation of the median sample's noise, spikes left aside.
    covariance : ndarray, shape (11 + 4 k, 11 + 4 k)
        With the residual's colour paid for; zero where nothing was fitted.
    common : ndarray, shape (11 + 4 k, m)
        Of which what errs for all samples together, a codec's drag first: its square is a part of the covariance.
    bound : ndarray, shape (11 + 4 k, 11 + 4 k)
        Cramér-Rao bound for white noise of this scale.
    inflation : float
        The residual's power density at ω_d over that of white noise.
    freedom : float
        Degrees of freedom that the colour leaves.
    error_freedom : float
        Degrees of freedom of the noise at ω_d, as far as it is known: Student's, for the intervals.
    deviance : float
        Robust -2 ln likelihood but for a constant, at `scale` of the first model.
    rate_ci95 : tuple of float, optional
        95 % interval of α, where it is not a normal distribution's.
    """

    parameters: FloatArray
    terms: Terms
    residual: FloatArray
    scale: float
    covariance: FloatArray
    common: FloatArray
    bound: FloatArray
    inflation: float
    freedom: float
    error_freedom: float
    deviance: float
    rate_ci95: tuple[float, float] | None = None
