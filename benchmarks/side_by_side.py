"""Two ELU networks side by side in one network, with additional units."""

import jax
import jax.numpy as jnp
import numpy as np

from footfall.train.origin import Exported

Layers = tuple[tuple[jax.Array, jax.Array], ...]  # kernel (inputs, outputs) and bias


def side_by_side(first: Exported, second: Exported, seen: np.ndarray, share: float, key: jax.Array) -> Layers:
    """Layers of a network that begins with the units of both, for the first one's normalised observation.

    Args:
        first: its actions are the new network's.
        second: has as many layers. Its last hidden units are not connected to the actions.
        seen: indices of the second network's observation in the first one's.
        share: number of additional units of a hidden layer, relative to the first network's. Their input
            weights are random.
        key: for these random weights.
    """
    gain = first.std[seen] / second.std
    offset = (first.mean[seen] - second.mean) / second.std
    kernel, bias = second.layers[0]
    entry = np.zeros((first.mean.size, kernel.shape[1]), np.float32)
    entry[seen] = gain[:, None] * kernel
    others = [(entry, bias + offset @ kernel), *second.layers[1:-1]]
    layers: list[tuple[jax.Array, jax.Array]] = []
    extra_inputs = first.mean.size
    for k, ((one, one_bias), (two, two_bias)) in enumerate(zip(first.layers[:-1], others, strict=True)):
        extra = round(share * one.shape[1])
        new = jax.random.normal(jax.random.fold_in(key, k), (extra_inputs, extra)) / np.sqrt(extra_inputs)
        join = jnp.hstack if k == 0 else lambda parts: jax.scipy.linalg.block_diag(*parts)
        layers.append((join([one, two, new]), jnp.concatenate([one_bias, two_bias, jnp.zeros(extra)])))
        extra_inputs = extra
    last, last_bias = first.layers[-1]
    unused = layers[-1][1].size - last.shape[0]
    return *layers, (jnp.concatenate([last, jnp.zeros((unused, last.shape[1]))]), jnp.asarray(last_bias))
