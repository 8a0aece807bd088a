"""From planned forces and swing trajectories to joint commands."""

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.swing import SwingTarget
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.rigid_body import RigidBody

_INERTIA_SHARE = 0.5  # of the peak torque that may be spent on a leg's own inertia


class LegControl:
    """Joint commands of legs that stand and legs that swing.

    A leg that stands is a source of force: its motors' stiffness is zero, and a little damping about the
    joint velocities of the commanded motion keeps it quiet. A leg that swings is an impedance around its
    trajectory: the motors' own PD, with the torque that the leg's inertia needs fed forward. In both, the
    friction of the gearboxes at the wanted speed is fed forward.
    """

    def __init__(self, robot: Robot, legs: Legs, body: RigidBody, config: MpcConfig) -> None:
        self._robot, self._legs, self._body, self._config = robot, legs, body, config
        self._friction = legs.gather(robot.motor.friction) * config.friction_compensation
        self._friction_speed = legs.gather(robot.motor.friction_speed)
        self._most_speed = legs.gather(robot.motor.no_load_speed)
        self._most_inertia_torque = _INERTIA_SHARE * legs.gather(robot.motor.peak_torque)
        self._zero = np.zeros(len(robot.joint_names))

    def command(
        self,
        joint_position: np.ndarray,
        pose: LegPose,
        stands: np.ndarray,
        force: np.ndarray,
        velocity: np.ndarray,
        turn: np.ndarray,
        up: np.ndarray,
        swing: SwingTarget,
    ) -> JointCommand:
        """The command of one joint tick. All vectors are in the base frame.

        Args:
            joint_position: (n,) rad, measured.
            pose: kinematics at this position.
            stands: (legs,) boolean.
            force: (legs, 3) N, of the feet's on the robot.
            velocity: (3,) m/s, commanded, of the base.
            turn: (3,) rad/s, commanded.
            up: (3,) vertical.
            swing: of the feet that swing, relative to the base.
        """
        legs, config = self._legs, self._config
        held = stands[:, None]
        contact_jacobian = pose.jacobian + legs.rolling_offset(pose.axes, up)
        jacobian = np.where(held[:, :, None], contact_jacobian, pose.jacobian)
        foot_velocity = np.where(held, -velocity - cross(turn, pose.foot), swing.velocity)
        motion = np.linalg.solve(jacobian, np.stack([foot_velocity, swing.acceleration], axis=2))
        joint_velocity = _within(motion[:, :, 0], self._most_speed)
        inertia_torque = (self._body.leg_inertia @ motion[:, :, 1:])[:, :, 0]

        torque = np.where(
            held,
            -(force[:, None, :] @ contact_jacobian)[:, 0],
            _within(inertia_torque, self._most_inertia_torque),
        )
        torque += self._friction * _within(joint_velocity / self._friction_speed, 1.0)
        return JointCommand(
            position=legs.scatter(
                np.where(held, joint_position[legs.joints], legs.solve(swing.position)),
                self._robot.default_pose,
            ),
            velocity=legs.scatter(joint_velocity, self._zero),
            kp=legs.scatter(np.where(held, 0.0, config.swing.kp), self._robot.kp),
            kd=legs.scatter(np.where(held, config.stance.kd, config.swing.kd), self._robot.kd),
            torque=legs.scatter(torque, self._zero),
        )


def _within(value: np.ndarray, most: np.ndarray | float) -> np.ndarray:
    return np.minimum(np.maximum(value, -most), most)
