"""A preset's `ppo` section as settings of rsl_rl."""

from collections.abc import Callable
from typing import Any

from footfall.train.config import PpoConfig
from footfall.train.rsl_rl.ppo import LimitedPpo


def runner_settings(config: PpoConfig, augment: Callable | None) -> dict[str, Any]:
    """Settings of rsl_rl's runner; all others keep rsl_rl's defaults.

    Args:
        config: the preset's `ppo` section.
        augment: returns samples and their mirror images; None: no mirror images.
    """

    def network(layers: tuple[int, ...]) -> dict[str, Any]:
        return {
            "class_name": "MLPModel",
            "hidden_dims": list(layers),
            "activation": "elu",
            "obs_normalization": True,
        }

    # The logarithm is learned: the standard deviation itself could fall below zero.
    noise = {"class_name": "GaussianDistribution", "init_std": config.init_noise_std, "std_type": "log"}
    return {
        "num_steps_per_env": config.num_steps_per_env,
        "check_for_nan": False,  # the environment ends a diverged episode; the loop checks the losses
        "obs_groups": {"actor": ["state"], "critic": ["privileged_state"]},
        "actor": network(config.actor_hidden_dims) | {"distribution_cfg": noise},
        "critic": network(config.critic_hidden_dims),
        "algorithm": {
            "class_name": LimitedPpo,
            "num_learning_epochs": config.num_learning_epochs,
            "num_mini_batches": config.num_mini_batches,
            "clip_param": config.clip_param,
            "gamma": config.gamma,
            "lam": config.lam,
            "entropy_coef": config.entropy_coef,
            "learning_rate": config.learning_rate,
            "max_grad_norm": config.max_grad_norm,
            "schedule": "fixed" if config.desired_kl is None else "adaptive",
            "desired_kl": config.desired_kl,
            "symmetry_cfg": augment and {"data_augmentation_func": augment, "use_data_augmentation": True},
        },
    }
