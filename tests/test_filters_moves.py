"""When a tool moves: the same answer for the window, the indicators and the pendulum."""

import numpy as np
import pytest

from tagsway.filters.moves import find_moves
from tagsway.model import FloatArray, Window

TIME = np.arange(1200) / 200
START_S, TRAVEL_M, ACCELERATION = 0.5, 0.6, 4.0
END_S = START_S + 2 * np.sqrt(TRAVEL_M / ACCELERATION)
NEAR = 0.02
"""Discretisation: four samples, over which a speed of 1 % of the top is reached."""


def go(start: float = START_S, travel: float = TRAVEL_M, acceleration: float = ACCELERATION) -> FloatArray:
    half = np.sqrt(travel / acceleration)
    t = np.clip(TIME - start, 0, 2 * half)
    x = np.where(t < half, acceleration * t**2 / 2, travel - acceleration * (2 * half - t) ** 2 / 2)
    return np.column_stack([x, 0.1 * x])


def moves(path: FloatArray, *, least: float = 0.005, noise: float = 2e-3) -> list[Window]:
    """Return what is found from the path's velocity under noise like that of a smoothed track."""
    velocity = np.gradient(path, TIME, axis=0) + noise * np.random.default_rng(1).standard_normal(path.shape)
    return list(find_moves(TIME, path, velocity, least=least))


def ring(size: float, decay: float) -> FloatArray:
    since = np.maximum(TIME - END_S, 0)
    return np.column_stack([size * np.exp(-decay * since) * np.sin(2 * np.pi * 36 * since), 0 * since])


@pytest.mark.parametrize("size", [0.0, 3e-4, 2e-3])
def test_a_move_ends_where_its_ringing_begins(size: float) -> None:
    (found,) = moves(go() + ring(size, 2.0))
    assert found.start_s == pytest.approx(START_S, abs=NEAR)
    assert found.end_s == pytest.approx(END_S, abs=NEAR)


def test_a_slow_move_beside_a_quick_one_is_seen() -> None:
    slow = np.column_stack([np.interp(TIME, [3, 4], [0, 0.03]), 0 * TIME])
    first, second = moves(go() + slow)
    assert first.end_s == pytest.approx(END_S, abs=NEAR)
    assert (second.start_s, second.end_s) == pytest.approx((3, 4), abs=NEAR)


def test_a_short_stop_belongs_to_the_move_and_a_long_one_divides_it() -> None:
    length = END_S - START_S
    assert len(moves(go() + go(END_S + 0.15))) == 1
    (joined,) = moves(go() + go(END_S + 0.15))
    assert joined.end_s == pytest.approx(END_S + 0.15 + length, abs=NEAR)
    assert len(moves(go() + go(END_S + 0.4))) == 2


def test_out_and_back_is_a_move_although_it_ends_where_it_began() -> None:
    (found,) = moves(go() - go(END_S))
    assert found.end_s == pytest.approx(2 * END_S - START_S, abs=NEAR)


@pytest.mark.parametrize("speed", [0.0, 0.001, 0.004])
def test_a_drift_is_no_move_and_does_not_prolong_one(speed: float) -> None:
    drift = np.column_stack([speed * TIME, 0 * TIME])
    assert moves(drift) == []
    (found,) = moves(go() + drift)
    assert found.end_s == pytest.approx(END_S, abs=2 * NEAR)


def test_a_tool_that_comes_back_elsewhere_has_moved() -> None:
    path = go()
    path[(START_S - 0.1 < TIME) & (END_S + 0.1 > TIME)] = np.nan
    (found,) = moves(path)
    assert found.start_s < START_S
    assert found.end_s > END_S


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_nothing_moves_where_nothing_is_seen(value: float) -> None:
    assert moves(np.full((len(TIME), 2), value), noise=0.0) == []
