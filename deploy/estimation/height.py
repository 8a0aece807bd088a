"""Height of the IMU above the feet in stance."""

import math

import numpy as np

from footfall.deploy.estimation.filter import MotionFilter

_MIN_CONTACT = 0.5  # sum of contacts below which no height is measured


class StanceHeight:
    """Height of the IMU above the mean stance foot: integrated velocity, corrected by stance legs.

    In flight it is not corrected: its uncertainty grows with that of the velocity.

    Args:
        radius: (legs,) m, radius of the feet.
        filter_s: time constant of the correction.

    Attributes:
        value: m.
        deviation: m, standard deviation in addition to that above stance feet.
    """

    def __init__(self, radius: np.ndarray, filter_s: float) -> None:
        self._radius, self._filter_s = radius, filter_s
        self.value = self.deviation = 0.0

    def reset(self, position: np.ndarray, up: np.ndarray) -> None:
        """Start with all feet in stance.

        Args:
            position: (legs, 3) m, contact points from the IMU, base frame.
            up: (3,) the vertical, base frame.
        """
        self.value = -float((position @ up + self._radius).mean())
        self.deviation = 0.0

    def update(
        self, position: np.ndarray, up: np.ndarray, contact: list[float], motion: MotionFilter, dt_s: float
    ) -> None:
        """Advance by `dt_s`; position and up as for `reset`, contact of each leg in [0, 1]."""
        self.value += motion.velocity[2] * dt_s
        total = sum(contact)
        if total > _MIN_CONTACT:
            measured = -float((position.dot(up) + self._radius).dot(contact)) / total
            share = 1.0 - math.exp(-dt_s / self._filter_s)
            self.value += share * (measured - self.value)
            self.deviation -= share * self.deviation
        else:
            self.deviation += math.sqrt(motion.vv) * dt_s
