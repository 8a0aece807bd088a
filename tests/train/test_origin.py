"""Fine-tuning: a training starts from the networks of a run or of a policy, or is refused by name."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from brax.training.types import UInt64

from footfall.common.errors import UserError
from footfall.envs.make import make_environment
from footfall.policies.registry import ZOO
from footfall.robots.description import Robot
from footfall.train.api import TrainRequest, begin
from footfall.train.brax.networks import actor_means_function, dense_layers, make_networks, trained_actor
from footfall.train.brax.start import copied_networks
from footfall.train.brax.state import TrainState, initial_state
from footfall.train.brax.trainer import BraxTrainer
from footfall.train.config import load_preset
from footfall.train.export import export
from footfall.train.origin import check_source, find_source, read_exported
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Provenance, create_run, open_run


class Trained:
    """A run of the preset smoke with a checkpoint and a policy, as if it had trained."""

    def __init__(self, folder: Path, robot: Robot) -> None:
        config = load_preset("smoke")
        made = Provenance("go1", 5, "smoke", "brax", "cpu", "abc", "2026-01-01", {}, robot.digest)
        self.run = create_run(folder, made, config)
        self.env = make_environment(robot, config.env)
        self.networks = make_networks(self.env.observation_sizes, self.env.action_size, config.ppo)
        self._begin = jax.jit(lambda seed: initial_state(self.env, self.networks, config.ppo, seed))
        state = self.begin(5)
        mean = {name: np.full_like(each, 0.25) for name, each in state.normalizer.mean.items()}
        normalizer = state.normalizer.replace(mean=mean, count=UInt64(hi=np.uint32(0), lo=np.uint32(10**8)))
        self.state = state._replace(normalizer=normalizer)
        observed = np.zeros((1, self.env.observation_sizes["state"]), np.float32)
        checkpoint.save(self.run.checkpoints, 3, self.state, observed)
        actor = trained_actor(actor_means_function(self.networks), normalizer, self.state.params.policy)
        export(actor, self.env.contract, observed, self.run.policy)

    def begin(self, seed: int) -> TrainState:
        return jax.device_get(self._begin(seed))

    def copied(self, path: Path) -> tuple[Any, ...]:
        """Parameters, normaliser and notes of a training that starts from a file, and its own parameters."""
        state = self.begin(1)
        return *copied_networks(path, state.params, state.normalizer, self.run.config.ppo), state.params


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, go1: Robot) -> Trained:
    return Trained(tmp_path_factory.mktemp("trained") / "run", go1)


def same(one: object, other: object) -> bool:
    return all(jax.tree.leaves(jax.tree.map(lambda a, b: bool(np.array_equal(a, b)), one, other)))


def test_a_checkpoint_gives_actor_critic_and_normaliser(trained: Trained, tmp_path: Path) -> None:
    params, normalizer, *_ = trained.copied(checkpoint.latest(trained.run.checkpoints))
    assert same((params, normalizer), (trained.state.params, trained.state.normalizer))
    (tmp_path / "damaged.ckpt").write_bytes(b"nothing")
    with pytest.raises(UserError):
        trained.copied(tmp_path / "damaged.ckpt")


def test_a_policy_gives_the_actor_and_the_critic_is_initialised(trained: Trained) -> None:
    params, normalizer, notes, own = trained.copied(trained.run.policy)
    assert same(dense_layers(params.policy), dense_layers(trained.state.params.policy))
    assert same(params.value, own.value)
    np.testing.assert_allclose(normalizer.mean["state"], 0.25)
    assert any("critic" in line for line in notes)
    seen = np.random.default_rng(0).normal(size=(5, normalizer.mean["state"].size)).astype(np.float32)
    original = (trained.state.normalizer, trained.state.params.policy)
    means = actor_means_function(trained.networks)
    acts = [trained_actor(means, *each).act(seen) for each in ((normalizer, params.policy), original)]
    np.testing.assert_array_equal(*acts)


def test_fine_tuning_starts_with_the_loaded_networks(trained: Trained, go1: Robot, tmp_path: Path) -> None:
    """An export before any iteration is the original policy."""
    other = trained.begin(7)
    observed = np.zeros((1, trained.env.observation_sizes["state"]), np.float32)
    trainer = BraxTrainer(trained.run, go1)
    trainer.restore(checkpoint.save(tmp_path / "other", 1, other, observed))
    trainer.start_from(trained.run.policy)
    trainer.export(tmp_path / "policy.onnx")
    assert same(read_exported(tmp_path / "policy.onnx"), read_exported(trained.run.policy))


class TestSource:
    def test_networks_come_from_a_checkpoint_of_the_same_trainer_or_a_policy(self, trained: Trained) -> None:
        last, policy, zoo = checkpoint.latest(trained.run.checkpoints), trained.run.policy, ZOO / "go1-flat"
        for spec, trainer, file in (
            (trained.run.folder, "brax", last), (trained.run.folder, "mine:Trainer", policy),
            (zoo, "brax", zoo / "policy.onnx"),
        ):  # fmt: skip
            assert find_source(spec, trainer).file == file
        for spec in ("trot", "no_such_run"):
            with pytest.raises(UserError, match=f"--from {spec}"):
                find_source(Path(spec), "brax")

    def test_only_other_gains_are_accepted_and_reported(self, trained: Trained) -> None:
        source, ppo = find_source(trained.run.policy, "brax"), trained.run.config.ppo
        contract = trained.env.contract
        stiffer = replace(contract, kp=tuple(2 * each for each in contract.kp))
        assert check_source(source, stiffer, ppo) == ["kp"]
        fewer = replace(contract, observation=contract.observation[:-1], control_rate_hz=25.0)
        with pytest.raises(UserError, match=f"control_rate_hz.*{contract.observation[-1].name}"):
            check_source(source, fewer, ppo)
        smaller = replace(ppo, actor_hidden_dims=(7,))
        with pytest.raises(UserError, match=r"actor_hidden_dims .*\[32, 32\].*\[7\]"):
            check_source(find_source(trained.run.folder, "brax"), contract, smaller)

    def test_a_run_holds_and_names_networks_that_fit(self, trained: Trained, tmp_path: Path) -> None:
        request = TrainRequest(preset="smoke", out=tmp_path / "tuned", start_from=trained.run.folder)
        with pytest.raises(UserError, match="go1-flat"):
            begin(replace(request, start_from=ZOO / "go1-flat"))
        assert not (tmp_path / "tuned").exists()
        run, chosen = open_run(begin(request)), checkpoint.latest(trained.run.checkpoints)
        assert run.provenance.started_from.file == str(chosen)
        assert run.start.read_bytes() == chosen.read_bytes()
