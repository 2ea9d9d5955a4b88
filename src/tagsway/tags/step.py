"""A Gauss-Newton step from image to pose, compiled as one: the interpreter's lock is given up once for all of it."""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types

from tagsway.compiled import compile_whole, number_sources
from tagsway.model import FloatArray
from tagsway.tags import seeing, solving

see, solve = seeing.see, solving.solve


@cache
def load_step() -> Callable[..., FloatArray]:
    """Return the compiled function that takes a step.

    Returns
    -------
    callable
        Takes the arguments of `tagsway.tags.seeing.see`, and whether the sandwich is wanted; returns what
        `tagsway.tags.solving.solve` does.
    """
    double, single = types.float64, types.float32
    grey = types.Array(types.uint8, 2, "A", readonly=True)
    homography = types.Array(double, 2, "A", readonly=True)
    texture = printed = streak = types.Array(single, 2, "C", readonly=True)
    given = (grey, homography, texture, printed, double, double, double, streak, types.boolean)
    return compile_whole(_write_step(number_sources(seeing, solving)), given, without_lock=True)


def _write_step(sources: int) -> Callable[..., Any]:
    def step(grey, homography, texture, printed, half_width, known_width, scale, streak, with_blocks):
        assert sources  # what a function closes over is in the key of its cache: see `number_sources`
        planes, rows, width = see(grey, homography, texture, printed, half_width, known_width, scale, streak)
        return solve(planes, rows, width, homography, scale, with_blocks)

    return step
