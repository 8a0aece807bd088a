"""The rsl_rl back end: the same environment without a copy, the same run folder, the same artifact."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
import onnxruntime
import pytest
from hostile import Hostile
from refused import refusal_of

from footfall.cli import main
from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.envs.make import make_environment
from footfall.robots.description import Robot
from footfall.train import api, export
from footfall.train.config import load_preset
from footfall.train.runs import checkpoint

if TYPE_CHECKING:
    import torch

    from footfall.train.rsl_rl.environment import TorchEnvironment
    from footfall.train.rsl_rl.trainer import RslRlTrainer

pytestmark = [
    pytest.mark.skipif(find_spec("rsl_rl") is None, reason="needs rsl_rl"),
    pytest.mark.usefixtures("torch_imported"),
]

PRESET = load_preset("smoke")
SMOKE = replace(PRESET, env=replace(PRESET.env, physics="c"))  # compiled faster than MJX
RATES = {"learning_rate": 1e-3, "final_learning_rate": 2e-4}
PPO = replace(SMOKE.ppo, total_steps=4 * SMOKE.ppo.steps_per_iteration, symmetry=True, **RATES)


@pytest.fixture(scope="module")
def torch_imported() -> Iterator[None]:
    """Imports torch, which takes seconds, only for these tests; they share a step, which is compiled once."""
    global torch, RslRlTrainer  # noqa: PLW0603
    import torch

    from footfall.train.rsl_rl import environment
    from footfall.train.rsl_rl.trainer import RslRlTrainer

    make_step, made = environment._make_step, {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(environment, "_make_step", lambda env: made.setdefault("step", make_step(env)))
        yield


@pytest.fixture(scope="module")
def preset(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A preset with four iterations and a checkpoint after each."""
    path = tmp_path_factory.mktemp("presets") / "four.yaml"
    path.write_text(dump(replace(SMOKE, ppo=PPO, checkpoint_interval_s=0.0)))
    return str(path)


@pytest.fixture(scope="module")
def run(torch_imported: None, preset: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that the command line made."""
    folder = tmp_path_factory.mktemp("runs") / "rsl_rl"
    options = ["--preset", preset, "--trainer", "rsl_rl", "--seed", "3", "--no-evaluate"]
    assert main(["train", *options, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def shared(run: Path, go1: Robot) -> RslRlTrainer:
    """A trainer that several tests use, since it is slow to make."""
    return RslRlTrainer(api.open_run(run), go1)


@pytest.fixture
def trainer(shared: RslRlTrainer, run: Path) -> RslRlTrainer:
    """The trainer in its state at the end of `run`."""
    shared.restore(newest(run))
    return shared


@pytest.fixture
def environment(trainer: RslRlTrainer) -> Iterator[TorchEnvironment]:
    yield trainer.environment
    trainer.environment._metrics.clear()


def newest(folder: Path) -> Path:
    return checkpoint.latest(folder / "checkpoints")


def some_actions() -> torch.Tensor:
    return 0.3 * torch.randn((PPO.num_envs, 12), generator=torch.Generator().manual_seed(1))


def test_torch_uses_jaxs_memory_and_metrics_are_means_since_the_last_call(
    environment: TorchEnvironment,
) -> None:
    for _ in range(2):
        rewards = []
        for _ in range(4):
            seen, reward, *_ = environment.step(some_actions())
            rewards.append(reward.mean().item())
        expected = np.mean(rewards) * SMOKE.env.control_rate_hz
        assert environment.take_metrics()["reward/total"] == pytest.approx(expected, rel=1e-5)
    for name, array in environment.episodes.observation.items():
        assert seen[name].data_ptr() == array.unsafe_buffer_pointer()


def test_a_timeout_differs_from_a_fall(environment: TorchEnvironment) -> None:
    state = environment.episodes.state
    late = state._replace(
        steps=jnp.full_like(state.steps, environment.max_episode_length - 1),
        qpos=state.qpos.at[:5, 2].set(0.05),  # five robots lie on the ground
    )
    environment.put(environment.episodes._replace(state=late))
    _, _, done, extras = environment.step(some_actions())
    assert torch.all(done == 1)
    assert extras["time_outs"][5:].mean() > 0.5
    for zeros in (extras["time_outs"][:5], environment.episode_length_buf):
        assert torch.all(zeros == 0)
    assert environment.take_metrics()["episode/length_s"] == pytest.approx(SMOKE.env.episode_s)


def test_a_mirror_image_follows_each_sample(trainer: RslRlTrainer, go1: Robot) -> None:
    from footfall.train.rsl_rl.symmetry import make_augmentation

    mirror = make_environment(go1, SMOKE.env).mirror()
    augment = make_augmentation(mirror, torch.device("cpu"))
    actions, seen = some_actions(), trainer.environment.get_observations()
    seen_twice, actions_twice = augment(None, seen, actions)
    assert np.allclose(actions_twice, np.concatenate([actions, mirror.action(actions.numpy())]))
    for name, image in mirror.observation.items():
        assert np.allclose(seen_twice[name], np.concatenate([seen[name], image(seen[name].numpy())]))


def test_the_run_folder_has_the_files_of_any_trainer(run: Path) -> None:
    provenance = api.open_run(run).provenance
    assert provenance.trainer == "rsl_rl"
    assert {"torch", "rsl-rl-lib", "jax"} <= set(provenance.versions)
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [256, 512, 768, 1024]
    rates = [line["learning/learning_rate"] for line in lines]
    assert rates == pytest.approx([1e-3, 8e-4, 6e-4, 4e-4])  # the limit on the learning rate falls linearly
    names = {f"reward/{name}" for name in (*SMOKE.env.weights, "total")}
    assert names | {"episode/length_s", "tracking/linear_error_m_s"} <= set(lines[-1])
    assert list((run / "events").glob("events.out.tfevents.*"))


def test_the_exported_policy_carries_its_normaliser(run: Path) -> None:
    content = torch.load(newest(run), weights_only=True)
    weights, seen = content["actor_state_dict"], content["infos"]["seen"]
    x = (seen - weights["obs_normalizer._mean"]) / (weights["obs_normalizer._std"] + 1e-2)
    for layer in ("mlp.0", "mlp.2", "mlp.4"):
        x = x @ weights[f"{layer}.weight"].T + weights[f"{layer}.bias"]
        x = torch.nn.functional.elu(x) if layer != "mlp.4" else x
    session = onnxruntime.InferenceSession(run / "policy.onnx")
    (exported,) = session.run(None, {"observation": seen.numpy()})
    assert len(seen) == PPO.steps_per_iteration
    assert np.abs(exported - x.numpy()).max() <= export.PARITY_LIMIT


def test_a_resumed_run_continues_exactly(
    preset: str, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    iterate = RslRlTrainer.iterate

    def interrupted(self: RslRlTrainer) -> dict[str, float]:
        if self.iteration == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return iterate(self)

    folder = tmp_path / "stopped"
    with monkeypatch.context() as patch:
        patch.setattr(RslRlTrainer, "iterate", interrupted)
        with pytest.raises(KeyboardInterrupt):
            api.train(api.TrainRequest(preset=preset, seed=3, out=folder, trainer="rsl_rl"))
    assert newest(folder).name == "00000002.ckpt"
    assert not (folder / "policy.onnx").exists()
    torch.manual_seed(99)  # independent of other work of the process
    api.resume(folder)
    assert newest(folder).read_bytes() == newest(run).read_bytes()
    assert (folder / "policy.onnx").read_bytes() == (run / "policy.onnx").read_bytes()


@pytest.mark.parametrize("part", ["actor", "critic", "optimizer", "episodes"])
def test_each_part_of_a_checkpoint_is_checked(trainer: RslRlTrainer, part: str) -> None:
    algorithm, environment = trainer.runner.alg, trainer.environment
    assert trainer.non_finite() == []
    if part == "optimizer":
        next(iter(algorithm.optimizer.state.values()))["exp_avg"].view(-1)[0] = torch.inf
    elif part == "episodes":
        episodes = environment.episodes
        qpos = episodes.state.qpos.at[3, 2].set(jnp.nan)
        environment.put(episodes._replace(state=episodes.state._replace(qpos=qpos)))
    else:
        with torch.no_grad():
            next(getattr(algorithm, part).mlp.parameters())[0, 0] = torch.nan
    (name,) = trainer.non_finite()
    assert part in name


@pytest.mark.parametrize("damage", ["half", "brax's", "code", "other networks"])
def test_a_bad_checkpoint_is_named(trainer: RslRlTrainer, run: Path, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "00000004.ckpt"
    if damage == "code":
        torch.save({"infos": Hostile(tmp_path / "made")}, path)
    elif damage == "brax's":
        checkpoint.save(tmp_path, 4, {"weights": np.ones(3)}, np.zeros(2))
    elif damage == "other networks":
        content = torch.load(newest(run), weights_only=True)
        content["actor_state_dict"]["mlp.0.weight"] = torch.zeros(16, 16)
        torch.save(content, path)
    else:
        path.write_bytes(newest(run).read_bytes()[:5000])
    assert "00000004.ckpt" in refusal_of(trainer.restore, path)
    assert not (tmp_path / "made").exists()


def test_a_training_starts_from_an_exported_policy_and_from_nothing_else(
    trainer: RslRlTrainer, run: Path, tmp_path: Path
) -> None:
    """The first actions equal the policy's, so the normaliser's scale and the layers are right."""
    from footfall.train.rsl_rl.trainer import trained_actor

    policy = trainer.runner.alg.get_policy()
    seen = np.random.default_rng(0).normal(size=(5, trainer._observations.shape[1])).astype(np.float32)
    before = trained_actor(policy).act(seen)
    for value in policy.state_dict().values():
        value.zero_()
    trainer.start_from(run / "policy.onnx")
    np.testing.assert_allclose(trained_actor(policy).act(seen), before, atol=1e-5)
    assert policy.obs_normalizer.count == PPO.steps_per_iteration
    (tmp_path / "start.pt").write_bytes(b"nothing")
    with pytest.raises(UserError, match=r"start\.pt"):
        trainer.start_from(tmp_path / "start.pt")
