"""What a faster, shaped move can take the place of: the question of document 1's section 8.2."""

from collections.abc import Mapping, Sequence
from math import inf

from tagsway.model import ConditionSummary, Exchange

MOTION, OVERSHOOT, LOAD = "motion_time_s", "overshoot_percent", "max_pcp_acceleration_m_s2"


def find_exchanges(
    summaries: Sequence[ConditionSummary],
    conditions: Sequence[str],
    groups: Sequence[str],
    *,
    bounds_s: Mapping[str, float],
) -> tuple[Exchange, ...]:
    """Find, for the reference in each group, the quickest of each other condition that overshoots no more.

    Parameters
    ----------
    summaries : sequence of ConditionSummary
        Of all groups.
    conditions, groups : sequence of str
        The first condition is the reference.
    bounds_s : mapping of float
        By group: for how long moves of the reference that never settled were watched; what takes longer is not known
        to be no slower.

    Returns
    -------
    tuple of Exchange
        Empty for a single group. By the medians alone: whether a difference is significant, only a comparison within
        one group says.
    """
    medians = {(s.group, s.condition, s.quantity): s.median for s in summaries}
    found = []
    for place in groups if len(groups) > 1 else ():
        before = {name: medians.get((place, conditions[0], name)) for name in (MOTION, OVERSHOOT, LOAD)}
        slow, swing, load = before[MOTION], before[OVERSHOOT], before[LOAD]
        if swing is None:
            continue
        longest = min(inf if slow is None else slow, bounds_s.get(place, inf))
        for condition in conditions[1:]:
            able = [
                (motion, group, overshoot)
                for group in groups
                if (motion := medians.get((group, condition, MOTION))) is not None
                and (overshoot := medians.get((group, condition, OVERSHOOT))) is not None
                and overshoot <= swing
                and motion <= longest
            ]
            if not able:
                continue
            motion, group, overshoot = min(able, key=lambda each: each[0])
            pushed = medians.get((group, condition, LOAD))
            found.append(
                Exchange(
                    reference_group=place,
                    condition=condition,
                    group=group,
                    reference_motion_time_s=slow,
                    motion_time_s=motion,
                    reference_overshoot_percent=swing,
                    overshoot_percent=overshoot,
                    gentler=load is not None and pushed is not None and pushed <= load,
                )
            )
    return tuple(found)
