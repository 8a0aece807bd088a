"""The actor and the critic: brax's PPO networks."""

import jax
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks, make_ppo_networks
from flax import linen

from train.config import PpoConfig


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
