"""Many payloads under many moves: `simulate_moves` of `Trajectory`s and a `Payload`, in one call.

`hang_pendulums` takes pendulums as they are, `pendulum_of_mode` a frequency and a damping, `vary_modes` spreads both,
`add_second_body` hangs a light body from the first. `SimulatedMotion.judge` says how each ended.
"""

from tagsway.simulation.drive import Drive, plan_drive
from tagsway.simulation.motion import SimulatedMotion, longest_step, simulate_moves
from tagsway.simulation.payload import Payload, add_second_body, hang_pendulums, pendulum_of_mode, vary_modes

__all__ = [
    "Drive",
    "Payload",
    "SimulatedMotion",
    "add_second_body",
    "hang_pendulums",
    "longest_step",
    "pendulum_of_mode",
    "plan_drive",
    "simulate_moves",
    "vary_modes",
]
