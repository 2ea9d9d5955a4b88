"""Many measurements of one quantity: outliers, scatter, and where it comes from. Pure functions on arrays.

outliers     ±3σ, Grubbs, generalised ESD
spread       medians, ± deviation, the share of one factor
effects      what differs between repeats against the error of each
differences  two sets of repeats against each other
factors      what was varied, and what it does
blocks       factors as columns, and which cannot be told apart
"""

from tagsway.repeats.differences import adjust_holm, compare_repeats, rate_gain, share_interval
from tagsway.repeats.effects import between_repeat_spread, fit_random_effects
from tagsway.repeats.factors import fit_factor_effects
from tagsway.repeats.outliers import grubbs_limit, reject_beyond_sigma, reject_by_esd, reject_by_grubbs
from tagsway.repeats.spread import deviation_percent, factor_share, pool_shares, summarise_repeats

__all__ = [
    "adjust_holm",
    "between_repeat_spread",
    "compare_repeats",
    "deviation_percent",
    "factor_share",
    "fit_factor_effects",
    "fit_random_effects",
    "grubbs_limit",
    "pool_shares",
    "rate_gain",
    "reject_beyond_sigma",
    "reject_by_esd",
    "reject_by_grubbs",
    "share_interval",
    "summarise_repeats",
]
