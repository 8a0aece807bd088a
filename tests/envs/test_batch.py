"""Episodes side by side: where one ends, the next begins."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.envs.batch import step_batch
from footfall.envs.state import Step


@pytest.mark.parametrize("on_host", [False, True])
def test_episodes_side_by_side_are_independent(on_host: bool) -> None:
    """Three episodes differ: the second ends by a fall, the third by the time limit."""

    def step(state: Any, action: jax.Array) -> tuple[Any, Step]:
        state = state._replace(steps=state.steps + 1, key=state.key + 100)
        observation = {"state": state.key * jnp.ones(2)}
        fell, late = (state.key == 102.0) * 1.0, (state.steps == 9) * 1.0
        return state, Step(observation, 10 * action, fell, late, {"a": action})

    def reset(key: jax.Array, level: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        return NewState(key + 1000, level, jnp.int32(0)), {"state": key * jnp.array([-1.0, -2.0])}

    NewState = NamedTuple("NewState", [("key", Any), ("level", Any), ("steps", Any)])  # noqa: UP014
    env: Any = SimpleNamespace(on_host=on_host, step=step, reset=reset)
    begun = NewState(jnp.array([1.0, 2.0, 3.0]), jnp.array([0.1, 0.2, 0.3]), jnp.array([3, 4, 8]))
    state, observation, last = step_batch(env, begun, jnp.array([0.5, 0.6, 0.7]))
    np.testing.assert_allclose(state.key, [101, 1102, 1103])
    np.testing.assert_allclose(state.level, [0.1, 0.2, 0.3])
    assert state.steps.tolist() == [4, 0, 0]
    np.testing.assert_allclose(observation["state"], [[101, 101], [-102, -204], [-103, -206]])
    np.testing.assert_allclose(last.observation["state"][:, 0], [101, 102, 103])
    np.testing.assert_allclose(last.reward, [5, 6, 7])
    assert (last.terminated.tolist(), last.truncated.tolist()) == ([0, 1, 0], [0, 0, 1])
    assert last.metrics["done"].tolist() == [0, 1, 1]
    assert last.metrics["length"].tolist() == [0, 5, 9]
    np.testing.assert_allclose(last.metrics["a"], [0.5, 0.6, 0.7])
