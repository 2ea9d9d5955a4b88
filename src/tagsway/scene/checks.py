"""What the parts of a scene share."""

import math

from tagsway.errors import InputError

Pair = tuple[float, float]


def check(
    part: object,
    *,
    positive: tuple[str, ...] = (),
    not_negative: tuple[str, ...] = (),
    finite: tuple[str, ...] = (),
) -> None:
    """Raise InputError where one of these fields is not what it must be; None passes."""
    for names, low, words in (
        (positive, lambda v: v > 0, "a positive number"),
        (not_negative, lambda v: v >= 0, "0 or more"),
        (finite, lambda v: True, "finite"),
    ):
        for name in names:
            given = getattr(part, name)
            values = given if isinstance(given, tuple) else () if given is None else (given,)
            for value in values:
                if not (math.isfinite(value) and low(value)):
                    raise InputError(f"{name} must be {words}, not {value:g}")
