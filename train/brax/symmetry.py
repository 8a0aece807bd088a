"""Mirror augmentation: half of the samples are replaced by their mirror images."""

from typing import Any

import jax
import jax.numpy as jnp
from brax.training.agents.ppo.networks import PPONetworks
from brax.training.types import Transition

from footfall.envs.symmetry import EnvironmentMirror


def with_mirror_images(
    data: Transition, mirror: EnvironmentMirror, networks: PPONetworks, behaviour: tuple[Any, Any]
) -> Transition:
    """Transitions of shape (time, environment, ...), followed by their images along the environments."""
    images = mirrored(data, mirror, networks, behaviour)
    return jax.tree.map(lambda original, image: jnp.concatenate([original, image], axis=1), data, images)


def mirror_half(columns: jax.Array, key: jax.Array) -> jax.Array:
    """Each environment's column, with probability 1/2 replaced by its mirror image's column."""
    return columns + len(columns) * jax.random.bernoulli(key, 0.5, columns.shape)


def mirrored(
    data: Transition, mirror: EnvironmentMirror, networks: PPONetworks, behaviour: tuple
) -> Transition:
    """The mirror image of transitions, in the same shapes.

    The image's log-probability is the original's: the mirrored behaviour would have sampled it. The
    distribution is computed anew for the mirrored observation: the learning rate adapts to the actor's
    distance from it. With the original's distribution a policy that is not symmetric yet would look far
    from its own behaviour, and the learning rate would collapse.
    """
    observation = {name: mirror.observation[name](value) for name, value in data.observation.items()}
    next_observation = {
        name: mirror.observation[name](value) for name, value in data.next_observation.items()
    }
    extras = data.extras["policy_extras"] | {
        "raw_action": mirror.action(data.extras["policy_extras"]["raw_action"]),
        "distribution_params": networks.policy_network.apply(*behaviour, observation),
    }
    return data._replace(
        observation=observation,
        action=mirror.action(data.action),
        next_observation=next_observation,
        extras=data.extras | {"policy_extras": extras},
    )
