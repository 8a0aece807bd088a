"""Networks of another training as the start of one with rsl_rl."""

from collections.abc import Sequence
from pathlib import Path
from pickle import PickleError
from typing import Any

import torch
from rsl_rl.models import MLPModel

from footfall.common.errors import UserError
from footfall.train.origin import (
    CHECKPOINT_COPIED,
    CRITIC_NOT_COPIED,
    EXPORTED,
    POLICY_COPIED,
    read_exported,
)

# Errors of reading a damaged or foreign checkpoint.
DAMAGES = (OSError, EOFError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, PickleError)


def copy_networks(path: Path, actor: MLPModel, critic: MLPModel, samples: int) -> Sequence[str]:
    """Copy networks and normalisers of a checkpoint or of an exported policy into fresh networks.

    Args:
        path: the file.
        actor, critic: the new training's.
        samples: sample count to assume for the normaliser of an exported policy.

    Returns:
        Notes on what was copied.

    Raises:
        UserError: the file is damaged, or its actor has layers of other sizes.
    """
    try:
        if path.suffix == EXPORTED:
            _copy_policy(path, actor, samples)
            return POLICY_COPIED
        saved = torch.load(path, weights_only=True, map_location="cpu")  # runs no code from the file
        actor.load_state_dict(saved["actor_state_dict"], strict=True)
        if _fits(saved["critic_state_dict"], critic):
            critic.load_state_dict(saved["critic_state_dict"], strict=True)
            return CHECKPOINT_COPIED
        return CRITIC_NOT_COPIED
    except DAMAGES as error:
        reason = " ".join(str(error).split())[:120]
        raise UserError(f"cannot start from {path}: {reason}") from None


def _copy_policy(path: Path, actor: MLPModel, samples: int) -> None:
    exported, normalizer = read_exported(path), actor.obs_normalizer
    layers = [layer for layer in actor.mlp if isinstance(layer, torch.nn.Linear)]
    std = torch.tensor(exported.std) - normalizer.eps  # the normaliser adds eps itself
    state = actor.state_dict() | {
        "obs_normalizer._mean": torch.tensor(exported.mean)[None],
        "obs_normalizer._std": std[None],
        "obs_normalizer._var": (std**2)[None],
        "obs_normalizer.count": torch.tensor(samples),
    }
    names = {id(value): name for name, value in actor.named_parameters()}
    for layer, (kernel, bias) in zip(layers, exported.layers, strict=True):
        state[names[id(layer.weight)]] = torch.tensor(kernel.T)
        state[names[id(layer.bias)]] = torch.tensor(bias)
    actor.load_state_dict(state, strict=True)


def _fits(saved: dict[str, Any], model: MLPModel) -> bool:
    """Whether saved values have the names and shapes of a model's."""
    current = model.state_dict()
    return current.keys() == saved.keys() and all(
        current[name].shape == saved[name].shape for name in current
    )
