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
from tagsway.model.comparison import (
    Comparison,
    ConditionCurves,
    ConditionSummary,
    Difference,
    Exchange,
    PickRate,
    Promise,
)
from tagsway.model.curves import (
    AmplitudeCurve,
    BackboneCurve,
    Curves,
    DecayCurve,
    ExcitationCurve,
    PendulumCurve,
    ResidualCurve,
    RidgeCurve,
    SpectrumCurve,
    TrackCurve,
    TrajectoryCurve,
)
from tagsway.model.estimate import NORMAL_95, Estimate, Notice
from tagsway.model.events import EVENT_WORDS, Event, EventKind
from tagsway.model.excitation import Excitation
from tagsway.model.impulse import Blow, BlowResult, ImpulseResult, ImpulseSpectra, PayloadDistance
from tagsway.model.indicators import AlignedMove, Indicators, PeakAcceleration, ResidualAcceleration
from tagsway.model.log import AlignedLog, ControllerLog, LogAgreement
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
from tagsway.model.pendulum import (
    GRAVITY_M_S2,
    Implied,
    ModalDeviation,
    Pendulum,
    PendulumEstimate,
    PointMassFit,
    Prior,
    TwoMasses,
)
from tagsway.model.plan import CameraHints, Need, Plan, PlannedError, PlannedMeasurement
from tagsway.model.repeats import (
    FactorEffect,
    FactorModel,
    RandomEffects,
    Rejection,
    RepeatDifference,
    RepeatSummary,
    Unanswered,
)
from tagsway.model.result import (
    CoordinateFrame,
    Creator,
    EstimatorDetails,
    Result,
    Source,
    TagsSummary,
    TagSummary,
)
from tagsway.model.settings import Settings
from tagsway.model.shaper import DesignMode, DigitalFilter, Impulse, Residual, Shaper, Spread
from tagsway.model.study import LimitRow, Pair, Quantity, StudyRow
from tagsway.model.tags import Detection, Sighting, Sightings, TagSightings
from tagsway.model.track import SCALE_STD, CleanTagTrack, CleanTrack, TagTrack, Track
from tagsway.model.trajectory import JointPath, SampledTrajectory, Trajectory
from tagsway.model.video import UNKNOWN_CODING, Coding, Frame, Progress, VideoInfo

__all__ = [
    "EVENT_WORDS",
    "GRAVITY_M_S2",
    "NORMAL_95",
    "SCALE_STD",
    "UNKNOWN_CODING",
    "AlignedLog",
    "AlignedMove",
    "AmplitudeCurve",
    "ArcThrough",
    "BackboneCurve",
    "BackbonePoint",
    "Blow",
    "BlowResult",
    "BoolArray",
    "Bound",
    "Camera",
    "CameraHints",
    "CleanTagTrack",
    "CleanTrack",
    "Coding",
    "Comparison",
    "ConditionCurves",
    "ConditionSummary",
    "ControllerLog",
    "CoordinateFrame",
    "Creator",
    "Curves",
    "DecayCurve",
    "DesignMode",
    "Detection",
    "Difference",
    "DigitalFilter",
    "Estimate",
    "Estimates",
    "EstimatorDetails",
    "EstimatorResult",
    "Event",
    "EventKind",
    "Exchange",
    "Excitation",
    "ExcitationCurve",
    "FactorEffect",
    "FactorModel",
    "FloatArray",
    "Frame",
    "GreyArray",
    "Implied",
    "Impulse",
    "ImpulseResult",
    "ImpulseSpectra",
    "Indicators",
    "IntArray",
    "JointPath",
    "LimitRow",
    "Limits",
    "LogAgreement",
    "ModalDeviation",
    "ModalEstimate",
    "Mode",
    "ModeEstimate",
    "Move",
    "Need",
    "Notice",
    "Pair",
    "PayloadDistance",
    "PeakAcceleration",
    "Pendulum",
    "PendulumCurve",
    "PendulumEstimate",
    "PickRate",
    "Plan",
    "PlaneView",
    "PlannedError",
    "PlannedMeasurement",
    "PointMassFit",
    "Prior",
    "Progress",
    "Promise",
    "Quantity",
    "RandomEffects",
    "Rejection",
    "RepeatDifference",
    "RepeatSummary",
    "Residual",
    "ResidualAcceleration",
    "ResidualCurve",
    "Result",
    "RidgeCurve",
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
    "StudyRow",
    "TagSightings",
    "TagSummary",
    "TagTrack",
    "TagsSummary",
    "Track",
    "TrackCurve",
    "Trajectory",
    "TrajectoryCurve",
    "TwoMasses",
    "Unanswered",
    "VideoInfo",
    "Window",
]
