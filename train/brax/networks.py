"""The actor and the critic: brax's PPO networks."""

from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks, make_ppo_networks
from brax.training.networks import FeedForwardNetwork, normalizer_select

from footfall.train.actor import Actor
from footfall.train.brax.devices import on_cpu
from footfall.train.brax.numpy_zeros import numpy_zeros
from footfall.train.config import PpoConfig

ACTOR, CRITIC = "state", "privileged_state"  # the observation that each network reads
ALIGNMENT = 8  # a GPU's 16-bit matrix products need rows of whole 16-byte blocks


def make_networks(observation_sizes: dict[str, int], action_size: int, config: PpoConfig) -> PPONetworks:
    """A Gaussian actor on "state" and a critic on "privileged_state", both normalised, with ELU.

    With `config.bfloat16` the hidden layers compute in 16 bits; parameters and outputs stay float32. With
    `normalizer` None, the networks take observations that are `normalised` already.
    """
    with numpy_zeros():
        networks = make_ppo_networks(
            observation_size={name: (size,) for name, size in observation_sizes.items()},
            action_size=action_size,
            policy_hidden_layer_sizes=config.actor_hidden_dims,
            value_hidden_layer_sizes=config.critic_hidden_dims,
            activation=elu,
            policy_obs_key=ACTOR,
            value_obs_key=CRITIC,
            distribution_type="normal",
            noise_std_type="log",
            init_noise_std=config.init_noise_std,
            # The first actions hardly differ from the default pose.
            mean_kernel_init_fn=jax.nn.initializers.orthogonal,
            mean_kernel_init_kwargs={"scale": 0.01},
        )
    return networks.replace(
        policy_network=_with_raw_observations(
            networks.policy_network, ACTOR, len(config.actor_hidden_dims), config
        ),
        value_network=_with_raw_observations(
            networks.value_network, CRITIC, len(config.critic_hidden_dims), config
        ),
    )


def normalised(
    observation: Mapping[str, jax.Array], normalizer: Any, config: PpoConfig
) -> dict[str, jax.Array]:
    """Observations as the networks' first layers read them."""
    return {
        name: _first_input(x, normalizer_select(normalizer, name), config) for name, x in observation.items()
    }


def _first_input(observation: jax.Array, normalizer: Any, config: PpoConfig) -> jax.Array:
    values = running_statistics.normalize(observation, normalizer)
    if not config.bfloat16:
        return values
    padding = [(0, 0)] * (values.ndim - 1) + [(0, -values.shape[-1] % ALIGNMENT)]
    return jnp.pad(values.astype(jnp.bfloat16), padding)


@jax.custom_jvp
def elu(x: jax.Array) -> jax.Array:
    """ELU, whose derivative is computed from its output.

    The next layer's gradient keeps the output in any case; input and exponential need not be kept.
    """
    return jnp.where(x > 0, x, jnp.exp(jnp.minimum(x, 0)) - 1)


@elu.defjvp
def _elu_jvp(primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> tuple[jax.Array, jax.Array]:
    y = elu(*primals)
    return y, jnp.where(y > 0, 1, y + 1) * tangents[0]


def _with_raw_observations(
    network: FeedForwardNetwork, name: str, hidden_layers: int, config: PpoConfig
) -> FeedForwardNetwork:
    """A brax network of normalised observations, wrapped to take raw observations."""

    def apply(normalizer: Any, params: Any, observation: Mapping[str, jax.Array]) -> Any:
        x = observation[name]
        if normalizer is not None:
            x = _first_input(x, normalizer_select(normalizer, name), config)
        if config.bfloat16:
            params = hidden_in_bfloat16(params, hidden_layers)
        return network.apply(None, params, x)

    return FeedForwardNetwork(network.init, apply)


def hidden_in_bfloat16(params: Any, hidden_layers: int) -> Any:
    """Parameters, rounded in the hidden layers, with the first kernel padded like its input.

    flax computes a layer in its operands' type. The last layer's parameters are not rounded, so that outputs
    have the resolution of float32. Rounded parameters stay as they are.
    """

    def rounded(path: Any, leaf: jax.Array) -> jax.Array:
        names = [getattr(part, "key", None) for part in path]
        if not any(f"hidden_{index}" in names for index in range(hidden_layers)):
            return leaf
        leaf = leaf.astype(jnp.bfloat16)
        if "hidden_0" in names and names[-1] == "kernel":
            leaf = jnp.pad(leaf, ((0, -leaf.shape[0] % ALIGNMENT), (0, 0)))
        return leaf

    return jax.tree_util.tree_map_with_path(rounded, params)


Means = Callable[[Any, Any, np.ndarray], jax.Array]  # of normaliser, policy and observations (k, observation)


def actor_means_function(networks: PPONetworks) -> Means:
    """Returns a function that computes mean actions on the host, (k, n).
    Arguments of the same shapes share a compiled program.
    """

    @jax.jit
    def means(normalizer: Any, policy: Any, observed: jax.Array) -> jax.Array:
        return networks.policy_network.apply(normalizer, policy, {ACTOR: observed})[0]

    def on_host(normalizer: Any, policy: Any, observed: np.ndarray) -> jax.Array:
        with on_cpu(), jax.default_matmul_precision("highest"):
            return means(normalizer, policy, observed)

    return on_host


def trained_actor(means: Means, normalizer: Any, policy: Any) -> Actor:
    """The actor with these parameters, on the host; `means` computes its actions."""

    def act(observed: np.ndarray) -> np.ndarray:
        return np.asarray(means(normalizer, policy, observed))

    mean, std = (np.asarray(x["state"], np.float32) for x in (normalizer.mean, normalizer.std))
    return Actor("brax", mean, std, dense_layers(policy), act)


def dense_layers(policy: Any) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Kernels and biases of the actor's hidden and mean layers, in order."""
    leaves = _dense_leaves(policy)
    return tuple((leaves[f"{name}/kernel"], leaves[f"{name}/bias"]) for name in _layer_names(leaves))


def with_dense_layers(policy: Any, layers: tuple[tuple[np.ndarray, np.ndarray], ...]) -> Any:
    """An actor's parameters with these kernels and biases, in the order of `dense_layers`.

    Raises:
        ValueError: a kernel or a bias has another shape than the actor's.
    """
    old = _dense_leaves(policy)
    new = {
        f"{name}/{part}": array
        for name, layer in zip(_layer_names(old), layers, strict=True)
        for part, array in zip(("kernel", "bias"), layer, strict=True)
    }
    if any(old[name].shape != array.shape for name, array in new.items()):
        raise ValueError("its actor has layers of other sizes than the new training")
    return jax.tree_util.tree_map_with_path(
        lambda path, leaf: new.get(_name_of(path[1:]), leaf),
        policy,
    )


def _dense_leaves(policy: Any) -> dict[str, np.ndarray]:
    """Kernels and biases of the dense layers by name, such as MLP_0/hidden_0/kernel."""
    leaves = jax.tree_util.tree_leaves_with_path(policy["params"])
    by_name = {_name_of(path): np.asarray(leaf, np.float32) for path, leaf in leaves}
    return {name: leaf for name, leaf in by_name.items() if name.endswith(("/kernel", "/bias"))}


def _layer_names(leaves: Mapping[str, np.ndarray]) -> list[str]:
    """The hidden layers in order, then the mean's."""
    names = {name.rpartition("/")[0] for name in leaves}
    hidden = sorted((n for n in names if "hidden" in n), key=lambda name: int(name.rsplit("_", 1)[1]))
    return [*hidden, *(name for name in names if "hidden" not in name)]


def _name_of(path: tuple[Any, ...]) -> str:
    return "/".join(str(getattr(part, "key", part)) for part in path)
