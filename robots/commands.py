"""Velocity commands: the range that a robot can follow or that a policy was trained on."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CommandRange:
    """Lowest and highest command of each axis: forward and leftward m/s, yaw rad/s."""

    forward_m_s: tuple[float, float]
    leftward_m_s: tuple[float, float]
    yaw_rad_s: tuple[float, float]
