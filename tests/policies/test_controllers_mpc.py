"""Commands and plans of the MPC at single times."""

from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.problem import BodyState
from footfall.policies.controllers.settings import controller_settings
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
HEIGHT = float(LEGS.foot_radius.mean() - LEGS.default_foot[:, 2].mean())  # of the base, in the default pose


def standing(yaw: float = 0.0, time_s: float = 0.0, command: Any = (0.0, 0.0, 0.0)) -> PolicyInput:
    """Inputs of a robot in its default pose, level and at rest."""
    height = HEIGHT - LEGS.foot_radius[0]
    return policy_input(ROBOT, time_s, command, STILL, height, turn=Rotation.from_euler("z", yaw))


def forces(command: JointCommand) -> np.ndarray:
    """Ground forces (legs, 3), base frame, that correspond to the feed-forward torques of legs at rest."""
    pose = LEGS.pose(ROBOT.default_pose)
    contact = pose.jacobian + LEGS.rolling_offset(pose.axes, UP)
    torque = LEGS.gather(command.torque)[:, :, None]
    return -np.linalg.solve(contact.transpose(0, 2, 1), torque)[:, :, 0]


def yaw_moment(force: np.ndarray) -> float:
    """Moment of the forces about the vertical through the base, N m."""
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


@pytest.mark.parametrize(("begun", "now"), [(2.0, 2.1), (3.1, 3.2 - 2 * np.pi)])
def test_a_base_turned_to_the_left_is_pushed_back_to_the_right(begun: float, now: float) -> None:
    """The direction is right even at the heading where angles jump from pi to -pi."""
    policy = Mpc(ROBOT)
    policy.reset(standing(begun))
    assert yaw_moment(forces(policy.act(standing(now)))) < -0.5


class TestTicks:
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


class TestLegs:
    """`LegControl` in the default pose, with two diagonal feet on the ground."""

    FORCE = np.array([[3.0, -5.0, 60.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-8.0, 2.0, 40.0]])

    def command(self, swing_velocity: Any = STILL, swing_acceleration: Any = STILL) -> JointCommand:
        legs = LegControl(ROBOT, LEGS, nominal_body(ROBOT), CONFIG)
        swing = np.zeros((2, 3, 3))
        swing[:, 0] = LEGS.default_foot[1:3]
        swing[:, 1], swing[:, 2] = swing_velocity, swing_acceleration
        pose = LEGS.pose(ROBOT.default_pose)
        return legs.command(ROBOT.default_pose, pose, self.FORCE, STILL, STILL, UP, [1, 2], swing)

    def test_torques_hold_the_forces_at_the_points_of_contact(self) -> None:
        """The torque is -J' f, with MuJoCo's Jacobian of the lowest point of each foot."""
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

    def test_a_swinging_leg_is_given_the_torque_that_its_inertia_needs(self) -> None:
        """The torque is M times the joint acceleration that moves the foot as desired."""
        acceleration = np.array([5.0, 0.0, 8.0])
        torque = LEGS.gather(self.command(swing_acceleration=acceleration).torque)[1]
        joint = np.linalg.solve(LEGS.pose(ROBOT.default_pose).jacobian[1], acceleration)
        np.testing.assert_allclose(torque, nominal_body(ROBOT).leg_inertia[1] @ joint, atol=1e-9)
