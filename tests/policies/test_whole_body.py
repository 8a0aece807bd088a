"""Whole-body control against statics computed by hand and MuJoCo's inverse dynamics."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.common.rotations import normalised
from footfall.policies.controllers.solver import BoundedSolver
from footfall.policies.controllers.whole_body import control as control_module
from footfall.policies.controllers.whole_body.control import (
    JointFeedback,
    NoSolutionConfig,
    NoSolutionError,
    WholeBodyConfig,
    WholeBodyControl,
)
from footfall.policies.controllers.whole_body.dynamics import Dynamics, Motion, WholeBody
from footfall.policies.controllers.whole_body.feedback import base_tilt, rest_dynamics
from footfall.policies.controllers.whole_body.problem import Contact, Desired, QuadraticPrograms, Weights
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot, load_robot
from footfall.robots.feet import foot_geoms
from footfall.robots.mjcf import load_spec

G1, GO1 = load_robot("g1"), load_robot("go1")
BODIES = {"g1": WholeBody(G1), "go1": WholeBody(GO1)}
ROBOTS = {"g1": G1, "go1": GO1}
CONFIG = WholeBodyConfig(
    Weights(
        contact=100.0,
        centre=10.0,
        momentum=1.0,
        attitude=0.05,
        swing=10.0,
        swing_attitude=0.3,
        posture=1e-3,
        force=1e-2,
    ),
    Contact(friction=0.5, damping=5.0),
    JointFeedback(kp=0.0, kd=1.0, memory_s=0.05, friction_compensation=0.0),
    NoSolutionConfig(fade_s=0.05, kd=3.0, max_s=0.02),
)
STILL = {
    name: Desired(
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((body.feet, 6)),
        np.zeros(len(ROBOTS[name].joint_names)),
    )
    for name, body in BODIES.items()
}


def some_motion(robot: Robot, seed: int) -> Motion:
    rng = np.random.default_rng(seed)
    n = len(robot.joint_names)
    return Motion(
        normalised(np.array([1.0, 0.2, -0.3, 0.5])),
        rng.normal(size=3),
        rng.normal(size=3),
        robot.default_pose + 0.1 * rng.normal(size=n),
        rng.normal(size=n),
    )


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


def solved(robot: Robot, dynamics: Dynamics, desired: Desired, **changes: Any) -> tuple[np.ndarray, ...]:
    """Forces (points, 3), accelerations (nv,) and torques (n,) of one tick; all points may press."""
    body = BODIES[robot.name]
    max_force = changes.get("max_force", np.full(body.points, 1e4))
    torque = changes.get("max_torque", robot.motor.peak_torque)
    weights = changes.get("weights", CONFIG.weights)
    programs = QuadraticPrograms(
        body.foot_of_point,
        len(robot.joint_names),
        body.total_mass,
        weights,
        changes.get("contact", CONFIG.contact),
    )
    program, torque_map = programs.build(dynamics, desired, max_force, -torque, torque)
    x = BoundedSolver().solve(program)
    assert x is not None
    force = np.zeros((body.points, 3))
    force[torque_map.standing] = x[: 3 * len(torque_map.standing)].reshape(-1, 3)
    return (
        force,
        torque_map.acceleration @ x + torque_map.acceleration_offset,
        torque_map.torque @ x + torque_map.torque_offset,
    )


class TestDynamics:
    @pytest.mark.parametrize("name", ROBOTS)
    def test_mass_and_bias_are_those_of_mujocos_inverse_dynamics(self, name: str) -> None:
        robot, motion = ROBOTS[name], some_motion(ROBOTS[name], 3)
        model, data, order = moved(robot, motion)
        acceleration = np.random.default_rng(4).normal(size=model.nv)
        data.qacc[order] = acceleration
        mujoco.mj_inverse(model, data)
        dynamics = BODIES[name].update(motion)
        np.testing.assert_allclose(
            dynamics.mass @ acceleration + dynamics.bias, data.qfrc_inverse[order], atol=1e-8
        )

    @pytest.mark.parametrize("name", ROBOTS)
    def test_points_accelerate_by_jacobian_and_drift(self, name: str) -> None:
        """The accelerations equal differences of the points' positions in the world."""
        robot, motion = ROBOTS[name], some_motion(ROBOTS[name], 5)
        dynamics = BODIES[name].update(motion)
        model, data, order = moved(robot, motion)
        acceleration = np.random.default_rng(6).normal(size=model.nv)
        mujoco.mj_kinematics(model, data)
        geoms = np.concatenate(foot_geoms(model, robot.description))
        links = model.geom_bodyid[geoms]
        turn = data.xmat[links].reshape(-1, 3, 3)
        own = ((dynamics.point - data.xpos[links])[:, None] @ turn)[:, 0]
        start, speed, h = data.qpos.copy(), dynamics.velocity, 1e-4
        positions = []
        for t in (-h, 0.0, h):
            data.qpos[:] = start
            step = np.zeros(model.nv)
            step[order] = speed * t + acceleration * t * t / 2
            mujoco.mj_integratePos(model, data.qpos, step, 1.0)
            mujoco.mj_kinematics(model, data)
            positions.append(
                data.xpos[links] + (data.xmat[links].reshape(-1, 3, 3) @ own[:, :, None])[:, :, 0]
            )
        before, now, after = positions
        velocity = dynamics.point_jacobian @ speed
        np.testing.assert_allclose((after - before) / (2 * h), velocity, atol=1e-5)
        desired = dynamics.point_jacobian @ acceleration + dynamics.point_drift
        np.testing.assert_allclose((after - 2 * now + before) / h**2, desired, atol=2e-4)


def test_the_base_tilt_is_roll_and_pitch_and_the_yaw_relative_to_the_feet() -> None:
    for base, feet, tilt in (
        # A base at 1.3 rad on feet at 1.0 rad, toes out by 0.2 rad, has turned left by 0.3 rad.
        (Rotation.from_rotvec([0.0, 0.0, 1.3]), (1.2, 0.8), [0.0, 0.0, 0.3]),
        # Roll is in the body frame, whatever the heading.
        (Rotation.from_euler("ZYX", [2.0, 0.0, 0.1]), (2.0, 2.0), [np.sin(0.1), 0.0, 0.0]),
    ):
        dynamics = SimpleNamespace(foot_rotation=Rotation.from_rotvec([[0, 0, h] for h in feet]).as_matrix())
        found = base_tilt(base.as_quat(scalar_first=True), dynamics)  # type: ignore[arg-type]
        np.testing.assert_allclose(found, tilt, atol=1e-12)


class TestStanding:
    @pytest.mark.parametrize("name", ROBOTS)
    def test_the_ground_carries_the_weight_and_nothing_moves(self, name: str) -> None:
        robot, body = ROBOTS[name], BODIES[name]
        force, acceleration, _ = solved(robot, rest_dynamics(body, robot), STILL[name])
        np.testing.assert_allclose(force.sum(axis=0), [0, 0, body.total_mass * 9.81], atol=0.2)
        np.testing.assert_allclose(acceleration, 0.0, atol=0.01)

    @pytest.mark.parametrize("name", ROBOTS)
    def test_torques_balance_the_forces_and_the_legs_own_weight(self, name: str) -> None:
        """The torques equal inverse dynamics with the same accelerations and forces at the same points."""
        robot, body = ROBOTS[name], BODIES[name]
        dynamics = rest_dynamics(body, robot)
        force, acceleration, torque = solved(
            robot, dynamics, STILL[name]._replace(centre=np.array([0.7, -0.4, 0.5]))
        )
        n = len(robot.joint_names)
        level = Motion(np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3), robot.default_pose, np.zeros(n))
        model, data, order = moved(robot, level)
        data.qacc[order] = acceleration
        mujoco.mj_inverse(model, data)
        from_ground = np.zeros(model.nv)
        geoms = np.concatenate(foot_geoms(model, robot.description))
        for geom, point, f in zip(geoms, dynamics.point, force, strict=True):
            mujoco.mj_applyFT(model, data, f, np.zeros(3), point, model.geom_bodyid[geom], from_ground)
        left = (data.qfrc_inverse - from_ground)[order]
        np.testing.assert_allclose(left[:6], 0.0, atol=1e-6)
        np.testing.assert_allclose(left[6:], torque, atol=1e-6)

    def test_a_foot_with_a_force_limit_of_zero_carries_no_load(self) -> None:
        dynamics = rest_dynamics(BODIES["g1"], G1)
        max_force = np.where(BODIES["g1"].foot_of_point == 1, 200.0, 0.0)
        force, acceleration, _ = solved(G1, dynamics, STILL["g1"], max_force=max_force)
        assert not force[:4].any()
        # One foot cannot carry the body here unless it turns or falls towards the other side.
        assert abs(acceleration[:6]).max() > 0.5


def test_a_foot_in_the_air_has_the_desired_acceleration_and_standing_points_come_to_rest() -> None:
    """The robot is in motion, so the drift terms matter, and the weights are large."""
    body = BODIES["g1"]
    rng = np.random.default_rng(8)
    spin = Motion(
        normalised(np.array([1.0, 0.02, -0.03, 0.4])),
        0.1 * rng.normal(size=3),
        0.5 * rng.normal(size=3),
        G1.default_pose + 0.05 * rng.normal(size=12),
        rng.normal(size=12),
    )
    dynamics = body.update(spin)
    desired = np.zeros((2, 6))
    desired[1] = 1.0, -2.0, 3.0, 4.0, -5.0, 6.0
    max_force = np.where(body.foot_of_point == 0, 1e4, 0.0)
    weights = replace(CONFIG.weights, contact=1e6, swing=1e5, swing_attitude=1e5)
    _, acceleration, _ = solved(
        *(G1, dynamics, STILL["g1"]._replace(feet=desired)),
        max_force=max_force,
        weights=weights,
        contact=replace(CONFIG.contact, friction=5.0),  # so that the foot can be held
    )
    foot = dynamics.foot_jacobian[1] @ acceleration + dynamics.foot_drift[1]
    np.testing.assert_allclose(foot, desired[1], atol=0.05)
    left = body.foot_of_point == 0
    points = dynamics.point_jacobian[left] @ acceleration + dynamics.point_drift[left]
    slowing = -5.0 * (dynamics.point_jacobian[left] @ dynamics.velocity)
    # A rigid sole cannot slow down each corner, since corners circle about its middle.
    np.testing.assert_allclose(points.mean(axis=0), slowing.mean(axis=0), atol=0.05)
    assert np.abs(dynamics.foot_drift[1]).max() > 0.3
    assert np.abs(dynamics.point_drift[left]).max() > 0.3


class TestLimits:
    def test_forces_stay_in_their_cones(self) -> None:
        dynamics = rest_dynamics(BODIES["g1"], G1)
        force, _, _ = solved(G1, dynamics, STILL["g1"]._replace(centre=np.array([9.0, -7.0, 0.0])))
        sideways = np.abs(force[:, :2])
        assert np.all(sideways <= 0.5 * force[:, 2:] + 1e-6)
        assert np.any(sideways > 0.5 * force[:, 2:] - 1e-3)
        assert np.all(force[:, 2] >= -1e-9)

    def test_torques_stay_in_their_limits(self) -> None:
        dynamics = rest_dynamics(BODIES["g1"], G1)
        max_torque = np.linspace(3.0, 9.0, 12)
        _, _, torque = solved(G1, dynamics, STILL["g1"], max_torque=max_torque)
        assert np.all(np.abs(torque) <= max_torque + 1e-6)
        assert np.any(np.abs(torque) > max_torque - 1e-3)  # the knees would need more


def contradicting(solver: BoundedSolver) -> BoundedSolver:
    """Gives the solver contradictory limits of torques and forces."""
    solve = solver.solve
    solver.solve = lambda problem: solve(problem._replace(lower=problem.upper + 1.0))  # type: ignore
    return solver


def blind(solver: BoundedSolver) -> BoundedSolver:
    """Gives the solver NaN."""
    solve = solver.solve
    solver.solve = lambda problem: solve(problem._replace(gradient=problem.gradient * np.nan))  # type: ignore
    return solver


def hurried(_: BoundedSolver) -> BoundedSolver:
    """Stops the solver before it has converged."""
    return BoundedSolver(1, 2, accept_unfinished=False)


FAILING_SOLVERS = {"infeasible": contradicting, "late": hurried, "not a number": blind}


class TestJoints:
    """Parts of the command other than torques: gains, references, friction."""

    def control(self, **joints: float) -> WholeBodyControl:
        return WholeBodyControl(G1, replace(CONFIG, joints=replace(CONFIG.joints, **joints)), dt_s=0.004)

    def test_a_share_of_the_friction_at_the_desired_speed_is_compensated(self) -> None:
        """Dry friction is proportional to the speed below `friction_speed` and constant above.

        Damping is viscous.
        """
        motor, control = G1.motor, self.control(friction_compensation=0.6)
        for times, developed in ((0.5, 0.5), (-0.5, -0.5), (4.0, 1.0), (-4.0, -1.0)):
            speed = times * motor.friction_speed
            expected = 0.6 * (developed * motor.friction + motor.damping * speed)
            np.testing.assert_allclose(control._friction(speed), expected)
        assert motor.friction.min() > 0.0


class TestTicksWithoutSolution:
    dynamics = rest_dynamics(BODIES["g1"], G1)

    def command(self, control: WholeBodyControl) -> JointCommand:
        """Command for a robot at rest that must accelerate forward, so that toes and heels differ."""
        desired = STILL["g1"]._replace(centre=np.array([0.8, 0.0, 0.0]))
        return control.command(self.dynamics, G1.default_pose, np.zeros(12), desired, np.full(8, 300.0))

    @pytest.mark.parametrize("why", FAILING_SOLVERS)
    def test_without_a_solution_the_torques_fade_into_damping_with_a_note(self, why: str) -> None:
        control = WholeBodyControl(G1, CONFIG, dt_s=0.004)
        good = self.command(control)
        assert np.abs(good.torque).max() > 3.0
        assert not control.notes
        control.solver = FAILING_SOLVERS[why](control.solver)
        for tick in range(1, 6):
            command = self.command(control)
            np.testing.assert_allclose(command.torque, good.torque * np.exp(-0.08 * tick))
            assert np.all(command.kd == 3.0)
            assert not command.kp.any()
            assert not command.velocity.any()
            assert control.notes == (control_module.UNSOLVED,)
        assert control.unsolved_ticks == 5
        with pytest.raises(NoSolutionError, match=r"0\.02"):
            self.command(control)

    def test_one_solution_resets_the_count_of_unsolved_ticks(self) -> None:
        control = WholeBodyControl(G1, CONFIG, dt_s=0.004)
        sound, unsolvable = control.solver, contradicting(BoundedSolver())
        for solver in [unsolvable] * 4 + [sound] + [unsolvable] * 4:
            control.solver = solver
            command = self.command(control)
        assert control.unsolved_ticks == 8
        assert np.all(np.isfinite(command.torque))
