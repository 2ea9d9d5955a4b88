"""The streak that a motion draws while an image is exposed, as a kernel."""

import math
from functools import lru_cache

import numpy as np

from tagsway.model import FloatArray
from tagsway.tags.template import Float32Array

_MOTION_STEPS = 8  # to a pixel: a sixteenth more or less of motion changes no pixel by a grey level
_MOST_MOTION_PX = 16.0
_LEAST = 0.001  # a smaller weight changes no pixel by a grey level, and costs as much as others


def find_streak(motion_px: tuple[float, float]) -> Float32Array:
    """Return the kernel of a motion, to and fro alike, from those that are known already."""
    right, down = (round(_MOTION_STEPS * part) for part in motion_px)
    return _streak(-right, -down) if right < 0 else _streak(right, down)


@lru_cache(maxsize=1024)
def _streak(right: int, down: int) -> Float32Array:
    """Return the kernel of a motion: a line in cubic interpolation (Keys), which keeps parabolas."""
    length = math.hypot(right, down) / _MOTION_STEPS
    motion = [part / _MOTION_STEPS * min(1.0, _MOST_MOTION_PX / length) for part in (right, down)]
    steps = math.ceil(2 * length) + 2
    shares = (np.arange(steps) + 0.5) / steps - 0.5
    columns, rows = (_interpolate(part * shares, math.ceil(abs(part) / 2) + 1) for part in motion)
    streak = rows.T @ columns / steps
    streak[np.abs(streak) < _LEAST] = 0.0
    return np.asarray(streak / streak.sum(), dtype=np.float32)


def _interpolate(places: FloatArray, reach: int) -> FloatArray:
    """Return the weights of the pixels -reach .. reach in a value between them, shape (places, 2 reach + 1)."""
    off = np.abs(np.arange(-reach, reach + 1) - places[:, None])
    near = (1.5 * off - 2.5) * off * off + 1
    far = ((-0.5 * off + 2.5) * off - 4) * off + 2
    weights: FloatArray = np.where(off < 1, near, np.where(off < 2, far, 0.0))
    return weights
