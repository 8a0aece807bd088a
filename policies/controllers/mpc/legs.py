"""From planned forces and swing trajectories to joint commands."""

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import MpcConfig
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
        self._legs, self._body = legs, body
        self._friction = legs.gather(robot.motor.friction) * config.friction_compensation
        self._friction_speed = legs.gather(robot.motor.friction_speed)
        self._most_speed = legs.gather(robot.motor.no_load_speed)
        self._most_inertia_torque = _INERTIA_SHARE * legs.gather(robot.motor.peak_torque)
        swing, stance = config.swing, config.stance
        self._gains = np.array([[swing.kp, 0.0], [swing.kd, stance.kd]])  # kp and kd, by `stands`
        zero = np.zeros(len(robot.joint_names))
        self._outside_legs = np.array([robot.default_pose, zero, robot.kp, robot.kd, zero])

    def command(
        self,
        joint_position: np.ndarray,
        pose: LegPose,
        stands: np.ndarray,
        force: np.ndarray,
        velocity: np.ndarray,
        turn: np.ndarray,
        up: np.ndarray,
        swinging: list[int],
        swing: np.ndarray,
    ) -> JointCommand:
        """The command of one joint tick. All vectors are in the base frame.

        Args:
            joint_position: (n,) rad, measured.
            pose: kinematics at this position.
            stands: (legs,) boolean.
            force: (legs, 3) N, of the ground on the feet; zero of those that swing.
            velocity: (3,) m/s, commanded, of the base.
            turn: (3,) rad/s, commanded.
            up: (3,) vertical.
            swinging: the k legs that do not stand.
            swing: (k, 3, 3) position, velocity and acceleration of their feet, relative to the base.
        """
        legs = self._legs
        # A standing foot rolls: it is the point on the ground that stands still and carries the force.
        jacobian = pose.jacobian + stands[:, None, None] * legs.rolling_offset(pose.axes, up)
        wanted = np.zeros((legs.count, 3, 2))  # velocity and acceleration of the feet
        wanted[:, :, 0] = -velocity - cross(turn, pose.foot)
        wanted[swinging] = swing[:, 1:].transpose(0, 2, 1)
        motion = legs.joint_rates(jacobian, wanted)
        joint_velocity = _within(motion[:, :, 0], self._most_speed)
        inertia_torque = (self._body.leg_inertia @ motion[:, :, 1:])[:, :, 0]

        values = np.empty((5, legs.count, legs.hinges))
        values[0] = legs.gather(joint_position)
        if swinging:
            values[0, swinging] = legs.solve(swing[:, 0], swinging)
        values[1] = joint_velocity
        values[2:4] = self._gains[:, stands.view(np.uint8), None]
        values[4] = _within(inertia_torque, self._most_inertia_torque)
        values[4] += legs.torque(jacobian, force)
        values[4] += self._friction * _within(joint_velocity / self._friction_speed, 1.0)
        return JointCommand(*legs.scatter(values, self._outside_legs))


def _within(value: np.ndarray, most: np.ndarray | float) -> np.ndarray:
    return np.minimum(np.maximum(value, -most), most)
