"""Networks of another training as the start of a new one."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from brax.training.agents.ppo.losses import PPONetworkParams
from brax.training.types import UInt64
from flax import serialization

from footfall.common.errors import UserError
from footfall.train.brax.networks import ACTOR, CRITIC, with_dense_layers
from footfall.train.config import PpoConfig
from footfall.train.origin import (
    CHECKPOINT_COPIED,
    CRITIC_NOT_COPIED,
    EXPORTED,
    POLICY_COPIED,
    read_exported,
)


def copied_networks(
    path: Path, params: PPONetworkParams, normalizer: Any, ppo: PpoConfig
) -> tuple[PPONetworkParams, Any, Sequence[str]]:
    """Networks and normaliser of a checkpoint or of an exported policy.

    Args:
        path: the file.
        params: parameters of the new training, on the host.
        normalizer: normaliser of the new training. Values without a counterpart in the file stay in both.
        ppo: the new training's settings.

    Returns:
        Parameters, normaliser, and notes on what was copied.

    Raises:
        UserError: the file is damaged, or its actor has layers of other sizes.
    """
    try:
        if path.suffix == EXPORTED:
            return _from_policy(path, params, normalizer, ppo)
        return _from_checkpoint(path, params, normalizer, ppo)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise UserError(f"cannot start from {path}: {reason}") from None


def _from_checkpoint(
    path: Path, params: PPONetworkParams, normalizer: Any, ppo: PpoConfig
) -> tuple[PPONetworkParams, Any, Sequence[str]]:
    saved = serialization.msgpack_restore(path.read_bytes())["state"]
    policy = _same_shapes(params.policy, saved["params"]["policy"])
    if policy is None:
        raise ValueError("its actor has layers of other sizes than the new training")
    value = _same_shapes(params.value, saved["params"]["value"])
    saved_normalizer = _same_shapes(normalizer, saved["normalizer"])
    if value is not None and saved_normalizer is not None:
        return params.replace(policy=policy, value=value), saved_normalizer, CHECKPOINT_COPIED
    old = saved["normalizer"]
    mixed = _with_actor(normalizer, old["mean"][ACTOR], old["std"][ACTOR], ppo.steps_per_iteration)
    return params.replace(policy=policy), mixed, CRITIC_NOT_COPIED


def _from_policy(
    path: Path, params: PPONetworkParams, normalizer: Any, ppo: PpoConfig
) -> tuple[PPONetworkParams, Any, Sequence[str]]:
    actor = read_exported(path)
    return (
        params.replace(policy=with_dense_layers(params.policy, actor.layers)),
        _with_actor(normalizer, actor.mean, actor.std, ppo.steps_per_iteration),
        POLICY_COPIED,
    )


def _same_shapes(fresh: Any, saved: Any) -> Any:
    """A saved tree in the form of a fresh one; None if shapes or names differ."""
    try:
        restored = serialization.from_state_dict(fresh, saved)
        same = jax.tree.map(lambda a, b: np.shape(a) == np.shape(b), fresh, restored)
    except (ValueError, KeyError):
        return None
    return restored if all(jax.tree.leaves(same)) else None


def _with_actor(normalizer: Any, mean: np.ndarray, std: np.ndarray, count: int) -> Any:
    """A fresh normaliser with the statistics of the actor's observation, as if of `count` samples.

    The critic's observation starts with mean 0 and deviation 1, weighted by the same count. One iteration's
    samples are few enough: its statistics soon outweigh that start.

    Raises:
        ValueError: the observation has another size.
    """
    if mean.shape != normalizer.mean[ACTOR].shape:
        raise ValueError("its actor observes another number of values")
    deviations = {CRITIC: normalizer.std[CRITIC], ACTOR: np.asarray(std, np.float32)}
    return normalizer.replace(
        count=UInt64(hi=np.uint32(count >> 32), lo=np.uint32(count & 0xFFFFFFFF)),
        mean=normalizer.mean | {ACTOR: np.asarray(mean, np.float32)},
        std=deviations,
        summed_variance={name: np.float32(count) * np.square(each) for name, each in deviations.items()},
    )
