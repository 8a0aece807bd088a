"""Joint commands from planned forces and swing trajectories."""

from typing import NamedTuple

import numpy as np

from footfall.common.arrays import as_slice, clamped
from footfall.common.rotations import skew
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.rigid_body import RigidBody

_INERTIA_SHARE = 0.5  # share of the peak torque available for the leg's own inertia


class _Stance(NamedTuple):
    """Arrays that depend only on which legs are in stance. Full size, because broadcasting takes longer."""

    swinging: np.ndarray | slice  # (k,) legs in swing
    contact: np.ndarray  # (legs, 3, m) 1 for legs in stance, else 0
    kp: np.ndarray  # (legs, m) N m/rad
    kd: np.ndarray  # (legs, m) N m s/rad


class LegControl:
    """Joint commands of stance legs and swing legs.

    A stance leg is a force source: its motors' stiffness is zero, and a small damping relative to the joint
    velocities of the commanded motion suppresses vibration. A swing leg is an impedance around its
    trajectory: the motors' PD, with the torque for the leg's inertia fed forward. For both, gearbox friction
    at the desired speed is fed forward.
    """

    def __init__(self, robot: Robot, legs: Legs, body: RigidBody, config: MpcConfig) -> None:
        self._legs, self._body = legs, body
        self._friction = legs.gather(robot.motor.friction) * config.friction_compensation
        self._friction_speed = legs.gather(robot.motor.friction_speed)
        # Lower and upper limits at full size: negating and broadcasting take longer.
        self._speeds = _symmetric(legs.gather(robot.motor.no_load_speed))
        self._inertia_torques = _symmetric(_INERTIA_SHARE * legs.gather(robot.motor.peak_torque))
        self._ones = np.ones((legs.count, legs.hinges))
        self._unit_limits = _symmetric(self._ones)
        self._swing, self._stand = config.swing, config.stance
        self._stances: dict[tuple[int, ...], _Stance] = {}
        zero = np.zeros(len(robot.joint_names))
        self._outside_legs = np.array([robot.default_pose, zero, robot.kp, robot.kd, zero])

    def command(
        self,
        joint_position: np.ndarray,
        pose: LegPose,
        force: np.ndarray,
        velocity: np.ndarray,
        angular_velocity: np.ndarray,
        up: np.ndarray,
        swinging: list[int],
        swing: np.ndarray,
    ) -> JointCommand:
        """Command of one tick. All vectors are in the base frame.

        Args:
            joint_position: (n,) rad, measured.
            pose: kinematics at this position.
            force: (legs, 3) N, of the ground on the feet; zero for swing legs.
            velocity: (3,) m/s, commanded velocity of the base.
            angular_velocity: (3,) rad/s, commanded angular velocity of the base.
            up: (3,) vertical direction.
            swinging: the k legs in swing.
            swing: (k, 3, 3) position, velocity and acceleration of their feet, relative to the base.
        """
        legs, stance = self._legs, self._stance(swinging)
        # A stance foot rolls: the point on the ground stands still and carries the force.
        jacobian = pose.jacobian + stance.contact * legs.rolling_offset(pose.axes, up)
        desired = np.zeros((legs.count, 3, 2))  # velocity and acceleration of the feet
        desired[:, :, 0] = pose.foot.dot(skew(angular_velocity)) - velocity
        desired[stance.swinging] = swing[:, 1:].transpose(0, 2, 1)
        rates = legs.joint_rates(jacobian, desired)
        joint_velocity = clamped(rates[:, :, 0], *self._speeds)
        inertia_torque = (self._body.leg_inertia @ rates[:, :, 1:])[:, :, 0]

        position = legs.gather(joint_position)
        if swinging:
            position[stance.swinging] = legs.solve(swing[:, 0], swinging)
        torque = clamped(inertia_torque, *self._inertia_torques)
        torque += legs.torque(jacobian, force)
        torque += self._friction * clamped(joint_velocity / self._friction_speed, *self._unit_limits)
        values = np.array((position, joint_velocity, stance.kp, stance.kd, torque))
        return JointCommand.of(legs.scatter(values, self._outside_legs))

    def _stance(self, swinging: list[int]) -> _Stance:
        key = tuple(swinging)
        if key not in self._stances:
            contact = np.ones((self._legs.count, 3, self._legs.hinges))
            kp, kd = 0.0 * self._ones, self._stand.kd * self._ones
            contact[swinging], kp[swinging], kd[swinging] = 0.0, self._swing.kp, self._swing.kd
            rows = as_slice(np.array(swinging)) if swinging else slice(0)
            self._stances[key] = _Stance(rows, contact, kp, kd)
        return self._stances[key]


def _symmetric(limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return -limit, limit
