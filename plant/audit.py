"""Compares the commands of a controller with the limits of the robot."""

import numpy as np

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.actuator import JointCommand, limit_torque, pd_torque
from footfall.robots.description import Robot

ROUNDING_RAD = 0.0004  # rounding of two position targets in frames


class Audit:
    """Measures the excess of commands over limits, over all frames that a controller sends."""

    def __init__(self, robot: Robot, wiring: Wiring, tick_s: float) -> None:
        self._robot, self._tick_s = robot, tick_s
        self._motor_end = open_motor_end(wiring)
        self._lower, self._upper = robot.soft_limits
        self._target: np.ndarray | None = None  # of the previous tick
        self.stiff = False  # whether a motor was ever given stiffness
        # Largest torque demand beyond the motor's limit at its speed, over its peak torque.
        self.torque_over = 0.0
        self.outside_rad = 0.0  # farthest position target outside the soft limits
        self.rate_share = 0.0  # fastest change of a position target over the robot's target rate

    def update(self, frames: Frames, position: np.ndarray, velocity: np.ndarray) -> None:
        """Process one batch of frames and the readings (n,) that the controller had, rad and rad/s."""
        requests = self._motor_end.requests(frames)
        if requests.kind is not None or requests.values.shape[1] != len(position):
            return
        values = np.empty_like(requests.values)
        # With motors of several makers, requests are grouped by maker.
        values[:, requests.motor] = requests.values
        command = JointCommand(*values)
        demand = pd_torque(command, position, velocity)
        limited = limit_torque(demand, velocity, self._robot.motor)
        excess = (np.abs(demand) - np.abs(limited)) / self._robot.motor.peak_torque
        self.torque_over = max(self.torque_over, float(excess.max()))
        stiff = command.kp > 0.0
        self._update_target(command.position, stiff)

    def _update_target(self, target: np.ndarray, stiff: np.ndarray) -> None:
        if not stiff.any():
            self._target = None
            return
        self.stiff = True
        outside = np.maximum(self._lower - target, target - self._upper)[stiff]
        self.outside_rad = max(self.outside_rad, float(outside.max()))
        if self._target is not None:
            moved = np.abs(target - self._target)[stiff].max() - ROUNDING_RAD
            rate = max(moved, 0.0) / self._tick_s
            limit = self._robot.description.target_rate_rad_s
            self.rate_share = max(self.rate_share, float(rate) / limit)
        self._target = target
