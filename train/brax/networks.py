"""The actor and the critic: brax's PPO networks."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks, make_ppo_networks
from flax import linen

from footfall.train.actor import Actor
from footfall.train.brax.devices import on_the_processor
from footfall.train.config import PpoConfig


def make_networks(observation_sizes: dict[str, int], action_size: int, config: PpoConfig) -> PPONetworks:
    """A Gaussian actor on "state" and a critic on "privileged_state", both normalised, with ELU."""
    return make_ppo_networks(
        observation_size={name: (size,) for name, size in observation_sizes.items()},
        action_size=action_size,
        preprocess_observations_fn=running_statistics.normalize,
        policy_hidden_layer_sizes=config.actor_layers,
        value_hidden_layer_sizes=config.critic_layers,
        activation=linen.elu,
        policy_obs_key="state",
        value_obs_key="privileged_state",
        distribution_type="normal",
        noise_std_type="log",
        init_noise_std=config.initial_std,
        # The first actions hardly differ from the default pose.
        mean_kernel_init_fn=jax.nn.initializers.orthogonal,
        mean_kernel_init_kwargs={"scale": 0.01},
    )


def trained_actor(networks: PPONetworks, normalizer: Any, policy: Any) -> Actor:
    """The actor of these parameters, on the host."""

    def act(observed: np.ndarray) -> np.ndarray:
        with on_the_processor(), jax.default_matmul_precision("highest"):
            mean, _ = networks.policy_network.apply(normalizer, policy, {"state": jnp.asarray(observed)})
        return np.asarray(mean)

    mean, std = (np.asarray(x["state"], np.float32) for x in (normalizer.mean, normalizer.std))
    return Actor("brax", mean, std, _dense_layers(policy), act)


def _dense_layers(policy: Any) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Kernels and biases of the actor's hidden and mean layers, in order."""
    tree = policy["params"]
    dense: dict[str, dict[str, np.ndarray]] = {}
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        names = [str(getattr(part, "key", part)) for part in path]
        if names[-1] in {"kernel", "bias"}:
            dense.setdefault("/".join(names[:-1]), {})[names[-1]] = np.asarray(leaf, np.float32)
    layers = [(name, part["kernel"], part["bias"]) for name, part in dense.items()]
    hidden = sorted((x for x in layers if "hidden" in x[0]), key=lambda x: int(x[0].rsplit("_", 1)[1]))
    final = [x for x in layers if "hidden" not in x[0]]
    return tuple((kernel, bias) for _, kernel, bias in [*hidden, *final])
