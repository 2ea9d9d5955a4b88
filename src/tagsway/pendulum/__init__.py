"""The fit of a pendulum (l, r, k, b) to a track, and what it cannot know."""

from tagsway.pendulum.arc import Arc, fit_arc
from tagsway.pendulum.estimate import PendulumFit, fit_pendulum

__all__ = ["Arc", "PendulumFit", "fit_arc", "fit_pendulum"]
