"""Commands and plans of the MPC at single times."""

from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.problem import BodyState
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.solver import BoundedSolver
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.gaits import find_gait
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import load_robot
from footfall.robots.mjcf import load_spec
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
CONFIG = controller_settings(ROBOT, "mpc", MpcConfig)
LEGS = ROBOT.legs
UP = np.array([0.0, 0.0, 1.0])
STILL = np.zeros(3)
TROT = np.array([True, False, False, True])
HEIGHT = float(LEGS.foot_radius.mean() - LEGS.default_foot[:, 2].mean())  # of the base, in the default pose


def standing(
    yaw: float = 0.0, time_s: float = 0.0, command: Any = (0.0, 0.0, 0.0), velocity: Any = STILL
) -> PolicyInput:
    """In the default pose, level, base velocity in the body frame."""
    height = HEIGHT - LEGS.foot_radius[0]
    return policy_input(ROBOT, time_s, command, velocity, height, turn=Rotation.from_euler("z", yaw))


def forces(command: JointCommand) -> np.ndarray:
    """Ground forces (legs, 3), base frame, that correspond to the feed-forward torques of legs at rest."""
    pose = LEGS.pose(ROBOT.default_pose)
    contact = pose.jacobian + LEGS.rolling_offset(pose.axes, UP)
    torque = LEGS.gather(command.torque)[:, :, None]
    return -np.linalg.solve(contact.transpose(0, 2, 1), torque)[:, :, 0]


def yaw_moment(force: np.ndarray) -> float:
    """About the vertical through the base, N m."""
    feet = LEGS.default_foot
    return float((feet[:, 0] * force[:, 1] - feet[:, 1] * force[:, 0]).sum())


class Planned(NamedTuple):
    """Arguments of `ForceProblems.build`."""

    state: BodyState
    reference: BodyState
    contacts: np.ndarray
    feet: np.ndarray
    before: np.ndarray
    friction: float
    gravity: np.ndarray


class TestStanding:
    @pytest.mark.parametrize(("begun", "now"), [(2.0, 2.1), (3.1, 3.2 - 2 * np.pi)])
    def test_turned_to_the_left_it_pushes_back_to_the_right(self, begun: float, now: float) -> None:
        """Also at the heading where angles jump from pi to -pi."""
        policy = Mpc(ROBOT)
        policy.reset(standing(begun))
        assert yaw_moment(forces(policy.act(standing(now)))) < -0.5

    @pytest.mark.parametrize("yaw", [0.0, 2.0])
    def test_a_push_to_the_left_is_met_with_force_to_the_right(self, yaw: float) -> None:
        policy = Mpc(ROBOT)
        policy.reset(standing(yaw))
        force = forces(policy.act(standing(yaw, velocity=(0.0, 0.2, 0.0))))
        assert force[:, 1].sum() < -5.0
        assert abs(force[:, 0].sum()) < 1.0


def base(**changes: object) -> Base:
    """At rest and level at the origin, unless the arguments differ."""
    level = Base(0j, 0.28, np.zeros(3), np.eye(3), np.zeros(3), 0.0, 0.0, 0.0)
    return level._replace(**changes)  # type: ignore[arg-type]


class TestSwingBegins:
    @pytest.mark.parametrize("yaw", [0.0, 1.1])
    def test_its_foot_aims_for_its_position_under_a_body_that_hardly_moves(self, yaw: float) -> None:
        policy = Mpc(ROBOT)
        policy.reset(standing(yaw))
        for tick in range(2):
            now = standing(yaw, time_s=1.0 + tick / policy.rate_hz, command=(0.5, 0.0, 0.0))
            swinging = LEGS.gather(policy.act(now).kp)[:, 0] > 0
        stance = CONFIG.stance
        nominal = nominal_feet(LEGS, stance.height_m, stance.outward_m, stance.shift_m)
        under = Rotation.from_euler("z", yaw).apply(nominal)
        np.testing.assert_allclose(policy.swing_feet.target[swinging, :2], under[swinging, :2], atol=0.005)

    def test_a_foot_in_the_air_keeps_the_position_of_its_lift_off(self) -> None:
        """The position stays for later plans, while the base moves over it."""
        policy = Mpc(ROBOT)
        policy.reset(standing())
        for tick in range(20):
            velocity = (0.0, 0.0, 0.0) if tick < 2 else (0.5, 0.0, 0.0)
            now = standing(time_s=1.0 + tick / policy.rate_hz, command=(0.5, 0.0, 0.0), velocity=velocity)
            swinging = LEGS.gather(policy.act(now).kp)[:, 0] > 0
            if tick == 1:
                begun, lifted = swinging, policy.swing_feet.lift_off[swinging].copy()
        np.testing.assert_array_equal(swinging, begun)
        np.testing.assert_array_equal(policy.swing_feet.lift_off[swinging], lifted)

    def test_without_a_solution_standing_feet_keep_force(self, monkeypatch: pytest.MonkeyPatch) -> None:
        policy = Mpc(ROBOT)
        policy.reset(standing())
        policy.act(standing())
        monkeypatch.setattr(policy.forces.solver, "solve", lambda problem: None)
        for tick in range(3):
            policy.act(standing(time_s=1.0 + tick / policy.rate_hz, command=(0.5, 0.0, 0.0)))
        pressed = policy.force[:, 2] > 1.0
        np.testing.assert_array_equal(pressed, policy.stands)
        assert pressed.sum() == 2


class TestTicks:
    """Result of a tick of `act`."""

    def test_a_tilted_robot_moves_along_the_ground_and_turns_about_the_vertical(self) -> None:
        """Standing feet move at -(v + w x r) relative to the base; v is horizontal, w vertical."""
        policy = Mpc(ROBOT)
        yaw = 0.7
        tilted = Rotation.from_euler("ZYX", [yaw, -0.3, 0.2])
        x, y, z, w = tilted.as_quat()
        seen = standing()
        seen = seen._replace(sensed=seen.sensed._replace(quaternion=np.array([w, x, y, z])))
        policy.reset(seen)
        policy.command.value = np.array([0.4, -0.1, 0.8])  # not yet settled: the target stays
        command = policy.act(seen)
        up = tilted.inv().apply(UP)
        velocity = tilted.inv().apply(Rotation.from_euler("z", yaw).apply([0.4, -0.1, 0.0]))
        pose = LEGS.pose(ROBOT.default_pose)
        contact = pose.jacobian + LEGS.rolling_offset(pose.axes, up)
        passed = (contact @ LEGS.gather(command.velocity)[:, :, None])[:, :, 0]
        np.testing.assert_allclose(passed, -(velocity + np.cross(0.8 * up, pose.foot)), atol=1e-9)

    def test_no_foot_is_lifted_and_no_command_followed_before_the_robot_has_settled(self) -> None:
        policy = Mpc(ROBOT)
        policy.reset(standing())
        for time_s in (0.0, 0.5 * CONFIG.settle_s, 0.99 * CONFIG.settle_s):
            command = policy.act(standing(time_s=time_s, command=(0.5, 0.0, 0.3)))
            assert not command.kp.any()
            assert not command.velocity.any()
            np.testing.assert_array_equal(policy.stance(), 1.0)
        command = policy.act(standing(time_s=CONFIG.settle_s, command=(0.5, 0.0, 0.3)))
        assert command.kp.any()

    def test_plans_that_took_the_second_solver_are_counted(self) -> None:
        policy = Mpc(ROBOT)
        policy.reset(standing())
        policy.act(standing())
        assert policy.late == 0
        policy.forces.solver = BoundedSolver(daqp_iterations=0)
        policy.reset(standing())
        policy.act(standing(velocity=(0.0, 3.0, 0.0)))  # pushed: friction counts
        assert policy.late == 1


class TestPlan:
    """Inputs of a plan."""

    @pytest.fixture
    def policy(self) -> Mpc:
        return Mpc(ROBOT)

    @pytest.fixture
    def planned(self, policy: Mpc, monkeypatch: pytest.MonkeyPatch) -> list[Planned]:
        """All plans of the policy."""
        plans = []
        build = policy.forces.problems.build

        def seen(*situation: Any) -> object:
            plans.append(Planned(*situation[:2], situation[2].copy(), *situation[3:]))
            return build(*situation)

        monkeypatch.setattr(policy.forces.problems, "build", seen)
        return plans

    def test_it_counts_all_feet_as_on_the_ground(self, policy: Mpc, planned: list[Planned]) -> None:
        """Contact does not depend on the heights by the kinematics of a tilted or badly estimated base."""
        low = standing()._replace(base_height=HEIGHT - 0.07)
        policy.reset(low)
        policy.act(low)
        for tick in range(2):
            policy.act(low._replace(time_s=1.0 + tick / policy.rate_hz, command=np.array([0.5, 0.0, 0.0])))
        assert len(planned) == 2
        for state, _, _, feet, *_ in planned:
            np.testing.assert_allclose(feet[:, :, 2], -state.pose[5], atol=1e-12)

    def test_a_plan_contains_present_and_scheduled_contacts(
        self, policy: Mpc, planned: list[Planned]
    ) -> None:
        """The first step has the present contacts, the others those of the clock at their middle."""
        policy.reset(standing())
        gait, horizon = CONFIG.gait, CONFIG.horizon
        duty, phase = find_gait(gait.name, ROBOT)
        middle = (np.arange(horizon.steps) + 0.5) * horizon.step_s
        for tick in range(round(gait.period_s * policy.rate_hz)):
            before = len(planned)
            now = standing(time_s=1.0 + tick / policy.rate_hz, command=(0.5, 0.0, 0.0))
            stands = LEGS.gather(policy.act(now).kp)[:, 0] == 0
            walked_s = (tick + 1) / policy.rate_hz
            for _, _, contacts, *_ in planned[before:]:
                np.testing.assert_array_equal(contacts[0], stands)
                later = ((walked_s + middle[1:, None]) / gait.period_s + phase) % 1.0 < (gait.duty or duty)
                np.testing.assert_array_equal(contacts[1:], later)
        assert len(planned) > 10

    def test_it_begins_from_the_applied_forces(self, policy: Mpc, planned: list[Planned]) -> None:
        """At first an even share of the weight; later the previous plan, rotated to the present heading."""
        for _ in range(2):
            policy.reset(standing(2.0))
            policy.act(standing(2.0, velocity=(0.0, 0.4, 0.0)))
            even = [0.0, 0.0, nominal_body(ROBOT).mass * 9.81 / LEGS.count]
            np.testing.assert_allclose(planned[-1].before, np.tile(even, (LEGS.count, 1)))
        first = forces(policy.act(standing(2.0)))
        while len(planned) < 3:
            policy.act(standing(2.3))
        turned = Rotation.from_euler("z", -0.3).apply(first)
        np.testing.assert_allclose(planned[-1].before, turned, atol=1e-6)
        assert first[:, 1].sum() < -5.0

    def test_a_foots_second_step_is_under_the_body(self, policy: Mpc, planned: list[Planned]) -> None:
        """Turning left at 1 rad/s, one pair is about to lift off; at the horizon's end it stands again."""
        policy.reset(standing())
        for tick in range(round(0.49 * CONFIG.gait.period_s * policy.rate_hz)):
            policy.act(standing(time_s=1.0 + tick / policy.rate_hz, command=(0.0, 0.0, 1.0)))
        _, reference, contacts, feet, *_ = planned[-1]
        again = contacts[0] & ~contacts[3] & contacts[-1]
        assert again.sum() == 2
        stance = CONFIG.stance
        nominal = nominal_feet(LEGS, stance.height_m, stance.outward_m, stance.shift_m)
        yaw = reference.pose[-1, 2]
        assert yaw > 0.2
        turned = Rotation.from_euler("z", yaw).apply(nominal)
        np.testing.assert_allclose(feet[-1, again, :2], turned[again, :2], atol=1e-9)


class TestLegs:
    """`LegControl` with a diagonal down, in the default pose."""

    FORCE = np.array([[3.0, -5.0, 60.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-8.0, 2.0, 40.0]])

    def command(
        self,
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw_rate: float = 0.0,
        swing_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        swing_acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> JointCommand:
        legs = LegControl(ROBOT, LEGS, nominal_body(ROBOT), CONFIG)
        swing = np.zeros((2, 3, 3))
        swing[:, 0] = LEGS.default_foot[1:3]
        swing[:, 1], swing[:, 2] = swing_velocity, swing_acceleration
        pose = LEGS.pose(ROBOT.default_pose)
        return legs.command(
            ROBOT.default_pose, pose, self.FORCE, np.array(velocity), yaw_rate * UP, UP, [1, 2], swing
        )

    def test_standing_legs_give_forces_and_swinging_legs_follow_positions(self) -> None:
        command = self.command()
        kp, kd = LEGS.gather(command.kp), LEGS.gather(command.kd)
        np.testing.assert_array_equal(kp[TROT], 0.0)
        np.testing.assert_array_equal(kp[~TROT], CONFIG.swing.kp)
        np.testing.assert_array_equal(kd[TROT], CONFIG.stance.kd)
        np.testing.assert_array_equal(kd[~TROT], CONFIG.swing.kd)
        assert CONFIG.stance.kd != CONFIG.swing.kd
        np.testing.assert_allclose(LEGS.gather(command.position)[~TROT], LEGS.default_angles[~TROT])

    def test_torques_hold_the_forces_at_the_points_of_contact(self) -> None:
        """Compared with MuJoCo's Jacobian of the lowest point of each foot: torque = -J' f."""
        model = load_spec(ROBOT.xml_path).compile()
        data = mujoco.MjData(model)
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        joints = [model.joint(name).id for name in ROBOT.joint_names]
        data.qpos[model.jnt_qposadr[joints]] = ROBOT.default_pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        torque = LEGS.gather(self.command().torque)
        for leg in (0, 3):
            geom = model.geom(ROBOT.description.feet[leg].geoms[0]).id
            jacobian = np.zeros((3, model.nv))
            lowest = data.geom_xpos[geom] - LEGS.foot_radius[leg] * UP
            mujoco.mj_jac(model, data, jacobian, None, lowest, model.geom_bodyid[geom])
            dofs = model.jnt_dofadr[np.array(joints)[LEGS.joints[leg]]]
            np.testing.assert_allclose(torque[leg], -jacobian[:, dofs].T @ self.FORCE[leg], atol=1e-9)

    def test_friction_is_fed_forward_along_the_desired_motion(self) -> None:
        """Above its friction speed a joint gets the whole compensated share."""
        fast = self.command(swing_velocity=(1.0, 0.5, 1.0))
        speed, torque = LEGS.gather(fast.velocity)[1], LEGS.gather(fast.torque)[1]
        expected = CONFIG.friction_compensation * LEGS.gather(ROBOT.motor.friction)[1] * np.sign(speed)
        assert np.all(np.abs(speed) > LEGS.gather(ROBOT.motor.friction_speed)[1])
        np.testing.assert_allclose(torque, expected)

    def test_joint_velocities_stay_within_the_no_load_speed(self) -> None:
        speed = LEGS.gather(self.command(swing_velocity=(30.0, 10.0, 30.0)).velocity)[1]
        most = LEGS.gather(ROBOT.motor.no_load_speed)[1]
        assert np.all(np.abs(speed) <= most)
        assert np.any(np.abs(speed) == most)

    def test_a_swinging_leg_is_given_the_torque_that_its_inertia_needs(self) -> None:
        """M times the joint acceleration that moves the foot as desired."""
        acceleration = np.array([5.0, 0.0, 8.0])
        torque = LEGS.gather(self.command(swing_acceleration=tuple(acceleration)).torque)[1]
        joint = np.linalg.solve(LEGS.pose(ROBOT.default_pose).jacobian[1], acceleration)
        np.testing.assert_allclose(torque, nominal_body(ROBOT).leg_inertia[1] @ joint, atol=1e-9)
