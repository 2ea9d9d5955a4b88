"""A controller's log in place of the tool's tag."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import ControllerLog, FloatArray, LogAgreement, Notice, Robot, TagTrack, Track
from tagsway.pipeline.recording import Recording
from tagsway.robots import find_tool
from tagsway.store.sources.logs import read_log
from tagsway.store.tracks import quantise
from tagsway.tracks.alignment import align_log

SCALE_TOLERANCE = 0.01
"""A tag's printed side is known better than this."""

ENCODER_STD_M = 1e-5
"""What encoders and gears leave of a tool's position; its error as a whole is the offset's and the scale's."""


def follow_log(track: Track, file: Path, robot: Robot | None = None) -> tuple[Track, LogAgreement, tuple[Notice, ...]]:
    """Return a track whose tool moves as the controller says, and how that agrees with the tool's tag.

    Parameters
    ----------
    track : Track
        With the tool's tag, in metres.
    file : Path
        The log: the tool's position, or the joints.
    robot : Robot, optional
        With its lengths: needed for joints.

    Returns
    -------
    track : Track
        The log's position where it was written, else nothing (NaN); the tag's rotation is kept. Everything is in the
        log's scale: that of the tags is divided out of the product's path as well, or a scale that is off by 0.3 %
        would make a sway of 1 mm out of a move of 350 mm.
    agreement : LogAgreement
        Offset and rate of the clocks, and the rms against the tag.
    notices : tuple of Notice
        The comparison in words, and what is odd.
    """
    aligned = align_log(track, tool_of_log(read_log(file), robot))
    assert track.tcp is not None
    inside = np.isfinite(aligned.position)
    tool = replace(
        track.tcp, position=aligned.position, position_std=np.where(inside, ENCODER_STD_M, np.nan), image_share=1.0
    )
    agreement = aligned.agreement
    scale = agreement.scale.value
    both = inside.all(axis=1) & np.isfinite(track.tcp.position).all(axis=1)
    fixed = np.mean(track.tcp.position[both], axis=0)
    message = (
        f"the tool moves as {file.name} says: its tag differs by {1e3 * agreement.rms_m:.3g} mm rms "
        f"({1e3 * agreement.rms_scaled_m:.3g} mm with the tag's scale {agreement.scale.value:.4f} ± "
        f"{agreement.scale.std:.4f} of the log's), clocks {agreement.offset_s.value:.4f} ± "
        f"{agreement.offset_s.std:.4f} s apart, rate {agreement.rate.value:.5f} ± {agreement.rate.std:.5f}"
    )
    notices = [Notice(code="tool_from_log", message=message), *aligned.notices]
    if abs(scale - 1) > max(SCALE_TOLERANCE, 3 * agreement.scale.std):
        message = (
            f"the tags' scale is {scale:.4f} of the robot's: --tag-size should be {1 / scale:.4f} times what was given"
        )
        notices.append(Notice(code="log_scale_differs", message=message))
    product = _rescaled(track.pcp, scale, fixed)
    return quantise(replace(track, tcp=tool, pcp=product)), agreement, tuple(notices)


def _rescaled(tag: TagTrack, scale: float, fixed: FloatArray) -> TagTrack:
    return replace(tag, position=fixed + (tag.position - fixed) / scale, position_std=tag.position_std / scale)


def with_log(recording: Recording, file: Path, robot: Robot | None = None) -> Recording:
    """Return a recording whose tool moves as the controller says; see `follow_log`.

    Raises
    ------
    InputError
        Also where the track cannot tell where the log lies: without the log it may tell all else.
    """
    try:
        track, agreement, notices = follow_log(recording.track, file, robot)
    except NotIdentifiableError as reason:
        raise InputError(f"--log {file} cannot be used: {reason}; or leave it out") from None
    return replace(recording, track=track, controller_log=agreement, notices=(*recording.notices, *notices))


def tool_of_log(log: ControllerLog, robot: Robot | None) -> ControllerLog:
    """Return a log of the tool: the forward kinematics of a log of joints.

    Raises
    ------
    InputError
        Where the log holds joints and no robot with lengths is known, or where its arms do not meet.
    """
    if log.holds == "tool":
        return log
    if robot is None or (robot.kind != "cartesian" and not robot.lengths_m):
        raise InputError("the log holds joints: give the robot's kind and lengths_m under [robot] in --move FILE")
    tool = find_tool(robot, log.values)
    if not np.isfinite(tool).all(axis=1).mean() > 0.9:
        raise InputError(
            f"the {robot.kind} robot's arms do not meet for the joints of the log: check its lengths_m, and that the "
            "joints are in degrees (or are called q1_rad …)"
        )
    return ControllerLog(time_s=log.time_s, values=tool, holds="tool")
