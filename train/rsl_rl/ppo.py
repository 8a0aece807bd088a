"""rsl_rl's PPO, its learning rate kept below a limit."""

import math
from typing import Any

from rsl_rl.algorithms import PPO


class LimitedPpo(PPO):
    """rsl_rl's PPO, unchanged except for the learning rate, which a hook of the optimiser sets.

    `limit` is the preset's falling limit. A fixed rate equals the limit; an adaptive one stays below it.
    """

    learning_rate: float

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.limit = math.inf
        self.losses: dict[str, float] = {}  # means over the last update
        self.optimizer.register_step_pre_hook(self._limit_learning_rate)

    def update(self) -> dict[str, float]:
        self.losses = super().update()
        return self.losses

    def _limit_learning_rate(self, *_: Any) -> None:
        adaptive = self.schedule == "adaptive"
        self.learning_rate = min(self.learning_rate, self.limit) if adaptive else self.limit
        for group in self.optimizer.param_groups:
            group["lr"] = self.learning_rate
