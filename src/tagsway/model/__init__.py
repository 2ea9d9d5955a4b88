"""The types that pass between the rooms, in the order in which the data flow.

Light comes in as a `Frame`; a tag in it is a `Detection`, then a `Sighting`; over all frames the sightings are
`Sightings`, in metres a `Track`, without spikes a `CleanTrack`. Its free decay, inside a `Window`, gives a
`ModalEstimate`, the whole of it a `PendulumEstimate`. For the `Mode` found a `Shaper` is designed; laid over a `Move`
it makes a `Trajectory`. A `Result` is all that one measurement told.

Every type is frozen, checked once when it is made, and holds SI units and radians; a field that is not SI says so in
its name. No type computes anything that a stage should, and none opens a file.
"""

from tagsway.model.arrays import BoolArray, FloatArray, GreyArray, IntArray
from tagsway.model.camera import Camera, PlaneView, SeenTag
from tagsway.model.curves import (
    Curves,
    DecayCurve,
    PendulumCurve,
    ResidualCurve,
    SpectrumCurve,
    TrackCurve,
    TrajectoryCurve,
)
from tagsway.model.estimate import Estimate, Notice
from tagsway.model.indicators import Indicators, PeakAcceleration, ResidualAcceleration
from tagsway.model.modal import (
    BackbonePoint,
    Bound,
    Estimates,
    EstimatorResult,
    ModalEstimate,
    Mode,
    ModeEstimate,
    Window,
)
from tagsway.model.move import ArcThrough, Limits, Move, Robot
from tagsway.model.pendulum import GRAVITY_M_S2, Implied, Pendulum, PendulumEstimate
from tagsway.model.result import (
    CoordinateFrame,
    Creator,
    Result,
    Source,
    TagsSummary,
    TagSummary,
)
from tagsway.model.settings import Settings
from tagsway.model.shaper import DesignMode, DigitalFilter, Impulse, Residual, Shaper, Spread
from tagsway.model.tags import Detection, Sighting, Sightings, TagSightings
from tagsway.model.track import SCALE_STD, CleanTagTrack, CleanTrack, TagTrack, Track
from tagsway.model.trajectory import JointPath, SampledTrajectory, Trajectory
from tagsway.model.video import Frame, Progress, VideoInfo

__all__ = [
    "GRAVITY_M_S2",
    "SCALE_STD",
    "ArcThrough",
    "BackbonePoint",
    "BoolArray",
    "Bound",
    "Camera",
    "CleanTagTrack",
    "CleanTrack",
    "CoordinateFrame",
    "Creator",
    "Curves",
    "DecayCurve",
    "DesignMode",
    "Detection",
    "DigitalFilter",
    "Estimate",
    "Estimates",
    "EstimatorResult",
    "FloatArray",
    "Frame",
    "GreyArray",
    "Implied",
    "Impulse",
    "Indicators",
    "IntArray",
    "JointPath",
    "Limits",
    "ModalEstimate",
    "Mode",
    "ModeEstimate",
    "Move",
    "Notice",
    "PeakAcceleration",
    "Pendulum",
    "PendulumCurve",
    "PendulumEstimate",
    "PlaneView",
    "Progress",
    "Residual",
    "ResidualAcceleration",
    "ResidualCurve",
    "Result",
    "Robot",
    "SampledTrajectory",
    "SeenTag",
    "Settings",
    "Shaper",
    "Sighting",
    "Sightings",
    "Source",
    "SpectrumCurve",
    "Spread",
    "TagSightings",
    "TagSummary",
    "TagTrack",
    "TagsSummary",
    "Track",
    "TrackCurve",
    "Trajectory",
    "TrajectoryCurve",
    "VideoInfo",
    "Window",
]
