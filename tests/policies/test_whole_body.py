"""Whole-body control against statics by hand and MuJoCo's inverse dynamics, and balance by it."""

import math
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from moments import policy_input, whole_body_arguments
from scipy.spatial.transform import Rotation

from footfall import Episode, JointCommand, PolicyInput, Robot, load_robot, run_episode
from footfall.common.rotations import normalised
from footfall.policies.controllers.balance import Balance, BalanceConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.solver import BoundedSolver, QuadraticProgram
from footfall.policies.controllers.whole_body import control as control_module
from footfall.policies.controllers.whole_body.control import (
    JointFeedback,
    NoSolutionConfig,
    NoSolutionError,
    WholeBodyConfig,
    WholeBodyControl,
)
from footfall.policies.controllers.whole_body.dynamics import Dynamics, Motion, WholeBody
from footfall.policies.controllers.whole_body.feedback import Feedback, base_tilt, rest_dynamics
from footfall.policies.controllers.whole_body.problem import Contact, Desired, QuadraticPrograms, Weights
from footfall.robots.feet import foot_geoms
from footfall.robots.mjcf import load_spec

ROBOTS = {name: load_robot(name) for name in ("g1", "go1")}
G1 = ROBOTS["g1"]
N = len(G1.joint_names)
BODIES = {name: WholeBody(robot) for name, robot in ROBOTS.items()}
REST = {name: rest_dynamics(body, ROBOTS[name]) for name, body in BODIES.items()}
CONFIG = WholeBodyConfig(
    Weights(100.0, 10.0, 1.0, attitude=0.05, swing=10.0, swing_attitude=0.3, posture=1e-3, force=1e-2),
    Contact(friction=0.5, damping=5.0),
    JointFeedback(kp=0.0, kd=1.0, memory_s=0.05, friction_compensation=0.0),
    NoSolutionConfig(fade_s=0.05, kd=3.0, max_s=0.02),
)
STILL = {  # no acceleration of the centre, of angular momentum, attitude, feet and joints
    name: Desired(*np.zeros((3, 3)), np.zeros((BODIES[name].feet, 6)), np.zeros_like(robot.default_pose))
    for name, robot in ROBOTS.items()
}


def some_motion(robot: Robot, seed: int) -> Motion:
    rng = np.random.default_rng(seed)
    turn, n = normalised(np.array([1.0, 0.2, -0.3, 0.5])), len(robot.joint_names)
    velocity, gyro, offset = rng.normal(size=3), rng.normal(size=3), 0.1 * rng.normal(size=n)
    return Motion(turn, velocity, gyro, robot.default_pose + offset, rng.normal(size=n))


def moved(robot: Robot, motion: Motion) -> tuple[mujoco.MjModel, mujoco.MjData, np.ndarray]:
    """MuJoCo in the same state without contacts, limits and friction, and the velocities' indices."""
    model = load_spec(robot.xml_path).compile()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, 0.0, *motion.quaternion
    data.qpos[[int(model.joint(name).qposadr[0]) for name in robot.joint_names]] = motion.joint_position
    data.qvel[:6] = *motion.velocity, *motion.gyro
    dofs = np.array([int(model.joint(name).dofadr[0]) for name in robot.joint_names])
    data.qvel[dofs] = motion.joint_velocity
    return model, data, np.concatenate([np.arange(6), dofs])


def solved(
    name: str,
    desired: Desired,
    dynamics: Dynamics | None = None,
    max_force: float | np.ndarray = 1e4,
    max_torque: np.ndarray | None = None,
    weights: Weights = CONFIG.weights,
    friction: float = 0.5,
    daqp_iterations: int = 100,
) -> tuple[np.ndarray, ...]:
    """Forces (points, 3), accelerations (nv,) and torques (n,) of one tick, by default at rest."""
    body, robot = BODIES[name], ROBOTS[name]
    torque = robot.motor.peak_torque if max_torque is None else max_torque
    contact = replace(CONFIG.contact, friction=friction)
    programs = QuadraticPrograms(body.foot_of_point, len(torque), body.total_mass, weights, contact)
    limits = np.full(body.points, max_force), -torque, torque
    program, torque_map = programs.build(dynamics or REST[name], desired, *limits)
    x = BoundedSolver(daqp_iterations).solve(program)
    assert x is not None
    force = np.zeros((body.points, 3))
    force[torque_map.standing] = x[: 3 * len(torque_map.standing)].reshape(-1, 3)
    acceleration = torque_map.acceleration @ x + torque_map.acceleration_offset
    return force, acceleration, torque_map.torque @ x + torque_map.torque_offset


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_and_bias_are_those_of_mujocos_inverse_dynamics(name: str) -> None:
    motion = some_motion(ROBOTS[name], 3)
    model, data, order = moved(ROBOTS[name], motion)
    data.qacc[order] = acceleration = np.random.default_rng(4).normal(size=model.nv)
    mujoco.mj_inverse(model, data)
    dynamics = BODIES[name].update(motion)
    forces = dynamics.mass @ acceleration + dynamics.bias
    np.testing.assert_allclose(forces, data.qfrc_inverse[order], atol=1e-8)


@pytest.mark.parametrize("name", ROBOTS)
def test_points_accelerate_by_jacobian_and_drift(name: str) -> None:
    """The accelerations equal differences of the points' positions in the world."""
    robot, motion = ROBOTS[name], some_motion(ROBOTS[name], 5)
    dynamics = BODIES[name].update(motion)
    model, data, order = moved(robot, motion)
    acceleration = np.random.default_rng(6).normal(size=model.nv)
    mujoco.mj_kinematics(model, data)
    links = model.geom_bodyid[np.concatenate(foot_geoms(model, robot.description))]
    own = (dynamics.point - data.xpos[links])[:, None] @ data.xmat[links].reshape(-1, 3, 3)
    start, speed, h, positions = data.qpos.copy(), dynamics.velocity, 1e-4, []
    for t in (-h, 0.0, h):
        data.qpos[:], step = start, np.zeros(model.nv)
        step[order] = speed * t + acceleration * t * t / 2
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        mujoco.mj_kinematics(model, data)
        turned = own @ data.xmat[links].reshape(-1, 3, 3).swapaxes(1, 2)
        positions.append(data.xpos[links] + turned[:, 0])
    before, now, after = positions
    np.testing.assert_allclose((after - before) / (2 * h), dynamics.point_jacobian @ speed, atol=1e-5)
    desired = dynamics.point_jacobian @ acceleration + dynamics.point_drift
    np.testing.assert_allclose((after - 2 * now + before) / h**2, desired, atol=2e-4)


def test_the_base_tilt_is_roll_and_pitch_and_the_yaw_relative_to_the_feet() -> None:
    for base, feet, tilt in (
        # A base at 1.3 rad on feet at 1.0 rad, toes out by 0.2 rad, has turned left by 0.3 rad.
        (Rotation.from_rotvec([0.0, 0.0, 1.3]), (1.2, 0.8), [0.0, 0.0, 0.3]),
        # Roll is in the body frame, whatever the heading.
        (Rotation.from_euler("ZYX", [2.0, 0.0, 0.1]), (2.0, 2.0), [np.sin(0.1), 0.0, 0.0]),
    ):
        turned = REST["g1"]._replace(foot_rotation=Rotation.from_euler("z", np.vstack(feet)).as_matrix())
        np.testing.assert_allclose(base_tilt(base.as_quat(scalar_first=True), turned), tilt, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_ground_carries_the_weight_and_nothing_moves(name: str) -> None:
    force, acceleration, _ = solved(name, STILL[name])
    np.testing.assert_allclose(force.sum(axis=0), [0, 0, BODIES[name].total_mass * 9.81], atol=0.2)
    np.testing.assert_allclose(acceleration, 0.0, atol=0.01)


@pytest.mark.parametrize("name", ROBOTS)
def test_torques_balance_the_forces_and_the_legs_own_weight(name: str) -> None:
    """The torques equal inverse dynamics with the same accelerations and forces at the same points."""
    robot = ROBOTS[name]
    force, acceleration, torque = solved(name, STILL[name]._replace(centre=np.array([0.7, -0.4, 0.5])))
    upright, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    level = Motion(upright, still, still, robot.default_pose, np.zeros_like(torque))
    model, data, order = moved(robot, level)
    data.qacc[order] = acceleration
    mujoco.mj_inverse(model, data)
    from_ground = np.zeros(model.nv)
    geoms = np.concatenate(foot_geoms(model, robot.description))
    for geom, point, f in zip(geoms, REST[name].point, force, strict=True):
        mujoco.mj_applyFT(model, data, f, still, point, model.geom_bodyid[geom], from_ground)
    needed = (data.qfrc_inverse - from_ground)[order]
    np.testing.assert_allclose(needed, [*np.zeros(6), *torque], atol=1e-6)


def test_a_foot_with_a_force_limit_of_zero_carries_no_load() -> None:
    max_force = np.where(BODIES["g1"].foot_of_point == 1, 200.0, 0.0)
    force, acceleration, _ = solved("g1", STILL["g1"], max_force=max_force)
    assert not force[:4].any()
    # One foot cannot carry the body here unless it turns or falls towards the other side.
    assert abs(acceleration[:6]).max() > 0.5


def test_a_foot_in_the_air_has_the_desired_acceleration_and_standing_points_come_to_rest() -> None:
    """The robot is in motion, so the drift terms matter, and the weights are large."""
    body, rng = BODIES["g1"], np.random.default_rng(8)
    turn, (velocity, gyro) = normalised(np.array([1.0, 0.02, -0.03, 0.4])), rng.normal(size=(2, 3))
    pose = G1.default_pose + 0.05 * rng.normal(size=N)
    dynamics = body.update(Motion(turn, 0.1 * velocity, 0.5 * gyro, pose, rng.normal(size=N)))
    desired = STILL["g1"]._replace(feet=np.array([np.zeros(6), [1.0, -2.0, 3.0, 4.0, -5.0, 6.0]]))
    left = body.foot_of_point == 0
    weights = replace(CONFIG.weights, contact=1e6, swing=1e5, swing_attitude=1e5)
    # The friction is so large that the foot can be held.
    _, acceleration, _ = solved("g1", desired, dynamics, 1e4 * left, weights=weights, friction=5.0)
    foot = dynamics.foot_jacobian[1] @ acceleration + dynamics.foot_drift[1]
    np.testing.assert_allclose(foot, desired.feet[1], atol=0.05)
    points = dynamics.point_jacobian[left] @ acceleration + dynamics.point_drift[left]
    slowing = -5.0 * (dynamics.point_jacobian[left] @ dynamics.velocity)
    # A rigid sole cannot slow down each corner, since corners circle about its middle.
    np.testing.assert_allclose(points.mean(axis=0), slowing.mean(axis=0), atol=0.05)
    assert np.abs(dynamics.foot_drift[1]).max() > 0.3
    assert np.abs(dynamics.point_drift[left]).max() > 0.3


@pytest.mark.parametrize("daqp_iterations", [100, 0])  # without iterations the second solver takes over
def test_forces_stay_in_their_cones(daqp_iterations: int) -> None:
    desired = STILL["g1"]._replace(centre=np.array([9.0, -7.0, 0.0]))
    force, _, _ = solved("g1", desired, daqp_iterations=daqp_iterations)
    beyond = np.abs(force[:, :2]) - 0.5 * force[:, 2:]
    assert -2e-3 < beyond.max() <= 1e-6
    assert force[:, 2].min() >= -1e-9
    assert force[:, 1].min() < -100.0


def test_torques_stay_in_their_limits() -> None:
    max_torque = np.linspace(3.0, 9.0, N)
    _, _, torque = solved("g1", STILL["g1"], max_torque=max_torque)
    assert -1e-3 < (np.abs(torque) - max_torque).max() <= 1e-6  # the knees would need more


def test_a_share_of_the_friction_at_the_desired_speed_is_compensated() -> None:
    """Dry friction is proportional to the speed below `friction_speed` and constant above.

    Damping is viscous.
    """
    motor, joints = G1.motor, replace(CONFIG.joints, friction_compensation=0.6)
    control = WholeBodyControl(G1, replace(CONFIG, joints=joints), dt_s=0.004)
    for times, developed in ((0.5, 0.5), (-0.5, -0.5), (4.0, 1.0), (-4.0, -1.0)):
        speed = times * motor.friction_speed
        expected = 0.6 * (developed * motor.friction + motor.damping * speed)
        np.testing.assert_allclose(control._friction(speed), expected)
    assert motor.friction.min() > 0.0


class FailingSolver(BoundedSolver):
    """Solves other programs from a tick on, by default with contradictory limits."""

    def __init__(self, first_tick: int = 0, nan: bool = False) -> None:
        super().__init__(piqp_iterations=30, accept_unfinished=False)
        self._first_tick, self._nan, self._count = first_tick, nan, 0

    def solve(self, problem: QuadraticProgram) -> np.ndarray | None:
        self._count += 1
        if self._count > self._first_tick:
            broken = {"gradient": np.nan * problem.gradient} if self._nan else {"lower": problem.upper + 1.0}
            problem = problem._replace(**broken)
        return super().solve(problem)


LATE = BoundedSolver(1, 2, accept_unfinished=False)
FAILING_SOLVERS = {"infeasible": FailingSolver(), "late": LATE, "not a number": FailingSolver(nan=True)}


@pytest.fixture
def control() -> WholeBodyControl:
    return WholeBodyControl(G1, CONFIG, dt_s=0.004)


def forward_command(control: WholeBodyControl) -> JointCommand:
    """Command for a robot at rest that must accelerate forward, so that toes and heels differ."""
    desired = STILL["g1"]._replace(centre=np.array([0.8, 0.0, 0.0]))
    return control.command(REST["g1"], G1.default_pose, np.zeros(N), desired, np.full(8, 300.0))


@pytest.mark.parametrize("why", FAILING_SOLVERS)
def test_the_torques_fade_into_damping_with_a_note(control: WholeBodyControl, why: str) -> None:
    good = forward_command(control)
    assert np.abs(good.torque).max() > 3.0
    assert not control.notes
    control.solver = FAILING_SOLVERS[why]
    for tick in range(1, 6):
        command = forward_command(control)
        np.testing.assert_allclose(command.torque, good.torque * np.exp(-0.08 * tick))
        assert np.all(command.kd == 3.0)
        assert not np.any([command.kp, command.velocity])
        assert control.notes == (control_module.UNSOLVED,)
    assert control.unsolved_ticks == 5
    with pytest.raises(NoSolutionError, match=r"0\.02"):
        forward_command(control)


def test_one_solution_resets_the_count_of_unsolved_ticks(control: WholeBodyControl) -> None:
    sound, unsolvable = control.solver, FailingSolver()
    for solver in [unsolvable] * 4 + [sound] + [unsolvable] * 4:
        control.solver = solver
        command = forward_command(control)
    assert control.unsolved_ticks == 8
    assert np.all(np.isfinite(command.torque))


def test_a_run_without_a_solution_ends_damped_with_its_reason() -> None:
    policy = Balance(G1)
    policy.control.solver = FailingSolver(first_tick=100)
    trace = run_episode(G1, policy, Episode(lambda _: np.zeros(3), duration_s=0.6))
    assert trace.final_state == "ESTOP"
    assert "0.1 s" in trace.faults[0]


class TestBalance:
    """Targets at single times, calculated by hand, and a push on a plant without a bus."""

    CONFIG = replace(
        controller_settings(G1, "balance", BalanceConfig),
        capture_gain=0.5,
        max_lead_m=0.2,
        height=Feedback(60.0, 15.0),
        attitude=Feedback(100.0, 20.0),
        posture=Feedback(40.0, 12.0),
        momentum_damping=2.0,
        max_force=1.2,
        settle_s=0.5,
    )
    OFF = np.linspace(0.01, 0.2, N)

    @pytest.fixture
    def policy(self) -> Balance:
        return Balance(G1, self.CONFIG)

    def seen(self, time_s: float = 9.0, **more: Any) -> PolicyInput:
        return policy_input(G1, time_s, base_height=0.7, **more)

    def test_the_pressure_lies_beyond_the_capture_point_within_its_limit(self, policy: Balance) -> None:
        """Capture point x = c + v / w, pressure p = 1.5 x up to 0.2 m, and acceleration w^2 (c - p)."""

        def acceleration(offset: Any, velocity: Any) -> np.ndarray:
            now = REST["g1"]._replace(
                centre=offset + REST["g1"].feet_middle, centre_velocity=np.array(velocity)
            )
            return policy._centre_acceleration(now, 0.6)

        rate = math.sqrt(9.81 / policy.com_height_m)
        capture = np.array([0.02 + 0.1 / rate, -0.01 - 0.05 / rate])
        expected = rate**2 * (np.array([0.02, -0.01]) - 1.5 * capture)
        found = acceleration((0.02, -0.01, 0.6), (0.1, -0.05, 0.0))
        np.testing.assert_allclose(found, [*expected, 0.0], atol=1e-12)
        fast = np.array([1.2, 0.5, 0.0])  # a fall forward and a little to the left
        np.testing.assert_allclose(acceleration((0.0, 0.0, 0.6), fast)[:2], -(rate**2) * 0.2 * fast[:2] / 1.3)

    def test_a_tilted_base_is_turned_back(self, policy: Balance, monkeypatch: pytest.MonkeyPatch) -> None:
        """The acceleration is -100 tilt - 20 rate; roll is 0.02 rad, pitch -0.03 rad."""
        tilted = self.seen(turn=Rotation.from_rotvec([0.02, -0.03, 0.0]), gyro=(0.1, 0.2, -0.3))
        dynamics, *_, desired, _ = whole_body_arguments(policy, monkeypatch, tilted)
        np.testing.assert_allclose(desired.attitude, [-2.0 - 2.0, 3.0 - 4.0, 6.0], atol=0.05)
        np.testing.assert_allclose(desired.momentum_rate, -2.0 * dynamics.angular_momentum)

    def test_after_a_reset_the_pose_is_reached_in_time(
        self, policy: Balance, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """After a fifth of the time the targets have moved by a fifth, in joints and height."""
        crouched = self.seen(0.0, joint=G1.default_pose + self.OFF)
        policy.control.unsolved_ticks = 3
        policy.reset(crouched)
        assert policy.control.unsolved_ticks == 0
        crouched.sensed.joint_position[:] = 99.0
        for time_s, share in ((0.0, 0.0), (0.1, 0.2), (0.5, 1.0), (3.0, 1.0)):
            now = self.seen(time_s, joint=G1.default_pose + self.OFF)
            dynamics, *_, desired, _ = whole_body_arguments(policy, monkeypatch, now)
            np.testing.assert_allclose(desired.joints, -40.0 * share * self.OFF, atol=1e-9)
            low = float((dynamics.centre - dynamics.foot.mean(axis=0))[2]) - policy.com_height_m
            assert desired.centre[2] == pytest.approx(-60.0 * share * low)
            assert abs(low) > 1e-3
        assert policy.stance().tolist() == [1.0, 1.0]  # type: ignore[union-attr]
        assert (policy.rate_hz, policy.needs_estimate) == (self.CONFIG.rate_hz, True)

    def test_a_small_push_is_balanced_without_a_step(self) -> None:
        policy, push = Balance(G1), (0.6, np.array([-0.15, -0.15, 0.0]))
        result = walk(policy, DirectPlant(G1, seed=3), lambda _: np.zeros(3), 2.5, push=push)
        assert (result.fell, policy.control.unsolved_ticks) == (False, 0)
        moved = np.linalg.norm(np.array(result.position) - result.position[0], axis=1)
        assert moved.max() > 0.015
        assert moved[-1] < 0.02
        assert np.linalg.norm(result.velocity[-1]) < 0.05
