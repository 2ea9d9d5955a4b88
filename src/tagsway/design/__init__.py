"""Design: the quickest move that keeps its limits over the payloads that were measured, and what corrects it.

`read_limits` takes them from a move and options, `PayloadSpread` says how payloads vary, `design_move` tries every
shaper on every axis at every acceleration and says which to take; `optimise_move` makes a move for the pendulum itself.
`retune_shaper` corrects a shaper by what a second video shows that it left.
"""

from tagsway.design.advice import (
    Advice,
    BeyondBand,
    CheckedOptimum,
    DesignTask,
    describe,
    design_move,
    design_shapers,
    draw_settings,
    find_candidates,
)
from tagsway.design.limits import DesignLimits, read_limits
from tagsway.design.motion import Outcome, simulate_motion
from tagsway.design.optimise import OptimisedMove, optimise_move
from tagsway.design.payload import (
    FurtherMode,
    Payloads,
    PayloadSpread,
    corner_payloads,
    draw_payloads,
    make_payloads,
    sample_payloads,
)
from tagsway.design.problem import OptimiserSettings
from tagsway.design.residual import PriorPayload, ResidualRecord
from tagsway.design.retune import Retuned, retune_shaper
from tagsway.design.search import Candidate, SearchSettings, Verdict, search_candidate

__all__ = [
    "Advice",
    "BeyondBand",
    "Candidate",
    "CheckedOptimum",
    "DesignLimits",
    "DesignTask",
    "FurtherMode",
    "OptimisedMove",
    "OptimiserSettings",
    "Outcome",
    "PayloadSpread",
    "Payloads",
    "PriorPayload",
    "ResidualRecord",
    "Retuned",
    "SearchSettings",
    "Verdict",
    "corner_payloads",
    "describe",
    "design_move",
    "design_shapers",
    "draw_payloads",
    "draw_settings",
    "find_candidates",
    "make_payloads",
    "optimise_move",
    "read_limits",
    "retune_shaper",
    "sample_payloads",
    "search_candidate",
    "simulate_motion",
]
