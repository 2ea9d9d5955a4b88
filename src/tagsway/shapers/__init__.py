"""Input shapers and prefilters: designed for a mode, judged by the residual vibration they leave.

`design_shaper` makes one of `SHAPER_TYPES` for one mode, `design_multimode` one for several, `design_simultaneous` the
shortest for several, `given_shaper` takes impulses as they are written down. `compare_shapers` lists every candidate
with its price, `choose_shaper` takes the shortest that keeps a tolerance.

`residual_vibration` says what a shaper leaves on any mode, `residual_curve` over many frequencies, `insensitivity` how
wide the band is in which that is little, `residual_percentile` and `residual_of_sample` what repeats see;
`step_response`, `frequency_response` and `sensitivity_curves` are the curves that papers draw. `place_on_grid` puts
impulses on samples, `zero_delay_prices` shows what zero time delay costs.
"""

from tagsway.shapers.comparison import Comparison, ShaperPrice, choose_shaper, compare_shapers, price_shaper
from tagsway.shapers.design import IMPULSE_TYPES, SHAPER_TYPES, design_shaper, given_shaper
from tagsway.shapers.grid import GridCost, grid_costs, place_on_grid
from tagsway.shapers.insensitive import Band
from tagsway.shapers.multimode import design_multimode, design_simultaneous, kind_for_band
from tagsway.shapers.residual import (
    SampleResidual,
    insensitivity,
    overshoot_ratio,
    residual_curve,
    residual_of_sample,
    residual_percentile,
    residual_vibration,
)
from tagsway.shapers.response import (
    FrequencyResponse,
    SensitivityCurves,
    StepIndicators,
    StepResponse,
    centroid_delay,
    frequency_response,
    sensitivity_curves,
    step_indicators,
    step_response,
)
from tagsway.shapers.zero_delay import MotionPrice, apply_to_command, swing_after, zero_delay_prices

__all__ = [
    "IMPULSE_TYPES",
    "SHAPER_TYPES",
    "Band",
    "Comparison",
    "FrequencyResponse",
    "GridCost",
    "MotionPrice",
    "SampleResidual",
    "SensitivityCurves",
    "ShaperPrice",
    "StepIndicators",
    "StepResponse",
    "apply_to_command",
    "centroid_delay",
    "choose_shaper",
    "compare_shapers",
    "design_multimode",
    "design_shaper",
    "design_simultaneous",
    "frequency_response",
    "given_shaper",
    "grid_costs",
    "insensitivity",
    "kind_for_band",
    "overshoot_ratio",
    "place_on_grid",
    "price_shaper",
    "residual_curve",
    "residual_of_sample",
    "residual_percentile",
    "residual_vibration",
    "sensitivity_curves",
    "step_indicators",
    "step_response",
    "swing_after",
    "zero_delay_prices",
]
