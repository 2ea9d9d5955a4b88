"""The fit of a pendulum (l, r, k, b) to a track, and what it cannot know."""

from tagsway.pendulum.arc import Arc, fit_arc
from tagsway.pendulum.estimate import PendulumFit, fit_pendulum
from tagsway.pendulum.two_masses import combine_masses

__all__ = ["Arc", "PendulumFit", "combine_masses", "fit_arc", "fit_pendulum"]
