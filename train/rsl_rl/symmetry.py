"""Mirror images for rsl_rl's own symmetry extension."""

from collections.abc import Callable

import torch
from tensordict import TensorDict

from footfall.envs.symmetry import EnvironmentMirror
from footfall.robots.symmetry import Mirror


def make_augmentation(mirror: EnvironmentMirror, device: torch.device) -> Callable:
    """rsl_rl's `data_augmentation_func`: returns samples, followed by the mirror image of each."""
    observation = {name: _followed_by_image(m, device) for name, m in mirror.observation.items()}
    action = _followed_by_image(mirror.action, device)

    def augment(
        env: object, obs: TensorDict | None, actions: torch.Tensor | None
    ) -> tuple[TensorDict | None, torch.Tensor | None]:
        if obs is not None:
            with_images = {
                name: followed_by_image(obs[name]) for name, followed_by_image in observation.items()
            }
            obs = TensorDict(with_images, batch_size=[2 * len(obs)])
        return obs, None if actions is None else action(actions)

    return augment


def _followed_by_image(mirror: Mirror, device: torch.device) -> Callable[[torch.Tensor], torch.Tensor]:
    source = torch.as_tensor(mirror.source, device=device)
    sign = torch.as_tensor(mirror.sign, dtype=torch.float32, device=device)
    return lambda samples: torch.cat([samples, samples[:, source] * sign])
