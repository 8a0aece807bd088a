"""Keeps a robot on two soles upright in a fixed pose: its ankles follow the pitch of its base."""

from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.common.rotations import rotation_matrix
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs
from footfall.robots.readings import Sensed

MIN_SOLE_M = 0.02  # shortest sole that can press with its toes or its heel


@dataclass(frozen=True)
class LevellingConfig:
    """Reaction of the ankles to a pitch of the base while the robot stands up."""

    gain: float = 1.0  # share of the pitch; 0 for none
    max_rad: float = 0.15  # largest correction
    fade_s: float = 0.1  # duration of the fade-in

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "max_rad")
        require_positive(self, "fade_s")


class Levelling:
    """Turns the soles of a robot with two feet against the pitch of its base.

    Held joints are springs that are hardly stiff enough for a biped: with its centre of mass 2 to 3 cm ahead
    of the model's, the robot falls within a second. Sideways, two legs are a stiff frame. A robot with
    more feet, or with point feet, needs no correction.

    The joints' own damping is enough. A correction for the pitch rate, which comes late, shakes a robot with
    stiff joints, and a shaking robot walks off.
    """

    def __init__(self, robot: Robot, config: LevellingConfig) -> None:
        self._config = config
        self._turn = sole_turn(robot) if on_two_soles(robot.legs) else None  # (n,) rad/rad

    def applied(self, command: JointCommand, time_s: float, sensed: Sensed) -> JointCommand:
        """Joint command with the correction.

        Args:
            command: command for the pose.
            time_s: time since the legs carry the robot.
            sensed: latest readings.
        """
        if self._turn is None:
            return command
        config = self._config
        pitch = -float(rotation_matrix(sensed.quaternion)[2, 0])
        share = min(max(time_s / config.fade_s, 0.0), 1.0)
        correction = share * min(max(config.gain * pitch, -config.max_rad), config.max_rad)
        return command._replace(position=command.position + correction * self._turn)


def on_two_soles(legs: Legs) -> bool:
    """Whether the robot stands on two feet that can press with their toes or their heels."""
    soles = all(np.ptp(spheres.centre, axis=0).max() >= MIN_SOLE_M for spheres in legs.spheres)
    return legs.count == 2 and soles


def sole_turn(robot: Robot) -> np.ndarray:
    """Joint motion per pitch of the ground below all feet in the default pose, (n,) rad/rad.

    Least squares on the Jacobians of each foot's position and direction.
    """
    pose = robot.legs.pose(robot.default_pose)
    turn = []
    for foot, jacobian, axes in zip(pose.foot, pose.jacobian, pose.axes, strict=True):
        ground = np.array([0.0, 0.0, -foot[0], 0.0, 1.0, 0.0])
        turn.append(np.linalg.lstsq(np.vstack([jacobian, axes]), ground, rcond=1e-3)[0])
    return robot.legs.scatter(np.array(turn), np.zeros_like(robot.default_pose))
