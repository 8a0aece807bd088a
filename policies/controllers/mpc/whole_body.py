"""The MPC's plan, executed by whole-body control.

The planned forces define the linear and angular acceleration of the whole body. From these and the desired
accelerations of the swing feet, a quadratic program on the full dynamics computes the joint torques at each
tick (after Kim et al. 2019, "Highly dynamic quadruped locomotion via whole-body impulse control and model
predictive control", with weights instead of null spaces).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from footfall.common.rotations import wrap_angle
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.controller import Mpc
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.whole_body.control import WholeBodyConfig, WholeBodyControl
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import Feedback, estimated_dynamics
from footfall.policies.controllers.whole_body.problem import Desired
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose


@dataclass(frozen=True)
class MpcWholeBodyConfig:
    """Settings of `MpcWholeBody`."""

    plan: MpcConfig  # its stance.kd, swing.kp, swing.kd and friction_compensation are not used
    swing: Feedback  # feedback on the trajectories of the swing feet
    posture: Feedback  # feedback of the joints towards the default pose
    whole_body: WholeBodyConfig
    sole: Feedback | None = None  # levels swing soles and turns them to the base's heading; None: point feet


class MpcWholeBody(Mpc):
    """Plans like `Mpc`, and moves the joints by whole-body control."""

    name = "mpc-wbc"

    def __init__(self, robot: Robot, config: MpcWholeBodyConfig | None = None) -> None:
        config = config or controller_settings(robot, self.name, MpcWholeBodyConfig)
        super().__init__(robot, config.plan)
        self._default_pose = robot.default_pose
        self._swing_feedback, self._posture = config.swing, config.posture
        self._sole_feedback = config.sole
        self.control = WholeBodyControl(robot, config.whole_body, 1.0 / self.rate_hz)
        foot = self.control.body.foot_of_point
        self._max_force = config.plan.contact.max_force_n / np.bincount(foot)[foot]

    @property
    def notes(self) -> Sequence[str]:
        return self.control.notes

    def reset(self, inputs: PolicyInput) -> None:
        super().reset(inputs)
        self.control.reset()

    def _joints(self, inputs: PolicyInput, base: Base, pose: LegPose, swing: np.ndarray) -> JointCommand:
        body, sensed = self.control.body, inputs.sensed
        dynamics = estimated_dynamics(body, inputs, self.slope.gravity)
        moment = self.wrenches.about(dynamics.foot - dynamics.centre)
        desired = Desired(
            centre=self.force.sum(axis=0) / self._body.mass + dynamics.gravity,
            momentum_rate=moment,
            attitude=self._body.inverse_inertia @ (moment @ base.rotation),
            feet=self._foot_accelerations(dynamics, sensed.joint_velocity, base, pose, swing),
            joints=self._posture(sensed.joint_position - self._default_pose, sensed.joint_velocity),
        )
        max_force = np.where(self.stands[body.foot_of_point], self._max_force, 0.0)
        return self.control.command(
            dynamics, sensed.joint_position, sensed.joint_velocity, desired, max_force
        )

    def _foot_accelerations(
        self, dynamics: Dynamics, joint_velocity: np.ndarray, base: Base, pose: LegPose, swing: np.ndarray
    ) -> np.ndarray:
        """Desired accelerations (feet, 6) of the swing feet, world axes; 0 for stance feet.
        Soles stay level and keep the heading of the base.
        """
        feet, swinging = np.zeros((self._legs.count, 6)), self._swinging
        if swinging:
            rates = self._legs.gather(joint_velocity)[swinging, :, None]
            velocity = (pose.jacobian[swinging] @ rates)[:, :, 0]
            correction = self._swing_feedback(pose.foot[swinging] - swing[:, 0], velocity - swing[:, 1])
            feet[swinging, :3] = (swing[:, 2] + correction) @ base.rotation.T
            if self._sole_feedback is not None:
                spin = dynamics.foot_jacobian[swinging, 3:] @ dynamics.velocity
                sole_error = _from_level(dynamics.foot_rotation[swinging], base.yaw)
                feet[swinging, 3:] = self._sole_feedback(sole_error, spin)
        return feet


def _from_level(rotation: np.ndarray, yaw: float) -> np.ndarray:
    """Small rotation vectors (k, 3), world, from level soles with the base's yaw to soles (k, 3, 3)."""
    yaw_errors = [wrap_angle(math.atan2(sole[1, 0], sole[0, 0]) - yaw) for sole in rotation]
    return np.column_stack([-rotation[:, 1, 2], rotation[:, 0, 2], yaw_errors])
