"""Two networks side by side in one network."""

import itertools

import jax
import numpy as np
from side_by_side import side_by_side
from teacher_student import action_of, mean_action

from footfall.train.origin import Exported


def network(rng: np.random.Generator, sizes: tuple[int, ...]) -> Exported:
    layers = tuple(
        (rng.normal(size=pair).astype(np.float32), rng.normal(size=pair[1]).astype(np.float32))
        for pair in itertools.pairwise(sizes)
    )
    return Exported(rng.normal(size=sizes[0]), rng.uniform(0.5, 2.0, sizes[0]), layers)


def test_the_joined_network_has_the_first_networks_actions_and_contains_the_second() -> None:
    rng = np.random.default_rng(0)
    first, second = network(rng, (9, 8, 4, 3)), network(rng, (5, 6, 7, 3))
    seen, observed = np.array([8, 1, 3, 0, 6]), rng.normal(size=(20, 9)).astype(np.float32)
    layers = side_by_side(first, second, seen, 0.5, jax.random.PRNGKey(0))
    assert [bias.size for _, bias in layers] == [18, 13, 3]
    normal = (observed - first.mean) / first.std
    np.testing.assert_allclose(mean_action(layers, normal), action_of(first, observed), atol=1e-3)
    kernel, bias = (np.zeros_like(each) for each in layers[-1])
    kernel[4:11], bias = second.layers[-1]
    found = mean_action((*layers[:-1], (kernel, bias)), normal)
    np.testing.assert_allclose(found, action_of(second, observed[:, seen]), atol=1e-3)
