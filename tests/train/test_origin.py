"""Fine-tuning: a training starts from the networks of a run or of a policy, or is refused by name."""

from dataclasses import replace
from pathlib import Path

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

    def fresh(self, seed: int) -> tuple:
        state = self.begin(seed)
        return state.params, state.normalizer


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    from footfall.robots.description import load_robot

    return Trained(tmp_path_factory.mktemp("trained") / "run", load_robot("go1"))


def same(one: object, other: object) -> bool:
    return all(jax.tree.leaves(jax.tree.map(lambda a, b: bool(np.array_equal(a, b)), one, other)))


class TestTakenOver:
    def test_a_checkpoint_gives_actor_critic_and_normaliser(self, trained: Trained) -> None:
        path = checkpoint.latest(trained.run.checkpoints)
        params, normalizer, _ = copied_networks(path, *trained.fresh(1), trained.run.config.ppo)
        assert same(params, trained.state.params)
        assert same(normalizer, trained.state.normalizer)

    def test_a_policy_gives_the_actor_and_the_critic_is_initialised(self, trained: Trained) -> None:
        fresh = trained.fresh(1)
        params, normalizer, notes = copied_networks(trained.run.policy, *fresh, trained.run.config.ppo)
        assert same(dense_layers(params.policy), dense_layers(trained.state.params.policy))
        assert same(params.value, fresh[0].value)
        np.testing.assert_allclose(normalizer.mean["state"], 0.25)
        assert any("critic" in line for line in notes)
        seen = np.random.default_rng(0).normal(size=(5, fresh[1].mean["state"].size)).astype(np.float32)
        acts = [
            trained_actor(actor_means_function(trained.networks), n, p).act(seen)
            for n, p in ((normalizer, params.policy), (trained.state.normalizer, trained.state.params.policy))
        ]
        np.testing.assert_array_equal(*acts)

    def test_a_damaged_file_is_refused(self, trained: Trained, tmp_path: Path) -> None:
        broken = tmp_path / "start.ckpt"
        broken.write_bytes(b"nothing")
        with pytest.raises(UserError):
            copied_networks(broken, *trained.fresh(1), trained.run.config.ppo)


def test_fine_tuning_starts_with_the_loaded_networks(trained: Trained, go1: Robot, tmp_path: Path) -> None:
    """An export before any iteration is the original policy."""
    other = trained.begin(7)
    observed = np.zeros((1, trained.env.observation_sizes["state"]), np.float32)
    trainer = BraxTrainer(trained.run, go1)
    trainer.restore(checkpoint.save(tmp_path / "other", 1, other, observed))
    trainer.start_from(trained.run.policy)
    trainer.export(tmp_path / "policy.onnx")
    exported, original = read_exported(tmp_path / "policy.onnx"), read_exported(trained.run.policy)
    for one, another in zip(jax.tree.leaves(exported), jax.tree.leaves(original), strict=True):
        np.testing.assert_array_equal(one, another)


class TestSource:
    def test_networks_come_from_a_checkpoint_of_the_same_trainer_or_a_policy(self, trained: Trained) -> None:
        spec = trained.run.folder
        assert find_source(spec, "brax").file == checkpoint.latest(trained.run.checkpoints)
        assert find_source(spec, "mine:Trainer").file == trained.run.policy
        assert find_source(ZOO / "go1-flat", "brax").file == ZOO / "go1-flat" / "policy.onnx"

    @pytest.mark.parametrize("spec", ["trot", "no_such_run"])
    def test_a_policy_without_networks_is_refused(self, spec: str) -> None:
        with pytest.raises(UserError, match=f"--from {spec}"):
            find_source(Path(spec), "brax")

    def test_an_actor_of_another_size_is_refused_by_name(self, trained: Trained) -> None:
        ppo = replace(trained.run.config.ppo, actor_hidden_dims=(7,))
        with pytest.raises(UserError, match=r"actor_hidden_dims .*\[32, 32\].*\[7\]"):
            check_source(find_source(trained.run.folder, "brax"), trained.env.contract, ppo)

    def test_another_observation_is_refused_and_other_gains_are_reported(self, trained: Trained) -> None:
        source, ppo = find_source(trained.run.policy, "brax"), trained.run.config.ppo
        contract = trained.env.contract
        stiffer = replace(contract, kp=tuple(2 * each for each in contract.kp))
        assert check_source(source, stiffer, ppo) == ["kp"]
        fewer = replace(contract, observation=contract.observation[:-1], control_rate_hz=25.0)
        with pytest.raises(UserError, match=f"control_rate_hz.*{contract.observation[-1].name}"):
            check_source(source, fewer, ppo)


class TestRun:
    def test_the_folder_holds_and_names_its_networks(self, trained: Trained, tmp_path: Path) -> None:
        request = TrainRequest(preset="smoke", out=tmp_path / "tuned", start_from=trained.run.folder)
        run = open_run(begin(request))
        chosen = checkpoint.latest(trained.run.checkpoints)
        origin = run.provenance.started_from
        assert origin is not None
        assert origin.file == str(chosen)
        assert run.start is not None
        assert run.start.read_bytes() == chosen.read_bytes()

    def test_a_policy_that_does_not_fit_leaves_no_folder(self, trained: Trained, tmp_path: Path) -> None:
        out = tmp_path / "tuned"
        with pytest.raises(UserError, match="go1-flat"):
            begin(TrainRequest(preset="smoke", out=out, start_from=ZOO / "go1-flat"))
        assert not out.exists()
