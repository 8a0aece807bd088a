"""Mirror augmentation: half of what is learned from, seen in a mirror."""

import jax
import jax.numpy as jnp
from brax.training.agents.ppo.networks import PPONetworks
from brax.training.types import Transition

from footfall.envs.symmetry import EnvironmentMirror


def mirror_half(
    data: Transition, mirror: EnvironmentMirror, networks: PPONetworks, behaviour: tuple, key: jax.Array
) -> Transition:
    """Each environment's transitions with probability 1/2 replaced by their mirror image.

    Args:
        data: transitions of shape (environment, time, ...).
        mirror: of observations and actions.
        networks: the actor's and the critic's.
        behaviour: normaliser and actor parameters that acted.
        key: decides which.
    """
    flip = jax.random.bernoulli(key, 0.5, data.reward.shape[:1])

    def choose(image: jax.Array, original: jax.Array) -> jax.Array:
        return jnp.where(flip.reshape((-1,) + (1,) * (original.ndim - 1)), image, original)

    return jax.tree.map(choose, mirrored(data, mirror, networks, behaviour), data)


def mirrored(
    data: Transition, mirror: EnvironmentMirror, networks: PPONetworks, behaviour: tuple
) -> Transition:
    """The mirror image of transitions, shape by shape the same.

    An image was sampled by the mirrored behaviour, whose log-probability for it is the original's. What the
    learning rate adapts to is how far the actor has moved from the behaviour in the mirrored state, so that
    the distribution is computed anew: with the original's, a policy that is not symmetric yet would look far
    from its own behaviour, and the learning rate would collapse.
    """
    observation = {name: mirror.observation[name](value) for name, value in data.observation.items()}
    following = {name: mirror.observation[name](value) for name, value in data.next_observation.items()}
    extras = data.extras["policy_extras"] | {
        "raw_action": mirror.action(data.extras["policy_extras"]["raw_action"]),
        "distribution_params": networks.policy_network.apply(*behaviour, observation),
    }
    return data._replace(
        observation=observation,
        action=mirror.action(data.action),
        next_observation=following,
        extras=data.extras | {"policy_extras": extras},
    )
