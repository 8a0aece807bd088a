"""Roll and pitch of the base by the length of the legs."""

import numpy as np

from footfall.common.arrays import clamped
from footfall.policies.controllers.stance import level_feet, tilt_correction
from footfall.policies.controllers.walk.config import LevellingConfig
from footfall.policies.policy import PolicyInput


class Levelling:
    """Moves the feet up and down to correct the base's tilt and to reach the desired attitude."""

    def __init__(self, config: LevellingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start level, with zero tilt."""
        self._tilt = np.zeros(2)
        self.attitude = np.zeros(2)  # roll and pitch that the legs aim at now, rad
        self.desired = np.zeros(2)  # roll and pitch, rad; approached slowly

    def apply(self, feet: np.ndarray, inputs: PolicyInput, dt_s: float) -> np.ndarray:
        """Feet (legs, 3) m, base frame, that turn the base to the desired attitude."""
        config = self._config
        if self.attitude.tolist() != self.desired.tolist():
            limit = config.attitude_rate_rad_s * dt_s
            self.attitude = self.attitude + clamped(self.desired - self.attitude, -limit, limit)
        tilt = tilt_correction(inputs, config.gain, config.rate_gain_s, config.max_rad, self.attitude)
        self._tilt += min(1.0, dt_s / config.filter_s) * (tilt - self._tilt)
        return level_feet(feet, self._tilt - self.attitude)
