"""Live settings of model-predictive control, approached at a bounded rate."""

from collections.abc import Mapping

import numpy as np

from footfall.common.errors import naming
from footfall.policies.controllers.gait import GaitConfig, GaitTiming, StepClock
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.reference import Reference
from footfall.policies.controllers.mpc.swing_feet import SwingFeet
from footfall.policies.gaits import find_gait
from footfall.policies.live_settings import Applied, Span, moved_towards, spans_around
from footfall.robots.description import Robot

_MAX_RATES = {  # largest change of each setting per second, in its unit
    "step_period_s": 0.1,
    "step_height_m": 0.05,
    "body_height_m": 0.05,
    "roll_rad": 0.3,
    "pitch_rad": 0.3,
}


class LiveMpc:
    """Values that approach the requested ones, and the next gait."""

    def __init__(self, robot: Robot, config: MpcConfig) -> None:
        self._robot, self._config = robot, config
        for name in config.gaits:
            with naming("gaits"):
                find_gait(name, robot)
        limit = config.max_attitude_rad
        defaults = {
            "step_period_s": config.gait.period_s,
            "step_height_m": config.swing.height_m,
            "body_height_m": config.stance.height_m,
        }
        attitude = dict.fromkeys(("roll_rad", "pitch_rad"), Span(-limit, limit, 0.0))
        self.spans = spans_around(defaults) | attitude
        self.reset()

    def reset(self) -> None:
        """Return to the controller's own settings and gait."""
        self._values = {name: span.default for name, span in self.spans.items()}
        self._requested = dict(self._values)
        self._changing = False
        self.next_gait = ""  # gait to change to once all feet stand; empty for none
        self._gait_name = self._config.gait.name

    @property
    def applied(self) -> Applied:
        """Gait and values that act now."""
        return Applied(self._gait_name, self._values)

    def request(self, values: Mapping[str, float]) -> None:
        """Set the values to approach."""
        self._requested |= values
        self._changing = True

    def advance(self, clock: StepClock, reference: Reference, feet: SwingFeet, dt_s: float) -> None:
        """Move the values towards the requested ones, and apply them."""
        if not self._changing:
            return
        values = {
            name: moved_towards(value, self._requested[name], _MAX_RATES[name] * dt_s)
            for name, value in self._values.items()
        }
        self._changing, self._values = values != self._requested, values
        clock.timing = GaitTiming(values["step_period_s"], clock.timing.duty)
        reference.requested_height, feet.height_m = values["body_height_m"], values["step_height_m"]
        reference.attitude = np.array([values["roll_rad"], values["pitch_rad"]])

    def change_gait(self, clock: StepClock) -> None:
        """Change to the next gait, while all feet stand."""
        new = GaitConfig(self.next_gait, clock.timing.period_s).clock(self._robot)
        clock.change_gait(new.timing, new.offsets)
        self._gait_name, self.next_gait = self.next_gait, ""
