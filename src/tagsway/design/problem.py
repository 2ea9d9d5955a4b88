"""The constraints of an optimised move: the robot's, and those of every payload of a small ensemble."""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from tagsway.criteria import RIM_M
from tagsway.design.limits import DesignLimits
from tagsway.design.motion import Swing, longest_step_s, product_acceleration, product_sway, simulate_swing, tail_s
from tagsway.design.payload import Payloads, PayloadSpread, corner_payloads
from tagsway.design.transcription import PHASES, Layout
from tagsway.model import GRAVITY_M_S2, FloatArray, Move
from tagsway.trajectories import plan_move

STEP_S = 6e-3
"""Coarser nodes hide 22 to 29 m/s² between them."""

CELLS = (4, 16, 4)
SMOOTH_CELLS = (6, 18, 6)
"""In lift, carry and lower; of a limited jerk, whose cells hold ramps."""

FREQUENCIES, DAMPINGS = 7, 2
"""Of the ensemble that is a constraint; between them the check looks."""

CHECKED_FREQUENCIES, CHECKED_DAMPINGS = 41, 5

FUNNEL = 2.0
"""Above the rim of the box its room widens by so much a metre, so that no constraint jumps there."""

LONGEST_PHASE_S, SHORTEST_PHASE_S = 3.0, 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimiserSettings:
    """What an optimised move must keep besides the limits of the design.

    Parameters
    ----------
    swing_rad : float
        Largest |q|: beyond it the model is doubtful.
    least_lift_m_s2 : float
        Lowest z'', above -g: below it a product that hangs is thrown.
    frequency_share, damping_share : float
        Of the spread, its middle: every payload in it must keep the limits.
    iterations : int
        Of SLSQP, in each round.
    """

    swing_rad: float = math.radians(45)
    least_lift_m_s2: float = -0.8 * GRAVITY_M_S2
    frequency_share: float = 0.95
    damping_share: float = 0.87
    iterations: int = 150


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Limits as the optimiser sees them, tightened by what a finer look found."""

    placement_m: float
    pcp_m_s2: float
    swing_rad: float
    ceiling_m: float
    box_error_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One transcription: unknowns, payloads, limits; all constraints of many vectors in one run.

    `boxed` is whether the box is a constraint: one that is kept anyway slows the search down tenfold.
    """

    layout: Layout
    payloads: Payloads
    checked: Payloads
    bounds: Bounds
    limits: DesignLimits
    heights_m: tuple[float, float]
    least_lift_m_s2: float
    iterations: int
    counts: tuple[int, int, int] = (5, 11, 5)
    fixed_s: FloatArray | None = None
    boxed: bool = False

    @classmethod
    def of(cls, move: Move, spread: PayloadSpread, limits: DesignLimits, wish: OptimiserSettings) -> Self:
        """Return the problem of a move, for the middle of a spread."""
        linear = limits.jerk_m_s3 is not None
        cells = SMOOTH_CELLS if linear else CELLS
        layout = Layout(
            cells=cells,
            fractions=tuple(np.arange(1, n + 1) / n for n in cells),
            linear=linear,
            start_m=np.array(move.from_m, dtype=float),
            end_m=np.array(move.to_m, dtype=float),
            scale_s=0.3,
            scale_m_s2=limits.acceleration_m_s2 or 20.0,
        )
        band = (wish.frequency_share, wish.damping_share)
        vertical = max(limits.vertical_m, 1e-3)
        return cls(
            layout=layout,
            payloads=corner_payloads(spread, frequencies=FREQUENCIES, dampings=DAMPINGS, shares=band),
            checked=corner_payloads(spread, frequencies=CHECKED_FREQUENCIES, dampings=CHECKED_DAMPINGS, shares=band),
            bounds=Bounds(
                placement_m=limits.placement_window_m,
                pcp_m_s2=limits.pcp_acceleration_m_s2 or math.inf,
                swing_rad=wish.swing_rad,
                ceiling_m=math.inf if limits.box_m is None else limits.box_m[1][2] - move.from_m[2],
                box_error_m=math.inf if limits.box_error_m is None else limits.box_error_m,
            ),
            limits=limits,
            # What goes into a box is above its place before it passes the rim.
            heights_m=(vertical, vertical if limits.box_error_m is None else max(vertical, RIM_M)),
            least_lift_m_s2=wish.least_lift_m_s2,
            iterations=wish.iterations,
        )

    def start(self, move: Move, acceleration_m_s2: float) -> FloatArray:
        """Return the reference move at an acceleration as a vector."""
        pick, place = self.heights_m
        reference = replace(
            move,
            profile="pick-and-place",
            pick_height_m=pick,
            place_height_m=place,
            max_acceleration_m_s2=acceleration_m_s2,
            max_jerk_m_s3=None,
            max_velocity_m_s=None,
            run_time_s=None,
            shaped_axes=(),
            waypoints_m=(),
        )
        trajectory = plan_move(reference)
        across = np.flatnonzero(np.abs(trajectory.coefficients[:, 1:, :2]).max(axis=(1, 2)) > 1e-9)
        edges = trajectory.breaks_s[[0, across[0], across[-1] + 1, -1]]
        return self.layout.vector_of(trajectory, edges)

    def on_grid(self, vector: FloatArray, sample_time_s: float) -> Self:
        """Return the problem with its phases, and the cells in them, on whole samples."""
        lasting = self.layout.durations(vector)
        samples = np.ceil(lasting / sample_time_s - 1e-6).astype(int)
        samples = np.maximum(samples, self.layout.cells)
        fractions = tuple(
            np.round(np.arange(1, n + 1) * count / n) / count
            for n, count in zip(self.layout.cells, samples.tolist(), strict=True)
        )
        layout = replace(self.layout, fractions=fractions)
        return replace(self, layout=layout, fixed_s=samples * sample_time_s)

    def adopt(self, vector: FloatArray) -> FloatArray:
        """Return a vector with the durations that are fixed here."""
        adopted = vector.copy()
        if self.fixed_s is not None:
            adopted[:PHASES] = self.fixed_s / self.layout.scale_s
        return adopted

    def equalities(self, vectors: FloatArray) -> FloatArray:
        """Return what must vanish: the end across and its speed, the end's height and its speed, shape (..., 4)."""
        position, velocity = self.layout.states(vectors)
        length = float(np.linalg.norm(self.layout.way))
        rise = float(self.layout.end_m[2] - self.layout.start_m[2])
        end, speed = position[..., -1, :], velocity[..., -1, :]
        return np.concatenate([(end - [length, rise]) / 0.1, speed], axis=-1)

    def inequalities(self, vectors: FloatArray) -> FloatArray:
        """Return what must not be negative, shape (n, k)."""
        return np.concatenate([self._robot(vectors), self._payload(vectors)], axis=-1)

    def _robot(self, vectors: FloatArray) -> FloatArray:
        layout, limits = self.layout, self.limits
        position, _ = layout.states(vectors)
        rise = float(layout.end_m[2] - layout.start_m[2])
        first, last = layout.cells[0], layout.cells[0] + layout.cells[1]
        middle = (first + last) // 2
        z = position[..., 1]
        kept = [
            (z[..., first : middle + 1] - self.heights_m[0]) / 0.1,
            (z[..., middle : last + 1] - rise - self.heights_m[1]) / 0.1,
            (z[..., 1:first] + 1e-9) / 0.1,
            (z[..., last + 1 : -1] - rise + 1e-9) / 0.1,
        ]
        low, high = layout.accelerations(vectors)
        squares = np.sum(np.concatenate([low, high[..., -1:, :]], axis=-2) ** 2, axis=-1)
        if limits.acceleration_m_s2 is not None:
            kept.append((1 - squares / limits.acceleration_m_s2**2)[..., : None if layout.linear else -1])
        if limits.jerk_m_s3 is not None:
            step = np.diff(layout.breaks(vectors), axis=-1)
            kept.append(1 - np.sum((high - low) ** 2, axis=-1) / (step * limits.jerk_m_s3) ** 2)
        if limits.velocity_m_s is not None:
            _, inside, _ = layout.within(vectors, np.array([0.5, 1.0]))
            kept.append((1 - np.sum(inside**2, axis=-1) / limits.velocity_m_s**2).reshape(len(vectors), -1))
        if math.isfinite(self.bounds.ceiling_m):
            kept.append((self.bounds.ceiling_m - self._peaks(vectors)) / 0.1)
        return np.concatenate(kept, axis=-1)

    def _peaks(self, vectors: FloatArray) -> FloatArray:
        """Return the height at the breaks and in the middle of the carry's cells."""
        position, velocity = self.layout.states(vectors)
        low, high = self.layout.accelerations(vectors)
        step = np.diff(self.layout.breaks(vectors), axis=-1) / 2
        mid = position[..., :-1, 1] + velocity[..., :-1, 1] * step + (5 * low + high)[..., 1] / 12 * step**2
        carry = slice(self.layout.cells[0], self.layout.cells[0] + self.layout.cells[1])
        return np.concatenate([position[..., carry, 1], mid[..., carry]], axis=-1)

    def _payload(self, vectors: FloatArray) -> FloatArray:
        """Return the payload's constraints; vectors that share their durations are simulated together."""
        results = np.empty((len(vectors), 0))
        keys = vectors[:, :PHASES]
        for key in np.unique(keys, axis=0):
            rows = np.flatnonzero(np.all(keys == key, axis=1))
            found = self._simulate(vectors[rows])
            if results.shape[1] == 0:
                results = np.empty((len(vectors), found.shape[1]))
            results[rows] = found
        return results

    def _simulate(self, vectors: FloatArray) -> FloatArray:
        layout, payloads = self.layout, self.payloads
        copies, m = len(vectors), len(payloads)
        lengths = np.diff(layout.breaks(vectors[0]))
        parts, steps = [], []
        for cells, count in self._phases():
            _, velocity, _ = layout.within(vectors, np.arange(2 * count) / (2 * count))
            parts.append(velocity[:, cells].reshape(copies, -1, 2))
            steps.append(np.repeat(lengths[cells] / count, count))
        tail = tail_s(payloads)
        resting = math.ceil(tail / min(STEP_S, longest_step_s(payloads)))
        time_s = np.concatenate([[0.0], np.cumsum(np.concatenate([*steps, np.full(resting, tail / resting)]))])
        drive = np.zeros((2 * len(time_s) - 1, 2, copies))
        moving = np.concatenate(parts, axis=1)
        drive[: moving.shape[1]] = moving.transpose(1, 2, 0)
        return self._constraints(vectors, simulate_swing(payloads, time_s, np.repeat(drive, m, axis=-1)))

    def _constraints(self, vectors: FloatArray, swing: Swing) -> FloatArray:
        copies, m = len(vectors), len(self.payloads)
        node, kept = 0, []
        for cells, count in self._phases():
            held = cells.stop - cells.start
            place, _, push = self.layout.within(vectors, np.linspace(0, 1, count + 1))
            index = (node + np.arange(held)[:, None] * count + np.arange(count + 1)).ravel()
            pivot = np.repeat(push[:, cells].transpose(1, 2, 3, 0).reshape(-1, 2, copies), m, axis=-1)
            held_swing = swing.take(index)
            acceleration = product_acceleration(held_swing, pivot, self.payloads, copies=copies)
            # The largest in each cell of each payload: some hundred constraints rather than twenty thousand.
            shape = (held, count + 1, copies, m)
            kept.append(1 - np.abs(acceleration).reshape(shape).max(axis=1) / self.bounds.pcp_m_s2)
            kept.append(self.bounds.swing_rad - np.abs(held_swing.angle_rad).reshape(shape).max(axis=1))
            node += held * count
        if self.boxed:
            heights = np.repeat(place[:, cells, :, 1].transpose(1, 2, 0).reshape(-1, copies), m, axis=-1)
            rooms = self._rooms_in_box(heights, held_swing)
            kept.extend(room.reshape(shape).min(axis=1) / 0.01 for room in rooms)
        away = product_sway(swing.take(slice(node, None)), self.payloads, copies=copies).reshape(-1, copies, m)
        window = min(self.bounds.placement_m, self.bounds.box_error_m) if self.boxed else self.bounds.placement_m
        kept.extend((window - side.max(axis=0)[None]) / 0.01 for side in (away, -away))
        return np.concatenate([each.transpose(1, 0, 2).reshape(copies, -1) for each in kept], axis=-1)

    def _rooms_in_box(self, tool_m: FloatArray, swing: Swing) -> tuple[FloatArray, FloatArray]:
        """Return the product's room on either side of the box while the tool is lowered, each (n, m copies)."""
        copies = swing.angle_rad.shape[1] // len(self.payloads)
        lifted = np.tile(self.payloads.tag_radius_m, copies) * (1 - np.cos(swing.angle_rad))
        over = tool_m - (self.layout.end_m[2] - self.layout.start_m[2]) + lifted - RIM_M
        sway = product_sway(swing, self.payloads, copies=copies)
        room = self.bounds.box_error_m + FUNNEL * np.maximum(over, 0.0)
        return room - sway, room + sway

    def _phases(self) -> list[tuple[slice, int]]:
        """Return the cells of each phase, and how many steps each of them takes."""
        ends = np.cumsum(self.layout.cells).tolist()
        return [
            (slice(end - n, end), count) for end, n, count in zip(ends, self.layout.cells, self.counts, strict=True)
        ]

    def with_steps_for(self, vector: FloatArray) -> Self:
        """Return the problem with steps of 6 ms at these durations, counted once: else differences would jump."""
        lengths = self.layout.durations(vector) / np.array(self.layout.cells)
        step = min(STEP_S, longest_step_s(self.payloads))
        first, carry, last = (max(math.ceil(each / step), 2) for each in lengths.tolist())
        return replace(self, counts=(first, carry, last))

    def variable_bounds(self) -> list[tuple[float, float]]:
        """Return the range of every unknown."""
        scale = self.layout.scale_s
        if self.fixed_s is not None:
            head = [(t / scale, t / scale) for t in self.fixed_s.tolist()]
        else:
            head = [(SHORTEST_PHASE_S / scale, LONGEST_PHASE_S / scale)] * PHASES
        floor = max(self.least_lift_m_s2 / self.layout.scale_m_s2, -1.0)
        return [*head, *[(-1.0, 1.0)] * self.layout.across, *[(floor, 1.0)] * self.layout.upward]
