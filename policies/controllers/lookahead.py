"""State of the robot at the time at which the next command acts."""

from collections import deque

import numpy as np

from footfall.common.rotations import multiply, rotation_matrix
from footfall.policies.controllers.delay import CommandDelay
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand, Motor

_TUNED_TICKS = 1  # delay of the loop alone, with which the controllers' gains were tuned


class Lookahead:
    """Predicts over the measured delay, with the accelerations of the commands that do not act yet.

    Args:
        motor: the motors' limits.
        dt_s: time between two commands.
    """

    def __init__(self, motor: Motor, dt_s: float) -> None:
        self._dt_s = dt_s
        self._delay = CommandDelay(motor, dt_s)
        self._accelerations: deque[np.ndarray] = deque(maxlen=64)
        self._stance: deque[np.ndarray] = deque(maxlen=64)

    @property
    def delay_s(self) -> float:
        """Measured delay until commands act."""
        return self._delay.ticks * self._dt_s

    def reset(self) -> None:
        """Start at rest."""
        self._delay.reset()
        self._accelerations.clear()
        self._stance.clear()

    def record(self, command: JointCommand, acceleration: np.ndarray, stance: np.ndarray) -> None:
        """Record this tick's decision.

        Args:
            command: joint command.
            acceleration: (6,) m/s^2 and rad/s^2, expected acceleration of the base in world axes.
            stance: (feet,) planned contact in [0, 1].
        """
        self._delay.record(command)
        self._accelerations.appendleft(acceleration)
        self._stance.appendleft(stance)

    def stance(self) -> np.ndarray | None:
        """Planned contact (feet,) of the commands that act now; None before the first command."""
        if not self._stance:
            return None
        return self._stance[min(self._delay.ticks, len(self._stance)) - 1]

    def predict(self, inputs: PolicyInput) -> PolicyInput:
        """Inputs as expected when the next command acts."""
        ticks = self._delay.measure(inputs.sensed)
        if ticks <= _TUNED_TICKS:
            return inputs
        sensed, dt_s = inputs.sensed, self._dt_s
        rotation = rotation_matrix(sensed.quaternion)
        velocity = np.concatenate([rotation @ inputs.base_velocity, rotation @ sensed.gyro])
        displacement = np.zeros(6)
        pending = list(self._accelerations)[:ticks][::-1]
        for acceleration in [np.zeros(6)] * (ticks - len(pending)) + pending:
            displacement += dt_s * (velocity + 0.5 * dt_s * acceleration)
            velocity = velocity + dt_s * acceleration
        turn = np.array([1.0, *(0.5 * displacement[3:])])
        quaternion = multiply(turn / np.sqrt(turn @ turn), sensed.quaternion)
        to_body = rotation_matrix(quaternion).T
        velocity_changes = self._delay.velocity_changes()
        predicted = sensed._replace(
            quaternion=quaternion,
            gyro=to_body @ velocity[3:],
            joint_position=sensed.joint_position
            + dt_s * (ticks * sensed.joint_velocity + velocity_changes.sum(axis=0)),
            joint_velocity=sensed.joint_velocity + velocity_changes[0],
        )
        return inputs._replace(
            sensed=predicted,
            base_velocity=to_body @ velocity[:3],
            base_height=inputs.base_height + displacement[2],
        )
