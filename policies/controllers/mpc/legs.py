"""From planned forces and swing trajectories to joint commands."""

from typing import NamedTuple

import numpy as np

from footfall.common.arrays import as_slice
from footfall.common.rotations import skew
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.rigid_body import RigidBody
from footfall.robots.targets import within

_INERTIA_SHARE = 0.5  # of the peak torque that may be spent on a leg's own inertia


class _Stance(NamedTuple):
    """What depends on which legs stand, and on nothing else. Whole arrays: to broadcast takes longer."""

    swinging: np.ndarray | slice  # (k,) the others
    contact: np.ndarray  # (legs, 3, m) 1 of those that stand, else 0
    kp: np.ndarray  # (legs, m) N m/rad
    kd: np.ndarray  # (legs, m) N m s/rad


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
        # Lowest and highest, each as wide as what they limit: to negate, and to broadcast, takes longer.
        self._speeds = _about_zero(legs.gather(robot.motor.no_load_speed))
        self._inertia_torques = _about_zero(_INERTIA_SHARE * legs.gather(robot.motor.peak_torque))
        self._one = np.ones((legs.count, legs.hinges))
        self._ones = _about_zero(self._one)
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
        turn: np.ndarray,
        up: np.ndarray,
        swinging: list[int],
        swing: np.ndarray,
    ) -> JointCommand:
        """The command of one joint tick. All vectors are in the base frame.

        Args:
            joint_position: (n,) rad, measured.
            pose: kinematics at this position.
            force: (legs, 3) N, of the ground on the feet; zero of those that swing.
            velocity: (3,) m/s, commanded, of the base.
            turn: (3,) rad/s, commanded.
            up: (3,) vertical.
            swinging: the k legs that do not stand.
            swing: (k, 3, 3) position, velocity and acceleration of their feet, relative to the base.
        """
        legs, stance = self._legs, self._stance(swinging)
        # A standing foot rolls: it is the point on the ground that stands still and carries the force.
        jacobian = pose.jacobian + stance.contact * legs.rolling_offset(pose.axes, up)
        wanted = np.zeros((legs.count, 3, 2))  # velocity and acceleration of the feet
        wanted[:, :, 0] = pose.foot.dot(skew(turn)) - velocity
        wanted[stance.swinging] = swing[:, 1:].transpose(0, 2, 1)
        rates = legs.joint_rates(jacobian, wanted)
        joint_velocity = within(rates[:, :, 0], *self._speeds)
        inertia_torque = (self._body.leg_inertia @ rates[:, :, 1:])[:, :, 0]

        position = legs.gather(joint_position)
        if swinging:
            position[stance.swinging] = legs.solve(swing[:, 0], swinging)
        torque = within(inertia_torque, *self._inertia_torques)
        torque += legs.torque(jacobian, force)
        torque += self._friction * within(joint_velocity / self._friction_speed, *self._ones)
        values = np.array((position, joint_velocity, stance.kp, stance.kd, torque))
        return JointCommand.of(legs.scatter(values, self._outside_legs))

    def _stance(self, swinging: list[int]) -> _Stance:
        key = tuple(swinging)
        if key not in self._stances:
            contact = np.ones((self._legs.count, 3, self._legs.hinges))
            kp, kd = 0.0 * self._one, self._stand.kd * self._one
            contact[swinging], kp[swinging], kd[swinging] = 0.0, self._swing.kp, self._swing.kd
            rows = as_slice(np.array(swinging)) if swinging else slice(0)
            self._stances[key] = _Stance(rows, contact, kp, kd)
        return self._stances[key]


def _about_zero(most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return -most, most
