"""A controller's log against the video: motions with a known clock, rotation and scale."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import ControllerLog, Robot, TagTrack, Track
from tagsway.pipeline.log import follow_log, tool_of_log
from tagsway.robots import find_joints
from tagsway.store.sources.logs import read_log
from tagsway.tracks.alignment import align_log

OFFSET_S, RATE = 3.217_43, 1.000_31
HOME_M = np.array([-0.3, 0.05, -0.75])
DELTA = Robot(kind="delta", lengths_m={"base": 0.2, "platform": 0.045, "upper": 0.348088, "lower": 0.8})


def path(time_s, *, way=0.6, lift=0.08):
    """One pick and place from 4 s to 5 s of the log, in the robot's frame."""
    u = np.clip(time_s - 4.0, 0, 1)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    zero = np.zeros_like(s)
    return HOME_M + np.column_stack([way * s, zero, lift * 64 * (u * (1 - u)) ** 3])


def a_log(**shape):
    time = np.arange(0, 9, 1e-3)
    return ControllerLog(time_s=time, values=path(time, **shape), holds="tool")


def a_tag(position, std):
    unknown = np.full(len(position), np.nan)
    spread = np.full_like(position, std)
    return TagTrack(position=position, position_std=spread, angle_rad=unknown, angle_std_rad=unknown)


def a_track(*, noise=5e-5, scale=1.0, roll=0.0, behind=False, seed=1, **shape):
    rng = np.random.default_rng(seed)
    time = np.arange(0, 3, 1 / 200)
    x, _, z = path(OFFSET_S + RATE * time, **shape).T
    c, s = np.cos(roll), np.sin(roll)
    plane = np.column_stack([-x if behind else x, z]) @ np.array([[c, s], [-s, c]])
    position = scale * plane + rng.normal(0, noise, (len(time), 2)) + [0.4, 0.1]
    product = position - np.array([0.0, 0.045])
    return Track(
        frame=np.arange(len(time)), time_s=time, length_unit="m", tcp=a_tag(position, noise), pcp=a_tag(product, noise)
    )


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("lift", [0.0, 0.08])
def test_the_clocks_are_found_to_a_fraction_of_a_sample(behind, lift) -> None:
    aligned = align_log(a_track(behind=behind, lift=lift), a_log(lift=lift))
    for estimate, truth in ((aligned.offset_s, OFFSET_S), (aligned.rate, RATE), (aligned.agreement.scale, 1.0)):
        assert abs(estimate.value - truth) < 4 * estimate.std  # statistics: 4 of its own standard errors
    assert aligned.offset_s.std < 1e-4  # a fiftieth of the time between two frames
    assert aligned.rms_mm == pytest.approx(0.05 * np.sqrt(2), rel=0.1)  # statistics: 600 samples of two axes
    assert aligned.notices == ()


def test_the_errors_of_the_clock_are_true() -> None:
    fits = [align_log(a_track(seed=seed), a_log()) for seed in range(24)]
    for name, truth in (("offset_s", OFFSET_S), ("rate", RATE)):
        z = [(getattr(fit, name).value - truth) / getattr(fit, name).std for fit in fits]
        assert 0.65 < np.sqrt(np.mean(np.square(z))) < 1.4  # statistics: the spread of 24 is known to 14 %


def test_scale_and_roll_of_the_camera_are_seen_and_the_log_is_rotated() -> None:
    track = a_track(scale=1.004, roll=0.02)
    aligned = align_log(track, a_log())
    assert aligned.agreement.scale.value == pytest.approx(1.004, abs=4 * aligned.agreement.scale.std)
    assert aligned.agreement.roll_rad.value == pytest.approx(0.02, abs=4 * aligned.agreement.roll_rad.std)
    assert aligned.agreement.rms_scaled_m < 0.2 * aligned.agreement.rms_m
    assert track.tcp is not None
    scaled = 1.004 * (aligned.position - aligned.position.mean(axis=0))
    apart = scaled - (track.tcp.position - track.tcp.position.mean(axis=0))
    assert np.sqrt(np.mean(apart**2)) < 7e-5  # statistics: the tag's noise alone


def test_the_products_path_goes_into_the_logs_scale_with_the_tools(tmp_path) -> None:
    log = a_log()
    lines = "\n".join(f"{t:.3f},{x:.9f},{y:.9f},{z:.9f}" for t, (x, y, z) in zip(log.time_s, log.values, strict=True))
    (tmp_path / "log.csv").write_text(f"time_s,x_m,y_m,z_m\n{lines}\n")
    track, _, notices = follow_log(a_track(scale=1.03, noise=2e-5), tmp_path / "log.csv")
    assert track.tcp is not None
    sway = track.pcp.position - track.tcp.position
    assert np.ptp(sway[:, 0]) < 2.5e-4  # statistics: the noise of 600 samples, and not 3 % of 600 mm
    assert [notice.code for notice in notices] == ["tool_from_log", "log_scale_differs"]


def test_what_the_log_does_not_hold_is_nan() -> None:
    log = a_log()
    kept = log.time_s < 5.5
    aligned = align_log(a_track(), replace(log, time_s=log.time_s[kept], values=log.values[kept]))
    after = OFFSET_S + RATE * a_track().time_s > 5.5
    np.testing.assert_array_equal(np.isnan(aligned.position[:, 0]), after)
    assert aligned.offset_s.value == pytest.approx(OFFSET_S, abs=5e-4)


def test_spikes_of_the_tag_do_not_move_the_clock() -> None:
    track = a_track()
    assert track.tcp is not None
    position = track.tcp.position.copy()
    position[::50] += 0.02
    aligned = align_log(replace(track, tcp=replace(track.tcp, position=position)), a_log())
    assert aligned.offset_s.value == pytest.approx(OFFSET_S, abs=4 * aligned.offset_s.std)


def test_a_move_that_repeats_is_ambiguous() -> None:
    log = a_log()
    twice = np.concatenate([log.values, log.values])
    aligned = align_log(a_track(), replace(log, time_s=np.arange(len(twice)) / 1e3, values=twice))
    assert "log_offset_ambiguous" in {notice.code for notice in aligned.notices}


@pytest.mark.parametrize("behind", [False, True])
def test_one_way_of_a_log_to_and_fro_may_be_the_other_seen_from_behind(behind) -> None:
    log = a_log()
    back = path(log.time_s - 2.5) - HOME_M
    there_and_back = replace(log, values=log.values - back * [1.0, 1.0, -1.0])
    aligned = align_log(a_track(behind=behind), there_and_back)
    (notice,) = aligned.notices
    assert notice.code == "log_offset_ambiguous"
    assert "to and fro" in notice.message


def test_a_wrong_frame_rate_is_told() -> None:
    track = a_track()
    slow = replace(track, time_s=track.time_s * 1.02)
    aligned = align_log(slow, a_log())
    assert {notice.code for notice in aligned.notices} == {"log_rate_differs"}
    assert aligned.rate.value == pytest.approx(RATE / 1.02, abs=4 * aligned.rate.std)


def test_another_motion_is_refused() -> None:
    time = np.arange(0, 9, 1e-3)
    other = HOME_M + np.column_stack([0.1 * np.sin(9 * time), 0 * time, 0.02 * np.cos(23 * time)])
    with pytest.raises(InputError, match="does not hold the filmed motion"):
        align_log(a_track(), ControllerLog(time_s=time, values=other, holds="tool"))


def test_a_tool_that_stands_still_tells_nothing() -> None:
    with pytest.raises(NotIdentifiableError, match="stands still"):
        align_log(a_track(way=0.0, lift=0.0), a_log())


def test_joints_become_the_tool(tmp_path) -> None:
    time = np.arange(4.0, 5.0, 0.01)
    joints = np.degrees(find_joints(DELTA, path(time)))
    lines = "\n".join(
        ";".join(f"{v:.9f}".replace(".", ",") for v in (1e3 * t, *q)) for t, q in zip(time, joints, strict=True)
    )
    (tmp_path / "log.txt").write_text(f"Time (ms);q1;q2;q3\n{lines}\n")
    log = read_log(tmp_path / "log.txt")
    assert log.holds == "joints"
    np.testing.assert_allclose(tool_of_log(log, DELTA).values, path(time), atol=1e-9)  # the digits written
    with pytest.raises(InputError, match=r"\[robot\]"):
        tool_of_log(log, None)


@pytest.mark.parametrize(
    ("text", "time_s", "first"),
    [
        ("0;-0.3;0.0;-0.7\n1;-0.2;0.0;-0.7\n", [0, 1e-3], [-0.3, 0, -0.7]),
        ("time_s,tcp_x_mm,tcp_z_mm\n0,-300,-700\n0.001,-299,-700\n", [0, 1e-3], [-0.3, 0, -0.7]),
        ("time,x,y,z\n0,1,2,3\n0.002,1,2,3\n", [0, 2e-3], [1, 2, 3]),
    ],
)
def test_a_log_of_the_tool_is_read(tmp_path, text, time_s, first) -> None:
    (tmp_path / "log.csv").write_text(text)
    log = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.time_s, time_s, atol=1e-12)  # identity
    np.testing.assert_allclose(log.values[0], first, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("time,x,y,z\n0,300,0,0\n1,301,0,0\n", "x_mm"),
        ("time,x\n0,1\n0,1\n", "does not rise"),
        ("time,force\n0,1\n1,1\n", "joints"),
        ("nothing\n", "no columns"),
    ],
)
def test_a_log_that_cannot_be_used_is_refused(tmp_path, text, word) -> None:
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError, match=word):
        read_log(tmp_path / "log.csv")
