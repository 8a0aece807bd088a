"""State of the base for model-predictive control, with a position by dead reckoning."""

import math
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import cross, roll_pitch_yaw, rotation_matrix
from footfall.policies.controllers.mpc.config import Restart
from footfall.policies.controllers.mpc.problem import BodyState
from footfall.policies.policy import PolicyInput


class Base(NamedTuple):
    """State of the base. World frame: origin where the base was at reset, z = 0 on the ground."""

    xy: complex  # m, position of the base's origin: x + i y
    height: float  # m
    velocity: np.ndarray  # (3,) m/s, world
    rotation: np.ndarray  # (3, 3) body to world
    gyro: np.ndarray  # (3,) rad/s, body
    roll: float
    pitch: float
    yaw: float

    @property
    def speed(self) -> complex:
        """Horizontal velocity, m/s."""
        x, y, _ = self.velocity.tolist()
        return complex(x, y)

    @property
    def position(self) -> np.ndarray:
        """Position of the base's origin, (3,) m, world."""
        return np.array([self.xy.real, self.xy.imag, self.height])


class BaseFollower:
    """Integrates odometry. Dead reckoning is accurate enough for the duration of one step.

    Args:
        foot_radius: m, mean over the feet.
    """

    def __init__(self, foot_radius: float) -> None:
        self._radius = foot_radius
        self.xy = 0j  # m, x + i y

    def reset(self) -> None:
        """Move the origin of the world below the base."""
        self.xy = 0j

    def height(self, inputs: PolicyInput) -> float:
        """Height of the base's origin above the ground, m."""
        return inputs.base_height + self._radius

    def follow(self, inputs: PolicyInput, dt_s: float) -> Base:
        """State of the base after a time step."""
        rotation = rotation_matrix(inputs.sensed.quaternion)
        velocity = rotation.dot(inputs.base_velocity)
        x, y, _ = velocity.tolist()
        self.xy += complex(x, y) * dt_s
        roll, pitch, yaw = roll_pitch_yaw(rotation)
        height = self.height(inputs)
        return Base(self.xy, height, velocity, rotation, inputs.sensed.gyro, roll, pitch, yaw)


class Disturbance:
    """Detects that the base has to step although the command is zero, e.g. after a push."""

    def __init__(self, config: Restart) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Clear earlier disturbances."""
        self._remaining_s = 0.0

    def active(self, base: Base, walking: bool, offset_m: float, dt_s: float) -> bool:
        """Whether the base is, or was within `calm_s`, too fast, too tilted or too far from its feet.

        Args:
            base: state of the base.
            walking: whether the robot steps; the capture point is then not checked.
            offset_m: distance of the capture point from the middle of the feet, m.
            dt_s: time since the last call.
        """
        config = self._config
        limit = config.stop_speed_m_s if walking else config.start_speed_m_s
        tilted = max(abs(base.roll), abs(base.pitch)) > config.start_tilt_rad
        if abs(base.speed) > limit or tilted or (not walking and offset_m > config.max_offset_m):
            self._remaining_s = config.calm_s
        else:
            self._remaining_s = max(0.0, self._remaining_s - dt_s)
        return self._remaining_s > 0.0


def capture_offset_m(base: Base, centre_of_mass: np.ndarray, feet: np.ndarray) -> float:
    """Horizontal distance from the middle of all feet to the capture point, m.

    Args:
        base: state of the base.
        centre_of_mass: (3,) m, in the base's frame.
        feet: (feet, 3) m, in the base's frame.
    """
    forward, leftward, up = (base.rotation @ (centre_of_mass - feet.mean(axis=0))).tolist()
    x, y, _ = base.velocity.tolist()
    fall_s = math.sqrt(max(up, 0.0) / GRAVITY_M_S2)
    return math.hypot(forward + x * fall_s, leftward + y * fall_s)


def body_state(
    base: Base, centre_of_mass: np.ndarray, to_heading: np.ndarray, leg_rotation: np.ndarray
) -> BodyState:
    """State of the centre of mass in the heading frame, whose origin is on the ground below the base.

    Args:
        base: state of the base.
        centre_of_mass: (3,) m, in the base's frame.
        to_heading: (3, 3), by which a row vector in the world is multiplied for the heading frame.
        leg_rotation: (3,) rad/s, base frame, angular velocity of the whole robot minus that of the base.
    """
    centre = base.rotation @ centre_of_mass
    rate = base.rotation @ base.gyro
    velocity = base.velocity + cross(rate, centre)
    vectors = np.array([centre, rate + base.rotation @ leg_rotation, velocity]).dot(to_heading)
    x, y, z = vectors[0].tolist()
    return BodyState(np.array([base.roll, base.pitch, 0.0, x, y, z + base.height]), vectors[1:].ravel())
