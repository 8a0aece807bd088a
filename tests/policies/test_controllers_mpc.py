"""Model-predictive control: state, reference, steps, commands and plans at single times, and whole bodies."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from moments import UP, policy_input, whole_body_arguments
from scipy.spatial.transform import Rotation

from footfall import PolicyInput, load_robot
from footfall.common.rotations import heading_matrix, wrap_angle
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.base import Base, Disturbance, body_state, capture_offset_m
from footfall.policies.controllers.mpc.config import FootholdConfig, MpcConfig
from footfall.policies.controllers.mpc.footholds import contact_points, foothold
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.problem import BodyState
from footfall.policies.controllers.mpc.swing import swing_motion
from footfall.policies.controllers.mpc.whole_body import MpcWholeBody
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.gaits import find_gait
from footfall.robots.mjcf import load_spec
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
BODY, LEGS = nominal_body(ROBOT), ROBOT.legs
CONFIG = controller_settings(ROBOT, "mpc", MpcConfig)
STANCE, RESTART = CONFIG.stance, CONFIG.restart
STILL, RADIUS = np.zeros(3), LEGS.foot_radius.mean()
TILTED = Rotation.from_euler("ZYX", [1.1, -0.15, 0.1])
VELOCITY, GYRO = np.array([0.4, -0.3, 0.1]), np.array([0.5, -0.7, 0.9])
BASE = Base(0.3 - 0.2j, 0.28, VELOCITY, TILTED.as_matrix(), GYRO, roll=0.1, pitch=-0.15, yaw=1.1)
TO_HEADING = Rotation.from_euler("z", -BASE.yaw)


@pytest.fixture
def mpc() -> Mpc:
    return Mpc(ROBOT)


def in_plane(vector: np.ndarray) -> complex:
    return complex(vector[0], vector[1])


@pytest.mark.parametrize("seed", range(6))
def test_footholds_follow_bledts_formula_in_three_dimensions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    point, base, velocity, desired = (np.array([*rng.uniform(-0.4, 0.4, 2), 0.0]) for _ in range(4))
    yaw, rate, left_s, stance_s, height = 2.3, -1.7, 0.11, 0.23, 0.31
    config = FootholdConfig(capture_gain_s=0.07, max_step_m=10.0 if seed % 2 else 0.03)
    arm, spin = Rotation.from_euler("z", yaw + rate * left_s).apply(point), rate * UP
    step = stance_s / 2 * (velocity + np.cross(spin, arm)) + 0.07 * (velocity - desired)
    step += height / (2 * 9.81) * np.cross(velocity, spin)
    step *= min(1.0, config.max_step_m / np.linalg.norm(step))
    motion = in_plane(velocity), in_plane(desired), yaw, rate, left_s, stance_s
    found = foothold(in_plane(point), in_plane(base), height, *motion, config)
    assert found == pytest.approx(in_plane(base + velocity * left_s + arm + step))


@pytest.mark.parametrize("seed", range(4))
def test_contact_points_follow_the_plan_step_by_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contacts = rng.random((9, 4)) < 0.6
    feet, targets, nominal = rng.normal(size=(3, 4, 3))
    centre, yaw = rng.normal(size=(9, 3)), rng.normal(size=9)
    found = contact_points(contacts, feet, targets, nominal, centre, yaw)
    for step, leg in np.argwhere(contacts):
        touchdowns = np.sum(contacts[1 : step + 1, leg] & ~contacts[:step, leg])
        expected = (feet if contacts[0, leg] else targets)[leg] - centre[step]
        if touchdowns + contacts[0, leg] > 1:
            expected = Rotation.from_euler("z", yaw[step]).apply(nominal[leg])
            expected[2] = -centre[step, 2]
        np.testing.assert_allclose(found[step, leg], expected, atol=1e-12)


def test_a_swing_moves_from_lift_off_to_landing_in_its_time() -> None:
    start, end, swing_s, d = np.array([0.1, -0.2, 0.03]), np.array([0.4, 0.1, -0.01]), 0.3, 1e-5

    def at(share: float) -> np.ndarray:
        return np.array(swing_motion(share, start.tolist(), end.tolist(), swing_s, 0.08))

    np.testing.assert_allclose(at(0.0)[:2], [start, STILL], atol=1e-12)
    np.testing.assert_allclose(at(0.5)[0], [0.25, -0.05, 0.01 + 0.08])
    np.testing.assert_allclose(at(1.0)[:2], [end, STILL], atol=1e-12)
    for progress in (0.2, 0.5, 0.9):
        position, velocity, acceleration = at(progress)
        rates = (at(progress + d / swing_s) - at(progress - d / swing_s)) / (2 * d)
        np.testing.assert_allclose(velocity, rates[0], atol=1e-6)
        np.testing.assert_allclose(acceleration, rates[1], atol=1e-4)
        straight = start + (end - start) * (position[0] - start[0]) / (end[0] - start[0])
        np.testing.assert_allclose((position - straight)[:2], 0.0, atol=1e-12)
        assert 0.0 < (position - straight)[2] <= 0.08 + 1e-12


def test_the_state_is_that_of_the_centre_of_mass_in_the_heading_frame() -> None:
    state = body_state(BASE, BODY.centre, heading_matrix(BASE.yaw), STILL)
    arm, spin = TILTED.apply([BODY.centre, GYRO])
    np.testing.assert_allclose(state.pose, [0.1, -0.15, 0.0, *TO_HEADING.apply(arm) + 0.28 * UP], atol=1e-12)
    rates = TO_HEADING.apply([spin, VELOCITY + np.cross(spin, arm)])
    np.testing.assert_allclose(state.rate, rates.ravel(), atol=1e-12)


def test_the_reference_is_the_commanded_motion_step_by_step(mpc: Mpc) -> None:
    mpc.reference.xy, mpc.reference.yaw, mpc.reference.height = 0.33 - 0.15j, BASE.yaw + 0.1, 0.27
    reference = mpc.reference.over_horizon(BASE, np.array([0.6, -0.25, 0.8]))
    point, dt = TO_HEADING.apply([0.03, 0.05, 0.0]), CONFIG.horizon.step_s
    assert len(reference.pose) == CONFIG.horizon.steps
    for k, (pose, rate) in enumerate(zip(reference.pose, reference.rate, strict=True)):
        yaw = 0.1 + 0.8 * dt * (k + 1)
        velocity, arm = Rotation.from_euler("z", yaw).apply([[0.6, -0.25, 0.0], BODY.centre])
        point = point + velocity * dt
        np.testing.assert_allclose(pose, [0, 0, yaw, *(point + arm + 0.27 * UP)], atol=1e-9)
        np.testing.assert_allclose(rate, [0, 0, 0.8, *velocity], atol=1e-9)


def test_the_path_loses_its_surplus_speed(mpc: Mpc) -> None:
    """The path is the integral of v = desired + (now - desired) exp(-t / 0.2 s), in mid-step."""
    steps = CONFIG.horizon.steps
    state = BodyState(np.array([0, 0, 0, 0.1, -0.2, 0.25]), np.array([0, 0, 0, 0.9, -0.5, 0.4]))
    desired = np.array([0.3, 0.2, 0.0])
    reference = BodyState(np.zeros((steps, 6)), np.tile([9.0, 9.0, 9.0, *desired], (steps, 1)))
    reference.rate[1:] += 1.0  # the current target counts
    path, fine = mpc.reference.path(state, reference), np.linspace(0.0, 1.0, 200_001)
    speed = desired + (state.rate[3:] - desired) * np.exp(-fine / 0.2)[:, None]
    index = np.searchsorted(fine, CONFIG.horizon.step_s * (np.arange(steps) + 0.5))
    travelled = (np.cumsum(speed, axis=0) * fine[1])[index, :2]
    np.testing.assert_allclose(path[:, :2], state.pose[3:5] + travelled, atol=1e-4)
    assert path[:, 2].tolist() == [0.25] * steps


def test_the_reference_follows_the_base_by_its_velocity_in_the_world(mpc: Mpc) -> None:
    velocity, gyro = np.array([0.7, -0.4, 0.2]), (1.0, 2.0, 3.0)
    seen = policy_input(ROBOT, base_velocity=velocity, base_height=0.24, turn=TILTED, gyro=gyro)
    mpc.reset(seen)
    moved = TILTED.apply(velocity)
    for k in (1, 2):
        base = mpc.follower.follow(seen, 0.004)
        assert base.xy == pytest.approx(in_plane(moved) * 0.004 * k)
    np.testing.assert_allclose(base.velocity, moved, atol=1e-12)
    state = (base.height, base.yaw, base.pitch, base.roll, *base.gyro)
    assert state == pytest.approx((0.24 + RADIUS, 1.1, -0.15, 0.1, *gyro))
    np.testing.assert_allclose(base.position, [base.xy.real, base.xy.imag, base.height])


def test_the_reference_leads_by_at_most_its_limit(mpc: Mpc) -> None:
    command, reference = np.array([0.5, -0.2, 0.6]), mpc.reference
    reference.xy, reference.yaw, reference.height = BASE.xy, BASE.yaw, 0.2
    reference.advance(BASE, command, 0.01)
    forward = in_plane(TO_HEADING.inv().apply([0.5, -0.2, 0.0]))
    assert reference.velocity == pytest.approx(forward)
    assert reference.xy == pytest.approx(BASE.xy + 0.01 * forward)
    climbed = 0.2 + 0.01 / CONFIG.settle_s * (STANCE.height_m - 0.2)
    assert (reference.yaw, reference.height) == pytest.approx((BASE.yaw + 0.006, climbed))
    for sign in (1.0, -1.0):
        reference.advance(BASE, sign * command, 5.0)
        limit = sign * STANCE.max_position_lead_m * forward / abs(forward)
        assert reference.xy - BASE.xy == pytest.approx(limit)
        assert wrap_angle(reference.yaw - BASE.yaw) == pytest.approx(sign * STANCE.max_yaw_lead_rad)
    assert reference.height == pytest.approx(STANCE.height_m)


def test_a_disturbed_robot_steps_until_it_has_been_calm() -> None:
    def base(speed: float = 0.0, roll: float = 0.0, pitch: float = 0.0) -> Base:
        velocity = np.array([0.6 * speed, -0.8 * speed, 9.0])
        return BASE._replace(velocity=velocity, roll=roll, pitch=pitch)

    assert RESTART.stop_speed_m_s < RESTART.start_speed_m_s
    disturbance = Disturbance(RESTART)
    between = base(0.5 * (RESTART.stop_speed_m_s + RESTART.start_speed_m_s))
    assert not disturbance.active(between, False, 0.0, 0.1)
    assert disturbance.active(base(1.01 * RESTART.start_speed_m_s), False, 0.0, 0.1)
    disturbance.reset()
    assert not disturbance.active(base(), False, 0.0, 0.1)
    tilt = 1.01 * RESTART.start_tilt_rad
    for tilted in (base(roll=-tilt), base(pitch=tilt)):
        assert disturbance.active(tilted, False, 0.0, 0.1)
        steps = 0
        while disturbance.active(base(), False, 0.0, RESTART.calm_s / 10.5):
            steps += 1
        assert steps == 10
    assert disturbance.active(between, True, 0.0, 0.1)


def test_a_standing_robot_that_drifts_off_its_feet_steps_before_it_tips_over() -> None:
    feet, centre = np.array([[0.0, 0.14, -0.7], [0.0, -0.02, -0.7]]), np.array([0.0, 0.03, 0.0])
    slow = BASE._replace(velocity=STILL, rotation=np.eye(3))
    drifts = slow._replace(velocity=np.array([0.0, -0.05, 0.0]))
    offsets = [capture_offset_m(base, centre, feet) for base in (slow, drifts)]
    np.testing.assert_allclose(offsets, [0.03, 0.03 + 0.05 * np.sqrt(0.7 / 9.81)], atol=1e-3)
    restart = replace(RESTART, max_offset_m=0.04)
    for walking, case, steps in ((False, 0, False), (False, 1, True), (True, 1, False)):
        assert Disturbance(restart).active(slow, walking, offsets[case], 0.1) is steps


def test_swinging_feet_move_relative_to_the_moving_base(mpc: Mpc) -> None:
    """The velocity of a foot is the change of its position in the base's axes."""
    feet, swing_s, progress, d = mpc.swing_feet, mpc.clock.timing.swing_s, [0.0, 0.3, 0.0, 0.7], 1e-5
    feet.lift_off, feet.target = np.random.default_rng(12).uniform(-0.3, 0.3, (2, 4, 3))

    def seen(dt: float) -> np.ndarray:
        turn = Rotation.from_rotvec(TILTED.apply(GYRO) * dt) * TILTED
        xy, height = BASE.xy + dt * in_plane(VELOCITY), BASE.height + dt * VELOCITY[2]
        moved = BASE._replace(xy=xy, height=height, rotation=turn.as_matrix())
        return feet.motion([1, 3], [share + dt / swing_s for share in progress], moved, swing_s)

    motion, before, after = seen(0.0), seen(-d), seen(d)
    np.testing.assert_allclose(motion[:, 1], (after[:, 0] - before[:, 0]) / (2 * d), atol=1e-5)
    landing = feet.target[3] + (LEGS.foot_radius[0] - CONFIG.swing.depth_m) * UP
    ends = feet.lift_off[3].tolist(), landing.tolist()
    position, _, acceleration = swing_motion(0.7, *ends, swing_s, CONFIG.swing.height_m)
    np.testing.assert_allclose(TILTED.apply(motion[1, 0]) + BASE.position, position, atol=1e-12)
    np.testing.assert_allclose(TILTED.apply(motion[1, 2]), acceleration, atol=1e-9)
    assert feet.motion([], progress, BASE, swing_s).shape == (0, 3, 3)


def test_a_leg_that_swings_aims_where_its_foothold_is_when_it_lands(mpc: Mpc) -> None:
    timing, desired, yaw_rate = mpc.clock.timing, 0.25 + 0.1j, -0.6
    mpc.swing_feet.aim(2, 0.3, BASE, LEGS.pose(ROBOT.default_pose), mpc.wrenches, desired, yaw_rate, timing)
    nominal = nominal_feet(LEGS, STANCE.height_m, STANCE.outward_m, STANCE.shift_m)[2]
    motion = in_plane(VELOCITY), desired, BASE.yaw, yaw_rate, 0.7 * timing.swing_s, timing.stance_s
    expected = foothold(in_plane(nominal), BASE.xy, BASE.height, *motion, CONFIG.foothold)
    assert in_plane(mpc.swing_feet.target[2]) == pytest.approx(expected)
    assert not mpc.swing_feet.target[[0, 1, 3]].any()


def standing(yaw: float = 0.0, time_s: float = 0.0, command: Any = (0.0, 0.0, 0.0)) -> PolicyInput:
    """Inputs of a robot in its default pose, level and at rest."""
    height = float(RADIUS - LEGS.default_foot[:, 2].mean() - LEGS.foot_radius[0])
    return policy_input(ROBOT, time_s, command, STILL, height, turn=Rotation.from_euler("z", yaw))


@pytest.mark.parametrize(("begun", "now"), [(2.0, 2.1), (3.1, 3.2 - 2 * np.pi)])
def test_a_base_turned_to_the_left_is_pushed_back_to_the_right(mpc: Mpc, begun: float, now: float) -> None:
    """The direction is right even at the heading where angles jump from pi to -pi.

    The ground forces correspond to the feed-forward torques of legs at rest.
    """
    mpc.reset(standing(begun))
    pose = LEGS.pose(ROBOT.default_pose)
    contact = pose.jacobian + LEGS.rolling_offset(pose.axes, UP)
    torque = LEGS.gather(mpc.act(standing(now)).torque)[:, :, None]
    force = -np.linalg.solve(contact.transpose(0, 2, 1), torque)[:, :, 0]
    assert np.cross(LEGS.default_foot, force).sum(axis=0)[2] < -0.5


def test_without_a_solution_standing_feet_keep_force(mpc: Mpc, monkeypatch: pytest.MonkeyPatch) -> None:
    mpc.reset(standing())
    mpc.act(standing())
    monkeypatch.setattr(mpc.forces.solver, "solve", lambda problem: None)
    for tick in range(3):
        mpc.act(standing(time_s=1.0 + tick / mpc.rate_hz, command=(0.5, 0.0, 0.0)))
    pressed = mpc.force[:, 2] > 1.0
    np.testing.assert_array_equal(pressed, mpc.stands)
    assert pressed.sum() == 2


def test_no_foot_is_lifted_and_no_command_followed_before_the_robot_has_settled(mpc: Mpc) -> None:
    mpc.reset(standing())
    for share in (0.0, 0.5, 0.99):
        command = mpc.act(standing(time_s=share * CONFIG.settle_s, command=(0.5, 0.0, 0.3)))
        assert not np.any([command.kp, command.velocity])
        np.testing.assert_array_equal(mpc.stance(), 1.0)
    assert mpc.act(standing(time_s=CONFIG.settle_s, command=(0.5, 0.0, 0.3))).kp.any()


def test_a_plan_contains_present_and_scheduled_contacts(mpc: Mpc, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first step has the present contacts, the others those of the clock at their middle."""
    planned: list[np.ndarray] = []
    build = mpc.forces.problems.build

    def seen(state: BodyState, reference: BodyState, contacts: np.ndarray, *rest: Any) -> object:
        planned.append(contacts.copy())
        return build(state, reference, contacts, *rest)

    monkeypatch.setattr(mpc.forces.problems, "build", seen)
    mpc.reset(standing())
    gait, horizon = CONFIG.gait, CONFIG.horizon
    duty, phase = find_gait(gait.name, ROBOT)
    middle = (np.arange(1, horizon.steps) + 0.5) * horizon.step_s
    for tick in range(round(gait.period_s * mpc.rate_hz)):
        before = len(planned)
        now = standing(time_s=1.0 + tick / mpc.rate_hz, command=(0.5, 0.0, 0.0))
        stands = LEGS.gather(mpc.act(now).kp)[:, 0] == 0
        later_s = (tick + 1) / mpc.rate_hz + middle[:, None]
        later = (later_s / gait.period_s + phase) % 1.0 < (gait.duty or duty)
        for contacts in planned[before:]:
            np.testing.assert_array_equal(contacts, [stands, *later])
    assert len(planned) > 10


FORCE = np.array([[3.0, -5.0, 60.0], STILL, STILL, [-8.0, 2.0, 40.0]])


def leg_torque(swing_acceleration: Any = STILL) -> np.ndarray:
    """Torques (legs, 3) in the default pose, with two diagonal feet on the ground."""
    swing = np.zeros((2, 3, 3))
    swing[:, 0], swing[:, 2] = LEGS.default_foot[1:3], swing_acceleration
    pose, legs = ROBOT.default_pose, LegControl(ROBOT, LEGS, BODY, CONFIG)
    return LEGS.gather(legs.command(pose, LEGS.pose(pose), FORCE, STILL, STILL, UP, [1, 2], swing).torque)


def test_torques_hold_the_forces_at_the_points_of_contact() -> None:
    """The torque is -J' f, with MuJoCo's Jacobian of the lowest point of each foot."""
    model = load_spec(ROBOT.xml_path).compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    joints = np.array([model.joint(name).id for name in ROBOT.joint_names])
    data.qpos[model.jnt_qposadr[joints]] = ROBOT.default_pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for leg in (0, 3):
        geom = model.geom(ROBOT.description.feet[leg].geoms[0]).id
        jacobian, lowest = np.zeros((3, model.nv)), data.geom_xpos[geom] - LEGS.foot_radius[leg] * UP
        mujoco.mj_jac(model, data, jacobian, None, lowest, model.geom_bodyid[geom])
        dofs = model.jnt_dofadr[joints[LEGS.joints[leg]]]
        np.testing.assert_allclose(leg_torque()[leg], -jacobian[:, dofs].T @ FORCE[leg], atol=1e-9)


def test_a_swinging_leg_is_given_the_torque_that_its_inertia_needs() -> None:
    """The torque is M times the joint acceleration that moves the foot as desired."""
    acceleration = np.array([5.0, 0.0, 8.0])
    joint = np.linalg.solve(LEGS.pose(ROBOT.default_pose).jacobian[1], acceleration)
    np.testing.assert_allclose(leg_torque(acceleration)[1], BODY.leg_inertia[1] @ joint, atol=1e-9)


TURN = Rotation.from_euler("ZYX", [0.9, -0.2, 0.15])
RATES = {"gyro": (0.3, -0.5, 0.8), "velocity": 0.3 * np.random.default_rng(1).standard_normal(12)}
MOVING = policy_input(ROBOT, 0.0, STILL, (0.3, -0.2, 0.1), 0.26, turn=TURN, **RATES)


def test_the_body_moves_as_forces_move_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The motion fulfils Newton's and Euler's equations of the rigid body that the plan is made for."""
    policy = MpcWholeBody(ROBOT)
    policy.reset(MOVING)
    dynamics, _, _, desired, max_force = whole_body_arguments(policy, monkeypatch, MOVING)
    np.testing.assert_array_equal(max_force, policy._config.contact.max_force_n)
    np.testing.assert_allclose(desired.centre, policy.force.sum(axis=0) / BODY.mass - 9.81 * UP)
    moment = np.cross(dynamics.foot - dynamics.centre, policy.force).sum(axis=0)
    assert np.abs(moment).min() > 0.1
    np.testing.assert_allclose(desired.momentum_rate, moment)
    turned = TURN.as_matrix() @ BODY.inertia @ TURN.as_matrix().T
    np.testing.assert_allclose(TURN.apply(desired.attitude), np.linalg.solve(turned, moment))


def test_with_whole_body_control_it_walks_as_commanded() -> None:
    policy, command = MpcWholeBody(ROBOT), np.array([0.4, -0.1, 0.5])
    result = walk(policy, DirectPlant(ROBOT, seed=2), lambda _: command, 3.0)
    assert (result.fell, policy.control.unsolved_ticks, policy.notes) == (False, 0, ())
    np.testing.assert_allclose(result.mean_velocity(after_s=1.5), command, atol=0.04)


def test_with_whole_body_control_an_episode_repeats_itself_after_a_reset() -> None:
    policy, episodes = MpcWholeBody(ROBOT), []
    for _ in range(2):
        policy.reset(MOVING)
        episodes.append([policy.act(MOVING).position for _ in range(3)])
    np.testing.assert_array_equal(*episodes)
