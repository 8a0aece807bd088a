"""The programs of a training, traced and lowered for its devices; XLA compiles them side by side."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh

from footfall.train.brax.devices import SHARDED, compiler_options, shardings
from footfall.train.brax.iteration import EPISODE_SPECS, EXPERIENCE_SPECS, LEARNED_SPECS, Iteration
from footfall.train.brax.state import LEARNER_SPECS, STATE_SPECS, TrainState


class Programs:
    """Each method traces when it is called. Acting and learning reuse the memory of their first argument."""

    def __init__(
        self, iteration: Iteration, first_state: Callable[[np.uint32], TrainState], mesh: Mesh
    ) -> None:
        self._iteration, self._first_state, self._mesh = iteration, first_state, mesh

    def act(self) -> jax.stages.Lowered:
        """A rollout."""
        return self._acting.lower()

    def learn(self) -> jax.stages.Lowered:
        """An update; its argument's shapes are the results of a rollout."""
        learn = self._jitted(
            self._iteration.learn, (LEARNER_SPECS, SHARDED, EXPERIENCE_SPECS), LEARNED_SPECS, donate_argnums=0
        )
        return learn.lower(self._shapes.learner, self._shapes.observation, self._acting.out_info[1])

    def first_state(self) -> jax.stages.Lowered:
        """The state before the first iteration; the seed is an argument."""
        return self._jitted(self._first_state, None, STATE_SPECS).lower(np.uint32(0))

    @cached_property
    def _shapes(self) -> TrainState:
        return jax.eval_shape(self._first_state, np.uint32(0))

    @cached_property
    def _acting(self) -> jax.stages.Traced:
        act = self._jitted(
            self._iteration.act,
            (EPISODE_SPECS, LEARNER_SPECS),
            (EPISODE_SPECS, EXPERIENCE_SPECS),
            donate_argnums=0,
        )
        return act.trace(self._shapes.episodes, self._shapes.learner)

    def _jitted(self, function: Callable[..., Any], arguments: Any, results: Any, **options: Any) -> Any:
        if arguments is not None:
            options["in_shardings"] = shardings(arguments, self._mesh)
        options |= {"out_shardings": shardings(results, self._mesh)}
        return jax.jit(function, compiler_options=compiler_options(self._mesh), **options)
