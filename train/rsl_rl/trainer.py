"""A training with rsl_rl: upstream's runner, unmodified, on footfall's environment."""

import io
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import ClassVar

import jax
import numpy as np
import torch
from flax import serialization
from rsl_rl.models import MLPModel
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from footfall.common.errors import UserError
from footfall.envs.make import make_environment
from footfall.envs.old_settings import with_current_state
from footfall.robots.description import Robot
from footfall.train.actor import LOGGED_OBSERVATIONS, Actor
from footfall.train.export import export
from footfall.train.rsl_rl.environment import TorchEnvironment
from footfall.train.rsl_rl.settings import runner_settings
from footfall.train.rsl_rl.start import DAMAGES, copy_networks
from footfall.train.rsl_rl.symmetry import make_augmentation
from footfall.train.runs import checkpoint
from footfall.train.runs.failure import TrainingFailedError, non_finite_leaves, not_finite
from footfall.train.runs.folder import Run
from footfall.train.trainer import Trainer


class RslRlTrainer(Trainer):
    """See `footfall.train.trainer.Trainer`. It trains on JAX's first device."""

    device_errors: ClassVar[tuple[type[Exception], ...]] = (
        jax.errors.JaxRuntimeError,
        torch.OutOfMemoryError,
        torch.AcceleratorError,
    )
    packages: ClassVar[tuple[str, ...]] = ("torch", "rsl-rl-lib", "tensordict")
    can_start_from: ClassVar[bool] = True

    def __init__(self, run: Run, robot: Robot) -> None:
        self._run = run
        self._ppo = run.config.ppo
        self.iteration = 0
        env = make_environment(robot, run.config.env)
        self._contract, self._note = env.contract, env.note
        self.environment = TorchEnvironment(env, self._ppo.num_envs, run.provenance.seed)
        device = self.environment.device
        torch.manual_seed(run.provenance.seed)
        augment = make_augmentation(env.mirror(), device) if self._ppo.symmetry else None
        settings = runner_settings(self._ppo, augment)
        with redirect_stdout(io.StringIO()):  # the runner prints its networks
            self.runner = OnPolicyRunner(self.environment, settings, device=str(device))
        on_cuda = device.type == "cuda"
        self._random = torch.cuda.default_generators[device.index] if on_cuda else torch.default_generator
        self._observations = np.zeros((0, self.environment.get_observations()["state"].shape[1]), np.float32)

    def prepare(self, report: Callable[[str], None]) -> None:
        """Show the environment's note; `__init__` has compiled and has drawn the networks from the seed."""
        if self._note:
            report(self._note)

    def start_from(self, path: Path) -> list[str]:
        """Take over networks and normalisers; see `footfall.train.trainer.Trainer`."""
        algorithm = self.runner.alg
        return list(
            copy_networks(path, algorithm.get_policy(), algorithm.critic, self._ppo.steps_per_iteration)
        )

    def iterate(self) -> dict[str, float]:
        """Roll out and learn once; returns metrics under the names of the JAX trainer.

        Raises:
            TrainingFailedError: the networks are not finite.
        """
        try:
            return self._iterate()
        except RuntimeError:
            names = self.non_finite()  # torch refuses to sample a distribution that is not finite
            if not names:
                raise
            raise TrainingFailedError(self.iteration + 1, not_finite(names)) from None

    def _iterate(self) -> dict[str, float]:
        algorithm = self.runner.alg
        algorithm.limit = float(self._ppo.learning_rate_limit(np.float32(self.iteration)))
        algorithm.entropy_coef = float(self._ppo.entropy_weight(np.float32(self.iteration)))
        self.environment.steps_done = self.iteration * self._ppo.steps_per_iteration
        self.runner.current_learning_iteration = self.iteration
        self.runner.learn(1)
        self.iteration += 1
        observations = algorithm.storage.observations["state"].flatten(0, 1)
        self._observations = observations[-LOGGED_OBSERVATIONS:].cpu().numpy()
        losses = algorithm.losses
        total = losses["surrogate"] + losses["value"] - algorithm.entropy_coef * losses["entropy"]
        return self.environment.take_metrics() | {
            "learning/total_loss": total,
            "learning/policy_loss": losses["surrogate"],
            "learning/v_loss": losses["value"],
            "learning/entropy": losses["entropy"],
            "learning/learning_rate": algorithm.learning_rate,
            "learning/action_std": algorithm.get_policy().output_std.mean().item(),
        }

    def save(self) -> None:
        """Write a checkpoint in rsl_rl's format; `infos` holds the state that rsl_rl leaves out.

        Raises:
            CannotWriteError: the disk is full or the folder cannot be written; older checkpoints stay.
            TrainingFailedError: the state is not finite, which the metrics need not show.
        """
        names = self.non_finite()
        if names:
            raise TrainingFailedError(self.iteration, not_finite(names))
        episodes = serialization.to_bytes(jax.device_get(self.environment.episodes))
        infos = {
            "episodes": torch.frombuffer(bytearray(episodes), dtype=torch.uint8),
            "random": {self.environment.device.type: self._random.get_state()},
            "seen": torch.from_numpy(self._observations),
        }
        content = io.BytesIO()
        self.runner.save(content, infos)
        checkpoint.write(self._run.checkpoints, self.iteration, content.getvalue())

    def non_finite(self) -> list[str]:
        """Names of values that are not finite, in networks, optimiser and episodes."""
        learned = jax.tree.map(_on_the_host, self.runner.alg.save())
        return non_finite_leaves(learned | {"episodes": jax.device_get(self.environment.episodes)})

    def restore(self, path: Path) -> None:
        """Load a checkpoint; on the same machine the training continues to the same bits.

        Raises:
            UserError: the file is damaged or belongs to another configuration.
        """
        try:
            # Not the runner's own `load`, which would run code from the file.
            content = torch.load(path, weights_only=True, map_location="cpu")
            infos = content["infos"]
            fresh = self.environment.episodes
            saved = serialization.msgpack_restore(infos["episodes"].numpy().tobytes())
            episodes = serialization.from_state_dict(fresh, with_current_state(saved))
            same = jax.tree.map(lambda a, b: a.shape == b.shape, fresh, episodes)
            if not all(jax.tree.leaves(same)):
                raise ValueError("array shapes differ from config.yaml's")
            self.runner.alg.load(content, load_cfg=None, strict=True)
            random = infos["random"].get(self.environment.device.type)
            if random is not None:  # None on another kind of device, as when a CPU exports a GPU's run
                self._random.set_state(random)
            self._observations = infos["seen"].numpy()
            self.iteration = content["iter"] + 1
        except DAMAGES as error:
            reason = " ".join(str(error).split())[:120]
            raise UserError(f"{path} is not a checkpoint of this run: {reason}") from None
        self.environment.put(episodes)

    def export(self, path: Path) -> float:
        """Write the policy; returns and raises as `footfall.train.export.export`."""
        return export(trained_actor(self.runner.alg.get_policy()), self._contract, self._observations, path)


def trained_actor(model: MLPModel) -> Actor:
    """The actor as it stands, its arrays on the host."""
    normalizer = model.obs_normalizer
    layers = [layer for layer in model.mlp if isinstance(layer, torch.nn.Linear)]

    def act(observed: np.ndarray) -> np.ndarray:
        observations = torch.from_numpy(observed).to(layers[0].weight.device)
        with torch.no_grad():
            return _array(model(TensorDict({"state": observations}, batch_size=[len(observations)])))

    return Actor(
        trainer="rsl_rl",
        mean=_array(normalizer.mean),
        scale=_array(normalizer.std + normalizer.eps),
        layers=tuple((_array(layer.weight.T), _array(layer.bias)) for layer in layers),
        act=act,
    )


def _on_the_host(leaf: object) -> object:
    return _array(leaf) if isinstance(leaf, torch.Tensor) else leaf


def _array(tensor: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().cpu().numpy())
