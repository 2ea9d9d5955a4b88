"""Tool and joints: what the documents' robots do, and what no robot may."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from tagsway.errors import InputError
from tagsway.model import Move, Robot, SampledTrajectory
from tagsway.robots import find_joints, find_tool, joint_jacobian, plan_joints, singularity_margin
from tagsway.trajectories import plan_move, sample_trajectory

THESIS = Robot(kind="delta", lengths_m={"base": 0.2, "platform": 0.045, "upper": 0.348087991749213, "lower": 0.8})
DUAL_MODE = Robot(
    kind="delta",
    lengths_m={"base": 0.17, "platform": 0.06, "upper": 0.26, "lower": 0.68},
    joint_limits_deg=((-35, 75),),
)
DUAL_MODE_POINTS_MM = {
    "P0": (-200, 0, -740),
    "P1": (-200, 0, -710),
    "P2": (-182, -9, -670),
    "P3": (182, -191, -670),
    "P4": (200, -200, -710),
    "P5": (200, -200, -780),
}
SCARA = Robot(kind="scara", lengths_m={"inner": 0.225, "outer": 0.175})
LEFT = Robot(kind="scara", lengths_m=SCARA.lengths_m, elbow="left")
ROBOTS = pytest.mark.parametrize(
    "robot", [THESIS, DUAL_MODE, SCARA, LEFT], ids=["thesis", "dual-mode", "right", "left"]
)


def scatter(robot: Robot, n: int = 2000) -> np.ndarray:
    """Return points inside the workspace, seeded."""
    rng = np.random.default_rng(3)
    if robot.kind == "delta":
        return rng.uniform([-0.3, -0.3, -0.8], [0.3, 0.3, -0.55], (n, 3)) * (1 if robot is THESIS else 0.85)
    radius, angle = rng.uniform(0.08, 0.38, n), rng.uniform(-math.pi, math.pi, n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-0.1, 0.1, n)])


def rest_to_rest(robot: Robot, start: tuple, end: tuple, sample_time_ms: float = 1.0) -> SampledTrajectory:
    move = Move(from_m=start, to_m=end, max_acceleration_m_s2=5, profile="quintic", robot=robot)
    return sample_trajectory(plan_move(move), sample_time_ms / 1e3)


def turned(robot: Robot, azimuth_deg: float) -> Robot:
    return Robot(
        kind="delta",
        lengths_m=robot.lengths_m,
        joint_limits_deg=robot.joint_limits_deg,
        leg_azimuth_deg=azimuth_deg,
    )


def test_the_thesis_delta_has_its_angles(shared):
    published = json.loads((shared / "notes" / "acceptance.json").read_text())["7_delta_ik_deg"]["thesis"]
    for point, angles in published.items():
        position = np.array(json.loads(point.replace("(", "[").replace(")", "]"))) / 1e3
        # published value: both computed to the last digit
        assert np.degrees(find_joints(THESIS, position)) == pytest.approx(angles, abs=1e-6)
        assert find_tool(THESIS, find_joints(THESIS, position)) == pytest.approx(position, abs=1e-12)


@pytest.mark.parametrize(("name", "point_mm"), DUAL_MODE_POINTS_MM.items())
def test_the_dual_mode_paper_s_delta_has_its_angles(shared, name, point_mm):
    published = json.loads((shared / "notes" / "acceptance.json").read_text())["7_delta_ik_deg"]["seed002"][name]
    # published value: both computed to the last digit
    assert np.degrees(find_joints(DUAL_MODE, np.array(point_mm) / 1e3)) == pytest.approx(published, abs=1e-6)


def test_home_and_the_ends_of_the_thesis_move_have_the_angles_of_its_print():
    points = np.array([[0, 0, -0.767], [0.35, 0, -0.767], [-0.35, 0, -0.767], [0, 0, -0.6]])
    angles = [[21.305482] * 3, [34.782244, 2.036028, 60.738544], [34.782244, 60.738544, 2.036028], [-3.724030] * 3]
    # published value: half of the last printed digit
    assert np.degrees(find_joints(THESIS, points)) == pytest.approx(np.array(angles), abs=5.1e-7)


def test_p5_breaks_its_own_limit_with_leg_1_at_minus_y_and_keeps_it_with_legs_on_the_x_axis():
    p5 = np.array(DUAL_MODE_POINTS_MM["P5"]) / 1e3
    assert np.degrees(find_joints(DUAL_MODE, p5)).max() == pytest.approx(80.2, abs=0.05)  # published value
    worst = {azimuth: np.degrees(find_joints(turned(DUAL_MODE, azimuth), p5)).max() for azimuth in (0, 180)}
    assert min(worst.values()) == pytest.approx(74.9, abs=0.05)  # published value


@ROBOTS
def test_forward_and_inverse_kinematics_undo_each_other(robot):
    points = scatter(robot)
    joints = find_joints(robot, points)
    known = np.isfinite(joints).all(axis=1)
    assert known.mean() > 0.9
    safe = known & (singularity_margin(robot, points) > 0.02)
    assert safe.mean() > 0.85
    # identity: a nanometre's thousandth
    assert np.abs(find_tool(robot, joints[safe]) - points[safe]).max() <= 1e-12
    again = find_joints(robot, find_tool(robot, joints[safe]))
    assert np.abs(again - joints[safe]).max() <= 1e-10


@ROBOTS
def test_a_delta_s_rods_and_a_scara_s_arms_keep_their_length(robot):
    """The joints are checked against the robot's own drawing, not against its forward kinematics."""
    points = scatter(robot, 200)
    joints = find_joints(robot, points)
    lengths = robot.lengths_m
    for point, joint in zip(points, joints, strict=True):
        if not np.isfinite(joint).all():
            continue
        if robot.kind == "scara":
            elbow = lengths["inner"] * np.array([math.cos(joint[0]), math.sin(joint[0])])
            # identity
            assert np.linalg.norm(point[:2] - elbow) == pytest.approx(lengths["outer"], abs=1e-14)
            continue
        for leg in range(3):
            azimuth = math.radians(robot.leg_azimuth_deg + 120 * leg)
            outward = np.array([math.cos(azimuth), math.sin(azimuth), 0])
            elbow = (lengths["base"] + lengths["upper"] * math.cos(joint[leg])) * outward
            elbow = elbow - [0, 0, lengths["upper"] * math.sin(joint[leg])]
            rod = point + lengths["platform"] * outward - elbow
            assert np.linalg.norm(rod) == pytest.approx(lengths["lower"], abs=1e-14)  # identity


def test_turning_the_legs_turns_the_workspace():
    points, angle = scatter(THESIS, 300), math.radians(37.0)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    assert find_joints(turned(THESIS, -90 + 37.0), points @ turn.T) == pytest.approx(
        find_joints(THESIS, points), abs=1e-12, nan_ok=True
    )


@ROBOTS
def test_the_jacobian_is_the_derivative_of_the_joints(robot):
    points = scatter(robot, 40)
    points = points[singularity_margin(robot, points) > 0.1]
    assert len(points) > 20
    for point, jacobian in zip(points, joint_jacobian(robot, points), strict=True):
        numeric = approx_fprime(point, lambda p: find_joints(robot, p), 1e-7)
        # discretisation: forward differences of step 1e-7
        assert jacobian == pytest.approx(numeric, rel=1e-4, abs=1e-4)


def test_the_margin_vanishes_where_a_leg_is_stretched_and_where_the_arms_are_in_line():
    lowest = math.sqrt((0.348087991749213 + 0.8) ** 2 - 0.155**2)
    depths = np.array([[0, 0, -lowest + drop] for drop in (1e-6, 1e-3, 0.05, 0.2)])
    margin = singularity_margin(THESIS, depths)
    assert np.all(np.diff(margin) > 0)
    assert margin[0] < 0.01 < margin[-1]
    assert np.isnan(singularity_margin(THESIS, np.array([0, 0, -lowest - 1e-6])))
    reach = singularity_margin(SCARA, np.array([[0.4 - 1e-9, 0, 0], [math.hypot(0.225, 0.175), 0, 0], [0.05, 0, 0]]))
    assert reach == pytest.approx([0, 1, 0], abs=2e-4)


def test_the_margin_vanishes_where_three_rods_lie_in_one_plane():
    flat = Robot(kind="delta", lengths_m={"base": 0.5, "platform": 0.05, "upper": 0.2, "lower": 0.65})
    # elbows at the height of the platform: nothing holds it against a load from above
    heights = np.array([[0, 0, -z] for z in (1e-5, 0.05, 0.2)])
    margin = singularity_margin(flat, heights)
    assert margin[0] < 0.05
    assert np.all(np.diff(margin) > 0)


def test_a_scara_s_elbow_is_on_the_side_it_states():
    for robot, sign in ((SCARA, 1), (LEFT, -1)):
        first, second, z = find_joints(robot, np.array([0.0, 0.3, -0.02]))
        assert sign * second > 0
        assert sign * (math.pi / 2 - first) > 0  # seen along +y, right is +x
        assert z == -0.02


def test_a_path_across_the_half_turn_does_not_jump():
    sampled = rest_to_rest(SCARA, (-0.2, 0.15, 0), (-0.2, -0.15, 0))
    joints = plan_joints(sampled, SCARA)
    assert np.abs(np.diff(joints.position[:, 0])).max() < 0.02
    assert find_tool(SCARA, joints.position) == pytest.approx(sampled.position_m, abs=1e-12)


@pytest.mark.parametrize("robot", [THESIS, SCARA, Robot()], ids=["delta", "scara", "cartesian"])
def test_the_joints_velocity_is_the_jacobian_s(robot):
    ends = ((-0.3, 0.1, -0.7), (0.3, 0.05, -0.65)) if robot is THESIS else ((-0.2, 0.2, 0), (0.2, 0.2, -0.05))
    sampled = rest_to_rest(robot, *ends)
    joints = plan_joints(sampled, robot)
    expected = np.einsum("nij,nj->ni", joint_jacobian(robot, sampled.position_m), sampled.velocity_m_s)
    # discretisation: a cubic spline at 1 ms; the motion ends between the last two samples, where its jerk steps
    assert joints.velocity[:-5] == pytest.approx(expected[:-5], abs=2e-7)
    assert joints.velocity == pytest.approx(expected, abs=2e-5)
    assert joints.units[:2] == (("m", "m") if robot.kind == "cartesian" else ("rad", "rad"))
    assert joints.velocity[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-12)


def test_interpolation_to_8_khz_converges_with_the_fourth_power_of_the_sample_time():
    start, end = (-0.35, 0, -0.767), (0.35, 0, -0.767)
    exact = plan_move(Move(from_m=start, to_m=end, max_acceleration_m_s2=5, profile="quintic"))
    errors = []
    for step_ms in (8.0, 4.0, 2.0):
        joints = plan_joints(rest_to_rest(THESIS, start, end, step_ms), THESIS, rate_hz=8000.0)
        assert joints.sample_time_s == 1 / 8000
        time = np.minimum(np.arange(len(joints.position)) / 8000, exact.duration_s)
        inside = (time > 0.1) & (time < exact.duration_s - 0.1)
        errors.append(np.abs(joints.position - find_joints(THESIS, exact(time)))[inside].max())
    # discretisation: 16 when the step is halved
    assert errors[0] / errors[1] > 12
    assert errors[1] / errors[2] > 12
    assert errors[2] < 1e-9


def test_an_unreachable_point_is_named_with_its_time():
    sampled = rest_to_rest(THESIS, (0, 0, -0.7), (0, 0, -1.3))
    with pytest.raises(InputError, match=r"cannot reach \(0, 0, -1\.1\d+\) m, t = 0\.\d+ s") as refusal:
        plan_joints(sampled, THESIS)
    assert "\n" not in str(refusal.value)


def test_a_joint_beyond_its_limit_is_named_with_point_and_time():
    sampled = rest_to_rest(DUAL_MODE, (0, 0, -0.7), (0.2, -0.2, -0.78))
    with pytest.raises(InputError, match=r"joint \d is at 75\.\d° at \(0\.\d+, -0\.\d+, -0\.\d+\) m, t = 0\.\d+ s"):
        plan_joints(sampled, DUAL_MODE)
    kept = min((0, 180), key=lambda a: np.max(find_joints(turned(DUAL_MODE, a), np.array([0.2, -0.2, -0.78]))))
    assert np.degrees(plan_joints(sampled, turned(DUAL_MODE, kept)).position).max() < 75


def test_a_singularity_on_the_way_is_named():
    sampled = rest_to_rest(SCARA, (0.2, 0, 0), (0.399999, 0, 0))
    with pytest.raises(InputError, match=r"at a singularity at \(0\.4, 0, 0\) m, t = 0\.\d+ s"):
        plan_joints(sampled, SCARA)


@pytest.mark.parametrize("rate_hz", [0.0, -8000.0, math.nan, math.inf, 1e9])
def test_a_rate_that_cannot_be_is_refused(rate_hz):
    sampled = rest_to_rest(THESIS, (0, 0, -0.7), (0.1, 0, -0.7))
    with pytest.raises(InputError, match=r"rate"):
        plan_joints(sampled, THESIS, rate_hz=rate_hz)


def test_nan_in_nan_out_and_nothing_in_nothing_out():
    for robot in (THESIS, SCARA, Robot()):
        assert find_joints(robot, np.empty((0, 3))).shape == (0, 3)
        assert singularity_margin(robot, np.empty((0, 3))).shape == (0,)
        assert np.isnan(find_joints(robot, np.full((2, 3), np.nan))).all()
        with pytest.raises(InputError, match="rows of three"):
            find_joints(robot, np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"kind": "delta", "lengths_m": {"base": 0.2}}, "all of base, platform, upper, lower, not base"),
        ({"kind": "scara", "lengths_m": {"inner": 225.0, "outer": 175.0}}, "in metres, not mm"),
        ({"kind": "scara", "lengths_m": {"inner": 0.0, "outer": 0.1}}, "inner is 0 m"),
        ({"kind": "scara", "lengths_m": {"inner": math.nan, "outer": 0.1}}, "inner is nan m"),
        ({"lengths_m": {"x": 1.0}}, "cartesian robot's lengths_m are none, not x"),
        ({"leg_azimuth_deg": math.nan}, "leg_azimuth_deg must be an angle"),
        ({"kind": "delta", "joint_limits_deg": ((75.0, -35.0),)}, "a lower and a higher angle"),
        ({"kind": "delta", "joint_limits_deg": ((-35.0, 75.0),) * 2}, "holds 2 pairs"),
        ({"joint_limits_deg": ((-35.0, 75.0),)}, "cartesian robot's 0 rotary"),
        ({"joint_names": ("a", "a", "b")}, "three different names"),
    ],
)
def test_a_robot_that_cannot_be_is_refused(values, words):
    with pytest.raises(InputError, match=words):
        Robot(**values)


def test_a_robot_without_lengths_has_no_joints():
    with pytest.raises(InputError, match="need its lengths"):
        find_joints(Robot(kind="delta"), np.zeros(3))


def test_a_delta_does_not_work_above_its_elbows():
    upside_down = np.array([[0, 0, 0.767], [0.1, 0, 0.6]])
    assert np.isnan(find_joints(THESIS, upside_down)).all()
    assert np.isfinite(find_joints(THESIS, upside_down * [1, 1, -1])).all()
    with pytest.raises(InputError, match=r"cannot reach \(0, 0, 0\.7\) m, t = 0 s"):
        plan_joints(rest_to_rest(THESIS, (0, 0, 0.7), (0.1, 0, 0.7)), THESIS)
