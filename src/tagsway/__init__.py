"""Film a payload that carries two AprilTags, get a motion that leaves it at rest."""

__version__ = "0.1.0"
