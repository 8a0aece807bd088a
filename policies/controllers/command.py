"""Shaping of the velocity command for hand-written controllers."""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_not_negative, require_positive


@dataclass(frozen=True)
class CommandShaping:
    """Acceleration limits of the shaped command, and the threshold below which the robot stands."""

    acceleration_m_s2: float
    yaw_acceleration_rad_s2: float
    standing_command: float  # a command with a smaller norm means standing still

    def __post_init__(self) -> None:
        require_positive(self, "acceleration_m_s2", "yaw_acceleration_rad_s2")
        require_not_negative(self, "standing_command")


class ShapedCommand:
    """Rate-limited velocity command (forward m/s, leftward m/s, yaw rad/s)."""

    def __init__(self, shaping: CommandShaping) -> None:
        self._shaping = shaping
        self._max_acceleration = (
            shaping.acceleration_m_s2,
            shaping.acceleration_m_s2,
            shaping.yaw_acceleration_rad_s2,
        )
        self.value = np.zeros(3)

    def reset(self) -> None:
        """Start from the zero command."""
        self.value = np.zeros(3)

    def advance(self, command: np.ndarray, dt_s: float) -> None:
        """Move the shaped command towards a command (3,) during `dt_s`."""
        goal = command.tolist() if self._asks_to_move(command) else [0.0, 0.0, 0.0]
        current = self.value.tolist()
        if current == goal:
            return
        self.value = np.array(
            [
                now + min(max(desired - now, -limit * dt_s), limit * dt_s)
                for now, desired, limit in zip(current, goal, self._max_acceleration, strict=True)
            ]
        )

    def requests_walk(self, command: np.ndarray) -> bool:
        """Whether a command (3,) asks the robot to move, or the shaped command is not yet zero."""
        return self._asks_to_move(command) or any(self.value.tolist())

    def _asks_to_move(self, command: np.ndarray) -> bool:
        forward, leftward, yaw_rate = command.tolist()
        return math.hypot(forward, leftward, yaw_rate) > self._shaping.standing_command
