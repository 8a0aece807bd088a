"""Names that settings had in older presets and run folders, which still load."""

from typing import Any

from footfall.envs.old_settings import with_terms

# Section ppo. Today's names are those of rsl_rl.
PPO = {
    "environments": "num_envs",
    "unroll": "num_steps_per_env",
    "minibatches": "num_mini_batches",
    "passes": "num_learning_epochs",
    "discount": "gamma",
    "gae_lambda": "lam",
    "clip": "clip_param",
    "entropy": "entropy_coef",
    "gradient_norm": "max_grad_norm",
    "initial_std": "init_noise_std",
    "actor_layers": "actor_hidden_dims",
    "critic_layers": "critic_hidden_dims",
}


def with_current_names(settings: Any) -> Any:
    """A training's settings, as read from YAML, under today's names.

    Unknown names stay, and so does an old name beside its new one: both are refused later.
    """
    if not isinstance(settings, dict):
        return settings
    new = settings | ({"env": with_terms(settings["env"])} if "env" in settings else {})
    if isinstance(settings.get("ppo"), dict):
        ppo = settings["ppo"]
        new["ppo"] = {_current(name, ppo): value for name, value in ppo.items()}
    return new


def _current(name: Any, settings: dict[Any, Any]) -> Any:
    current = PPO.get(name, name)
    return name if current in settings else current
