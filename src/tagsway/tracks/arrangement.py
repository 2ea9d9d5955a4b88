"""Whether the tags are where, and as large as, tags of a tool and of what hangs from it can be."""

import math

import numpy as np

from tagsway.model import Notice, Settings, Track

MOST_APART = 1.15
"""Of the tags' scales in mm to a pixel: one of them would be as much farther from the camera."""

BELOW_RAD = math.radians(60.0)
"""A product hangs from its tool, if not quite plumb; beyond, ids or the image's up are the likelier explanation."""

ARRANGEMENT_CODES = frozenset({"tags_misplaced", "tag_sizes_suspect"})


def judge_arrangement(track: Track, settings: Settings) -> tuple[Notice, ...]:
    """Say where the ids of the tags, the way up, or their sizes look mistaken.

    Parameters
    ----------
    track : Track
        Of both tags.
    settings : Settings
        What the user said of them.

    Returns
    -------
    tuple of Notice
        `tags_misplaced` where the product is beside or above its tool most of the time, `tag_sizes_suspect` where the
        sizes that were stated put the tags at very different depths. Hints, never a refusal.
    """
    if track.tcp is None:
        return ()
    tool, product = track.tcp.scale_mm_per_px, track.pcp.scale_mm_per_px
    apart = 1.0 if tool is None or product is None else max(tool.value / product.value, product.value / tool.value)
    if tool is not None and product is not None and apart > MOST_APART:
        message = (
            f"with the sizes stated the tool's tag is seen at {tool.value:.3g} mm/px and the product's at "
            f"{product.value:.3g}, as if one hung {100 * (apart - 1):.0f} % farther off: are the sizes of both tags "
            "right (--tcp-tag-size, --pcp-tag-size)?"
        )
        return (Notice(code="tag_sizes_suspect", message=message),)
    right, up = np.moveaxis(track.pcp.position - track.tcp.position, -1, 0)
    seen = np.isfinite(right + up)
    angle = float(np.median(np.abs(np.arctan2(right[seen], -up[seen])))) if seen.any() else 0.0
    if not angle > BELOW_RAD:
        return ()
    message = (
        f"the product's tag {settings.pcp_id} is {'above' if angle > math.pi - BELOW_RAD else 'beside'} the tool's tag "
        f"{settings.tcp_id}: are --tcp-id and --pcp-id exchanged, or is the film turned (--up)?"
    )
    return (Notice(code="tags_misplaced", message=message),)
