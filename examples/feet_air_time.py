"""Example of a stateful reward: long steps are rewarded when a foot lands.

    footfall train --robot go1 --preset feet_air_time.yaml --out runs/air

The preset names the term `feet_air_time:FeetAirTime` and sets its weight and its parameter. The term is the
feet_air_time of legged_gym (Rudin et al. 2022).
"""

from dataclasses import dataclass
from typing import Annotated

import jax
import jax.numpy as jnp

from footfall.common.terms import Between
from footfall.envs.terms.data import StepData


@dataclass(frozen=True)
class FeetAirTime:
    """Sum over landing feet of their air time minus a threshold, s."""

    threshold_s: Annotated[float, Between(0.0, 2.0)] = 0.2

    def init(self, data: StepData) -> jax.Array:
        """State of the term at the start of an episode: air time of each foot, s, (feet,)."""
        return jnp.zeros_like(data.contact)

    def step(self, air_time_s: jax.Array, data: StepData) -> tuple[jax.Array, jax.Array]:
        """State after a control step, and the reward."""
        air_time_s = air_time_s + data.period_s
        landed = (air_time_s > data.period_s) * data.contact
        reward = jnp.sum(landed * (air_time_s - self.threshold_s)) * data.moving
        return air_time_s * (1.0 - data.contact), reward
