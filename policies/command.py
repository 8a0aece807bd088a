"""What is done with a velocity command before a policy sees it, in training as in deployment."""

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = Any


def approached(goal: Array, value: Array, most_per_s: Array, dt_s: float) -> Array:
    """A value on its way to a goal, after a time in which it changes at a bounded rate; elementwise.

    Written for NumPy (deployment) and JAX (training) arrays.
    """
    xp = value.__array_namespace__()
    step = most_per_s * dt_s
    return value + xp.minimum(xp.maximum(goal - value, -step), step)


@dataclass(frozen=True)
class CommandShaping:
    """How fast a commanded velocity is approached, and what counts as a command to stand."""

    acceleration_m_s2: float
    yaw_acceleration_rad_s2: float
    standing_command: float  # commands of a smaller norm mean: stand still


class ShapedCommand:
    """A velocity command (forward m/s, leftward m/s, yaw rad/s) that changes at a bounded rate."""

    def __init__(self, shaping: CommandShaping) -> None:
        self._shaping = shaping
        accelerations = (
            shaping.acceleration_m_s2,
            shaping.acceleration_m_s2,
            shaping.yaw_acceleration_rad_s2,
        )
        self._most = np.array(accelerations)
        self.value = np.zeros(3)

    def reset(self) -> None:
        """Stand."""
        self.value = np.zeros(3)

    def advance(self, command: np.ndarray, dt_s: float) -> None:
        """Move towards a command (3,) for a time."""
        goal = command if self._asks_to_move(command) else np.zeros(3)
        self.value = approached(goal, self.value, self._most, dt_s)

    def wants_walk(self, command: np.ndarray) -> bool:
        """Whether a command (3,) asks to move, or an earlier one still has to be slowed down from."""
        return self._asks_to_move(command) or bool(np.any(self.value != 0.0))

    def _asks_to_move(self, command: np.ndarray) -> bool:
        return float(command @ command) > self._shaping.standing_command**2
