"""The fit of a pendulum (l, r, k, b) to a track, and what it cannot know."""

from tagsway.pendulum.arc import Arc, fit_circle, fit_rotation
from tagsway.pendulum.estimate import PendulumFit, fit_pendulum

__all__ = ["Arc", "PendulumFit", "fit_circle", "fit_pendulum", "fit_rotation"]
