"""The parts of a training, on numbers that all differ: what reaches the loss, the run folder, the user,
the sweep."""

import csv
import io
import json
import math
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

pytest.importorskip("jax")

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.acme import running_statistics
from jax.experimental.compilation_cache.compilation_cache import reset_cache
from jax.sharding import PartitionSpec
from rich.console import Console

from footfall.common.errors import CannotWriteError, UserError
from footfall.robots.description import Robot
from footfall.train import api, cluster
from footfall.train.api import TrainRequest
from footfall.train.brax import devices, ppo
from footfall.train.brax.networks import _dense_layers, make_networks, trained_actor
from footfall.train.brax.ppo import TrainState
from footfall.train.config import PpoConfig, TrainConfig, load_preset
from footfall.train.runs import checkpoint, display, journal
from footfall.train.runs.display import Display, metrics_table
from footfall.train.runs.failure import (
    Failure,
    device_failures,
    failed,
    failure_of,
    non_finite_leaves,
    not_finite,
)
from footfall.train.runs.folder import Provenance, Run, create_run, open_run
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.stop import StopRequest

ENVIRONMENTS, UNROLL, ACTIONS = 6, 3, 2
SIZES = {"state": 3, "privileged_state": 2}
CONFIG: PpoConfig = replace(
    load_preset("smoke").ppo, num_envs=ENVIRONMENTS, num_steps_per_env=UNROLL, num_mini_batches=3,
    num_learning_epochs=4,
    actor_hidden_dims=(6, 5), critic_hidden_dims=(7, 4), init_noise_std=0.37,
    gamma=0.91, lam=0.82, clip_param=0.13, entropy_coef=0.017, learning_rate=2e-3, final_learning_rate=2e-3,
)  # fmt: skip
NETWORKS = make_networks(SIZES, ACTIONS, CONFIG)


class Counting:
    """Environments that show how many steps they have done; the first falls in its second step, the
    second runs
    out of time in its third."""

    period_s = 0.05

    def reset(self, key: jax.Array, level: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        number = jax.random.uniform(key)
        return number, {name: number * jnp.ones(size) for name, size in SIZES.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        return jnp.float32(steps)

    def at_level(self, state: jax.Array, level: jax.Array) -> jax.Array:
        return state

    def step(self, state: jax.Array, action: jax.Array) -> tuple[Any, dict[str, jax.Array], Any]:
        state = state + 1.0
        rows, done_steps = jnp.arange(ENVIRONMENTS), jnp.floor(state)
        fell = ((rows == 0) & (done_steps == 2)) * 1.0
        late = ((rows == 1) & (done_steps == 3)) * 1.0
        shown = {name: state[:, None] * jnp.ones(size) for name, size in SIZES.items()}
        ended = jnp.maximum(fell, late)
        metrics = {"done": ended, "length": ended * done_steps, "steps": done_steps}
        return state, shown, SimpleNamespace(reward=10.0 * rows + done_steps, truncated=late, metrics=metrics)


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(ppo, "step_batch", step_by_hand)
    return Counting()


@pytest.fixture(scope="module")
def begun() -> TrainState:
    return ppo.initial_state(Counting(), NETWORKS, CONFIG, 3)  # type: ignore[arg-type]


def step_by_hand(env: Any, state: Any, action: jax.Array) -> Any:
    """In place of `step_batch`: `Counting` steps all its environments by itself."""
    return env.step(state, action)


@pytest.fixture(scope="module")
def rolled(begun: TrainState) -> Any:
    """Three steps of each environment."""
    keys = jax.random.split(jax.random.PRNGKey(1), UNROLL)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo, "step_batch", step_by_hand)
        return ppo.make_rollout(Counting(), NETWORKS, CONFIG)(begun, keys)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def learnt(begun: TrainState, rolled: Any) -> tuple[dict[str, Any], Any]:
    """Learning with a loss that shows what it is given, and is steep alike along all parameters."""
    given: dict[str, Any] = {}

    def loss(params: Any, normalizer: Any, data: Any, key: jax.Array, **settings: Any) -> tuple[Any, dict]:
        given.update(settings)
        following = data.next_observation["state"][:, -1, 0]
        shown = {"reward": data.reward, "following": following, "key": key}
        total = 1e-4 * sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params))
        return total, {"kl_mean": jnp.float32(0.0), **shown}

    (_, observation), (rollout, _) = rolled
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo, "compute_ppo_loss", loss)
        learn = ppo.make_learning(NETWORKS, CONFIG)
        return given, learn(begun, rollout, observation, jax.random.PRNGKey(2))


def plain_loss(params: Any, *_: Any, **__: Any) -> tuple[Any, dict]:
    """Quick to trace."""
    return sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params)), {"kl_mean": jnp.float32(0.0)}


class TestPpo:
    def test_environments_begin_apart_and_networks_are_drawn_apart(
        self, counting: Any, begun: TrainState
    ) -> None:
        assert len(np.unique(begun.env)) == ENVIRONMENTS
        other = ppo.initial_state(counting, NETWORKS, CONFIG, 4)
        assert not np.array_equal(begun.env, other.env)
        leaves = zip(*(jax.tree.leaves(state.params.policy) for state in (begun, other)), strict=True)
        assert any(not np.array_equal(*pair) for pair in leaves)
        assert int(begun.iteration) == 0
        assert not any(leaf.weak_type for leaf in jax.tree.leaves(begun))

    def test_a_transition_is_what_was_seen_done_and_earned_in_one_step(
        self, begun: TrainState, rolled: Any
    ) -> None:
        (env, observation), (rollout, metrics) = rolled
        start = np.asarray(begun.env)
        np.testing.assert_allclose(
            rollout.observation["state"][..., 0], start + np.arange(UNROLL)[:, None], rtol=1e-6
        )
        np.testing.assert_allclose(observation["state"][:, 0], start + UNROLL, rtol=1e-6)
        np.testing.assert_allclose(env, start + UNROLL, rtol=1e-6)
        steps = np.arange(1, UNROLL + 1)[:, None]
        np.testing.assert_allclose(rollout.reward, 10.0 * np.arange(ENVIRONMENTS) + steps)
        ended, late = np.zeros((UNROLL, ENVIRONMENTS)), np.zeros((UNROLL, ENVIRONMENTS))
        ended[1, 0] = ended[2, 1] = late[2, 1] = 1.0
        np.testing.assert_array_equal(rollout.discount, 1.0 - ended)
        np.testing.assert_array_equal(rollout.extras["state_extras"]["truncation"], late)
        np.testing.assert_array_equal(metrics["steps"], np.tile(steps, ENVIRONMENTS))

    def test_metrics_are_means_and_some_observations_are_kept(
        self, counting: Any, begun: TrainState, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ppo, "compute_ppo_loss", plain_loss)
        monkeypatch.setattr(ppo, "LOGGED_OBSERVATIONS", 1000)
        all_of_them = jax.eval_shape(ppo.make_iteration(counting, NETWORKS, CONFIG), begun)[2]
        assert all_of_them.shape == (ENVIRONMENTS * UNROLL, 3)
        for most in (4, 8):
            monkeypatch.setattr(ppo, "LOGGED_OBSERVATIONS", most)
            _, metrics, seen = ppo.make_iteration(counting, NETWORKS, CONFIG)(begun)
            assert seen.shape == (most, 3)
            newest = np.asarray(begun.env) + 2.0
            np.testing.assert_allclose(seen[-ENVIRONMENTS:, 0], newest[:most], rtol=1e-6)
        assert float(metrics["episode/length_s"]) == pytest.approx(2.5 * 0.05)  # of two steps and of three
        assert float(metrics["reward/total"]) == pytest.approx((25.0 + 2.0) / 0.05)
        assert float(metrics["steps"]) == pytest.approx(2.0)
        assert not {"done", "length"} & set(metrics)

    def test_the_settings_reach_the_loss(self, learnt: tuple[dict[str, Any], Any]) -> None:
        given, _ = learnt
        assert given["ppo_network"] is NETWORKS
        assert {name: value for name, value in given.items() if name != "ppo_network"} == {
            "entropy_cost": 0.017,
            "discounting": 0.91,
            "gae_lambda": 0.82,
            "clipping_epsilon": 0.13,
        }

    def test_each_pass_learns_once_from_each_environment_in_an_order_of_its_own(
        self, begun: TrainState, learnt: tuple[dict[str, Any], Any]
    ) -> None:
        _, (_, _, losses) = learnt
        seen = np.asarray(losses["reward"])
        assert seen.shape == (4, 3, 2, UNROLL)  # pass, minibatch, environment, time
        np.testing.assert_array_equal(seen - seen[..., :1], np.broadcast_to([0, 1, 2], seen.shape))
        order = (seen[..., 0].reshape(4, -1) - 1) / 10
        assert [sorted(each) for each in order.tolist()] == [list(range(6))] * 4
        assert len({tuple(each) for each in order.tolist()}) > 1
        following = np.asarray(losses["following"]).reshape(4, -1)
        np.testing.assert_allclose(following, (np.asarray(begun.env) + UNROLL)[order.astype(int)], rtol=1e-6)
        assert len(np.unique(np.asarray(losses["key"]).reshape(12, -1), axis=0)) == 12

    def test_parameters_go_down_the_gradient_by_the_learning_rate(
        self, begun: TrainState, learnt: tuple[dict[str, Any], Any]
    ) -> None:
        """Adam's steps along a gradient that stays as it is are as long as its rate; there are twelve of
        them."""
        _, (params, _, losses) = learnt
        for before, after in zip(*map(jax.tree.leaves, (begun.params, params)), strict=True):
            np.testing.assert_allclose(after - before, np.full(before.shape, -12 * 2e-3), rtol=2e-3)
        np.testing.assert_allclose(losses["learning_rate"], np.full((4, 3), 2e-3))

    def test_the_mean_over_devices_is_of_each_leaf(self) -> None:
        assert devices.mean_over_devices(1)({"a": 3.0}) == {"a": 3.0}
        tree = {"a": jnp.arange(4.0), "b": jnp.arange(8.0).reshape(4, 2)}
        mean = jax.vmap(devices.mean_over_devices(4), axis_name=devices.AXIS)(tree)
        np.testing.assert_allclose(mean["a"], np.full(4, 1.5))
        np.testing.assert_allclose(mean["b"], np.tile([3.0, 4.0], (4, 1)))

    def test_each_part_of_a_state_lies_where_it_belongs(self) -> None:
        for name, spec in ppo.STATE_SPECS._asdict().items():
            assert spec == (PartitionSpec("devices") if name in ("env", "observation") else PartitionSpec())
        mesh = devices.device_mesh(CONFIG, 1)
        assert (mesh.size, mesh.axis_names) == (1, ("devices",))
        where = devices.shardings({"a": devices.EACH, "b": devices.DIVIDED}, mesh)
        placed = devices.place({"a": [np.arange(2.0), np.ones(3)], "b": {"c": np.arange(6.0)}}, where)
        assert [x.sharding.spec for x in placed["a"]] == [PartitionSpec()] * 2
        assert placed["b"]["c"].sharding.spec == PartitionSpec("devices")
        np.testing.assert_array_equal(placed["b"]["c"], np.arange(6.0))

    def test_one_device_draws_other_noise_than_another_from_the_same_key(self, begun: TrainState) -> None:
        (key, steps, learn), (same, other_steps, other_learn) = (
            ppo.iteration_keys(begun, CONFIG, k) for k in (0, 1)
        )
        np.testing.assert_array_equal(key, same)
        assert not np.array_equal(key, begun.key)
        assert not np.array_equal(steps, other_steps)
        assert not np.array_equal(learn, other_learn)
        assert len(steps) == UNROLL


class TestNetworks:
    def test_an_exported_actor_is_the_network_that_was_trained(self, begun: TrainState) -> None:
        """With a normaliser that does something."""
        policy = jax.tree.map(lambda x: 1.5 * x, begun.params.policy)
        rng = np.random.default_rng(1)
        shown = {name: jnp.asarray(rng.normal(2.0, 3.0, (50, size))) for name, size in SIZES.items()}
        normalizer = running_statistics.update(begun.normalizer, shown)
        actor = trained_actor(NETWORKS, normalizer, policy)
        assert [kernel.shape for kernel, _ in actor.layers] == [(3, 6), (6, 5), (5, 2)]
        observed = rng.normal(size=(5, 3)).astype(np.float32)
        x = (observed - actor.mean) / actor.scale
        for kernel, bias in actor.layers[:-1]:
            x = x @ kernel + bias
            x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
        kernel, bias = actor.layers[-1]
        np.testing.assert_allclose(actor.act(observed), x @ kernel + bias, atol=1e-5)
        np.testing.assert_allclose(actor.mean, np.asarray(shown["state"]).mean(axis=0), rtol=1e-4)
        assert actor.trainer == "brax"

    def test_layers_are_in_order_though_their_names_are_not(self) -> None:
        numbers = [10, 2, 0, 11, 1]
        layers = {f"hidden_{k}": {"kernel": np.full((1, 1), k), "bias": np.full(1, -k)} for k in numbers}
        tree = {
            "params": {"mean": {"kernel": np.full((1, 1), 99), "bias": np.zeros(1)}, "log_std": np.ones(1)}
            | layers
        }
        found = _dense_layers(tree)
        assert [int(kernel[0, 0]) for kernel, _ in found] == [0, 1, 2, 10, 11, 99]
        assert [int(bias[0]) for _, bias in found] == [0, -1, -2, -10, -11, 0]
        assert all(part.dtype == np.float32 for layer in found for part in layer)

    def test_a_beginner_hardly_moves_and_tries_as_widely_as_it_was_told(self, begun: TrainState) -> None:
        shown = {"state": jnp.ones((1, 3))}
        mean, std = NETWORKS.policy_network.apply(begun.normalizer, begun.params.policy, shown)
        assert 0.0 < float(jnp.abs(mean).max()) < 0.02
        np.testing.assert_allclose(std, np.full((1, 2), 0.37), rtol=1e-3)
        shapes = [leaf.shape for leaf in jax.tree.leaves(begun.params.value)]
        assert {(2, 7), (7, 4), (4, 1)} <= set(shapes)


def provenance(**changes: Any) -> Provenance:
    return replace(Provenance("go1", 5, "smoke", "brax", "cpu", "abc", "2026-01-01", {"jax": "1"}), **changes)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return create_run(tmp_path / "run", provenance(), load_preset("smoke"))


@pytest.fixture
def private_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of its own; afterwards JAX has its settings back."""
    names = [
        name for name in jax.config.values if name.startswith(("jax_compilation_cache_dir", "jax_persistent"))
    ]
    before = {name: jax.config.values[name] for name in names}
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "jax"))
    reset_cache()
    (tmp_path / "jax").mkdir()
    yield tmp_path / "jax"
    for name, value in before.items():
        jax.config.update(name, value)
    reset_cache()


class TestApi:
    @pytest.fixture
    def made(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """What a run folder would be made of, without building anything."""
        seen: list[Any] = []
        kind = SimpleNamespace(
            load=lambda: SimpleNamespace(prefetch=lambda run, _: seen.append(("prefetch", run.folder))),
            devices=None,
            packages=("tensordict",),
        )  # fmt: skip
        monkeypatch.setattr(api, "TRAINERS", {"brax": kind, "rsl_rl": kind})
        monkeypatch.setattr(
            api, "assemble", lambda run, _: SimpleNamespace(mirror=seen.append(("mirror", run.folder)))
        )
        monkeypatch.setattr(
            api, "device_mesh", lambda config, count: seen.append(("mesh", config.total_steps, count))
        )
        monkeypatch.setattr(api, "source_revision", lambda: "the revision")
        return seen

    def test_a_request_is_in_the_folder_that_is_made(
        self, made: list[Any], tmp_path: Path, go1: Robot
    ) -> None:
        out = tmp_path / "mine"
        request = TrainRequest("go1", "smoke", 9, out, 12345, 7.5, "rsl_rl")
        assert api.begin(request) == out
        opened = open_run(out)
        assert (opened.config.ppo.total_steps, opened.config.checkpoint_interval_s) == (12345, 7.5)
        expected = load_preset("smoke")
        assert opened.config == replace(
            expected, ppo=replace(expected.ppo, total_steps=12345), checkpoint_interval_s=7.5
        )
        found = opened.provenance
        assert (found.robot, found.seed, found.preset, found.trainer) == ("go1", 9, "smoke", "rsl_rl")
        assert (found.revision, found.robot_digest) == ("the revision", go1.digest)
        assert {"jax", "tensordict", "mujoco"} <= set(found.versions)
        assert found.device == jax.devices()[0].device_kind
        assert made == [("prefetch", out), ("mirror", out), ("mesh", 12345, None)]

    def test_without_a_name_it_lies_in_runs_by_what_it_is(
        self, made: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_folder: Path
    ) -> None:
        monkeypatch.chdir(tmp_path)
        folder = api.begin(TrainRequest(robot=str(own_folder), preset="smoke", seed=3))
        assert folder.parent == Path("runs")
        assert folder.name.startswith("go1-smoke-3-20")
        assert open_run(folder).provenance.robot == str(own_folder)
        assert open_run(folder).config == load_preset("smoke")

    def test_what_a_run_began_on_and_what_is_now(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(api, "source_revision", lambda: "def")
        assert api._changes(provenance(), "gpu") == ["cpu", "source revision abc, now def"]
        assert api._changes(provenance(revision="def"), "cpu") == []

    def test_how_far_a_run_came_is_in_steps(self, run: Run) -> None:
        assert run.config.ppo.steps_per_iteration == 256
        end = f"of 4,096 steps; continue with: footfall train --resume {run.folder}"
        assert api._how_far(run) == f"stopped after 0 {end}"
        run.checkpoints.mkdir()
        for iteration in (5, 7):
            (run.checkpoints / f"{iteration:08d}.ckpt").touch()
        assert api._how_far(run) == f"stopped after 1,792 {end}"

    def test_a_run_is_finished_with_its_last_checkpoint_and_its_policy(self, run: Run) -> None:
        run.checkpoints.mkdir()
        assert not api._is_finished(run)
        (run.checkpoints / "00000015.ckpt").touch()
        run.policy.touch()
        assert not api._is_finished(run)
        (run.checkpoints / "00000016.ckpt").touch()
        assert api._is_finished(run)
        run.policy.unlink()
        assert not api._is_finished(run)

    def test_a_cache_that_others_may_write_is_not_used(
        self, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, private_cache: Path
    ) -> None:
        run.checkpoints.mkdir()
        (run.checkpoints / "00000016.ckpt").touch()
        run.policy.touch()
        kind = SimpleNamespace(load=lambda: SimpleNamespace(prefetch=lambda *_: None))
        monkeypatch.setattr(api, "TRAINERS", {"brax": kind})
        for mode, refused, entries in ((0o755, False, 1), (0o777, True, 0), (0o755, False, 1)):
            private_cache.chmod(mode)
            text = io.StringIO()
            api.resume(run.folder, Display(1, Console(file=text, width=400)))
            line = f"others may write to {private_cache}: no compiled programs are taken from there"
            assert (line in text.getvalue()) is refused
            jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
            jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
            jax.jit(lambda x: x * 12345.0).lower(1.0).compile()
            found = list(private_cache.glob("*-cache"))
            assert len(found) == entries
            for path in found:
                path.unlink()

    @pytest.mark.parametrize(("given", "out"), [(None, None), ("a.ckpt", "b.onnx")])
    def test_an_export_is_of_the_last_checkpoint_or_of_the_given_one(
        self, run: Run, monkeypatch: pytest.MonkeyPatch, given: str | None, out: str | None
    ) -> None:
        done: list[Any] = []

        class Kind:
            device_errors = ()

            def __init__(self, of: Run, robot: Robot) -> None:
                done.append((of.folder, robot.name))

            def restore(self, path: Path) -> None:
                done.append(path)

            def export(self, path: Path) -> float:
                done.append(path)
                return 0.25

        monkeypatch.setattr(api, "TRAINERS", {"brax": SimpleNamespace(load=lambda: Kind)})
        run.checkpoints.mkdir()
        for iteration in (2, 11):
            (run.checkpoints / f"{iteration:08d}.ckpt").touch()
        chosen, path = given and Path(given), Path(out) if out else run.policy
        assert api.export_run(run.folder, out and Path(out), chosen) == (path, 0.25)  # type: ignore[arg-type]
        assert done == [(run.folder, "go1"), chosen or run.checkpoints / "00000011.ckpt", path]

    def test_several_processes_need_a_folder_and_a_trainer_for_several(self) -> None:
        with pytest.raises(UserError, match="same --out"):
            api._check_cluster(TrainRequest())
        api._check_cluster(TrainRequest(out=Path("x")))
        with pytest.raises(UserError, match="rsl_rl trains in one process"):
            api._check_cluster(TrainRequest(out=Path("x"), trainer="rsl_rl"))


class TestCluster:
    def test_joining_hands_on_who_this_is(self, monkeypatch: pytest.MonkeyPatch) -> None:
        given: list[Any] = []
        monkeypatch.setattr(jax.distributed, "initialize", lambda *each: given.append(each))
        cluster.join("host:1", 4, 2)
        cluster.join("auto")
        assert given == [("host:1", 4, 2), ()]

        def fail(*_: Any) -> None:
            raise RuntimeError("no such host\nand more")

        monkeypatch.setattr(jax.distributed, "initialize", fail)
        with pytest.raises(UserError, match=r"at host:1: no such host$"):
            cluster.join("host:1", 4, 2)

    def test_what_another_process_fails_at_is_told_in_each(self, monkeypatch: pytest.MonkeyPatch) -> None:
        told: list[bool] = []

        def gathered(this: np.ndarray) -> np.ndarray:
            told.append(bool(this))
            return np.array([False, False, True])

        monkeypatch.setattr(cluster, "processes", lambda: 3)
        monkeypatch.setattr(cluster.multihost_utils, "process_allgather", gathered)
        with pytest.raises(UserError, match="process 2 failed"), cluster.all_or_none():
            pass
        with pytest.raises(ValueError, match="mine"), cluster.all_or_none():
            raise ValueError("mine")
        assert told == [False, True]
        monkeypatch.setattr(cluster.multihost_utils, "broadcast_one_to_all", lambda values: values + 1)
        assert cluster.broadcast(3, 0) == (4, 1)


class TestCheckpoints:
    STATE: ClassVar = {"a": np.arange(3.0, dtype=np.float32), "b": np.int32(4)}

    def test_what_is_written_is_what_is_read(self, tmp_path: Path) -> None:
        path = checkpoint.save(tmp_path / "c", 12, self.STATE, np.ones((2, 3), np.float32))
        assert path == tmp_path / "c" / "00000012.ckpt"
        shapes = {"a": jnp.zeros(3), "b": jnp.int32(0)}
        state, seen = checkpoint.restore(path, shapes)
        np.testing.assert_array_equal(state["a"], [0.0, 1.0, 2.0])
        assert int(state["b"]) == 4
        assert seen.shape == (2, 3)
        for other in (
            {"a": jnp.zeros(4), "b": jnp.int32(0)},
            {"a": jnp.zeros(3, jnp.int32), "b": jnp.int32(0)},
        ):
            with pytest.raises(UserError, match="shapes differ"):
                checkpoint.restore(path, other)

    def test_three_are_kept_and_what_a_killed_writer_left_is_dropped(self, tmp_path: Path) -> None:
        (tmp_path / ".00000001.ckpt.abc").touch()
        for iteration in (9, 10, 2, 100, 11):
            checkpoint.write(tmp_path, iteration, b"x")
        assert sorted(path.name for path in tmp_path.iterdir()) == [f"{k:08d}.ckpt" for k in (10, 11, 100)]
        assert checkpoint.latest(tmp_path) == tmp_path / "00000100.ckpt"
        assert checkpoint.latest(tmp_path / "none") is None

    def test_what_cannot_be_written_names_the_last_good_one(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        checkpoint.write(tmp_path, 3, b"x")

        def refuse(*_: Any) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(checkpoint, "write_atomically", refuse)
        with pytest.raises(
            CannotWriteError, match=r"00000004.ckpt: Permission denied; the last good one is 00000003"
        ):
            checkpoint.write(tmp_path, 4, b"y")


class TestFailures:
    @pytest.mark.parametrize(
        ("share", "limit", "fails"), [(0.01, 0.01, False), (0.0101, 0.01, True), (0.02, 0.05, False)]
    )
    def test_more_than_the_limit_of_divergences_is_one(self, share: float, limit: float, fails: bool) -> None:
        reason = failure_of({"a": 1.0, "episode/diverged": share}, limit)
        assert (reason is not None) == fails
        if reason:
            assert reason.startswith(f"{share:.2%} of the control steps")
            assert f"diverged_limit {limit:.2%}" in reason

    def test_names_of_what_is_not_finite(self) -> None:
        assert failure_of({"a": math.inf, "b": 1.0, "c": math.nan}, 0.5) == "a, c are not finite"
        assert not_finite(["a"]) == "a is not finite"
        assert not_finite(list("abcde")) == "a, b, c, d and 1 more are not finite"
        tree = {"x": np.array([1.0, np.nan]), "y": np.array([1, 2]), "z": {"w": np.float32(np.inf)}}
        assert non_finite_leaves(tree) == ["['x']", "['z']['w']"]

    def test_what_a_replay_needs_is_left(self, run: Run) -> None:
        from footfall.common.config import load

        run.checkpoints.mkdir()
        (run.checkpoints / "00000006.ckpt").write_bytes(b"good")
        folder = run.folder / "failure"
        folder.mkdir()
        for old in ("00000002.ckpt", "environment.npz"):
            (folder / old).touch()
        error = failed(run, 7, "a is not finite")
        assert str(error) == (
            "training failed in iteration 7: a is not finite; the last good checkpoint is 00000006.ckpt;"
            f" find the cause with: footfall diagnose {run.folder}"
        )
        assert sorted(path.name for path in folder.iterdir()) == ["00000006.ckpt", "failure.yaml"]
        assert (folder / "00000006.ckpt").read_bytes() == b"good"
        left = load(folder / "failure.yaml", Failure)
        assert (left.iteration, left.reason, left.devices) == (7, "a is not finite", len(jax.devices()))
        assert (left.provenance, left.config) == (run.provenance, run.config)
        assert {"source revision", "jax"} <= set(left.versions)

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("RESOURCE_EXHAUSTED: no",
            "out of memory; the last good checkpoint is none; start a new run with a smaller"),
            ("CUDA Out of Memory", "out of memory"),
            ("lost it\nmore",
            "the device failed: lost it; the last good checkpoint is none; continue with: footfall go "),
        ],
    )  # fmt: skip
    def test_a_device_that_fails_is_one_line_and_its_text_is_kept(
        self, run: Run, text: str, said: str
    ) -> None:
        with pytest.raises(UserError) as caught, device_failures(run, (ValueError,), verb="go"):
            raise ValueError(text)
        assert said in str(caught.value)
        assert str(run.folder) in str(caught.value)
        assert (run.folder / "failure" / "device_error.txt").read_text() == text


class TestDisplay:
    METRICS: ClassVar = {
        "reward/total": 1.5, "reward/b": 0.25, "reward/a": -0.002, "tracking/linear_error_m_s": 0.1234,
        "tracking/yaw_error_rad_s": 0.5678, "episode/length_s": 12.34, "learning/kl": 0.0, "other/x": 9.0,
        "learning/policy_dist_mean": 7.0,
    }  # fmt: skip

    def plain(self, total: int = 1000) -> tuple[Display, io.StringIO]:
        out = io.StringIO()
        return Display(total, Console(file=out, width=300)), out

    def test_a_plain_line_says_how_far_how_fast_and_how_well(self) -> None:
        shown, out = self.plain(2000)
        shown.update(500, 250.0, self.METRICS)
        assert out.getvalue() == (
            "500 of 2,000 steps, 250 per s, 6 s left, reward 1.50, episode 12.3 s,"
            " error 0.123 m/s 0.568 rad/s\n"
        )
        without = {name: value for name, value in self.METRICS.items() if name != "episode/length_s"}
        shown.update(2048, 0.5, without)  # the last is always said, though the one before was just now
        last = out.getvalue().splitlines()[1]
        assert last.startswith("2,000 of 2,000 steps, 0 per s, 0 s left, reward 1.50, episode - s")

    def test_lines_come_every_few_seconds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now = [100.0]
        monkeypatch.setattr(display, "time", SimpleNamespace(monotonic=lambda: now[0]))
        shown, out = self.plain()
        counts = []
        for now[0] in (100.0, 104.9, 105.1, 110.0, 110.2):
            shown.update(10, 1.0, self.METRICS)
            counts.append(out.getvalue().count("\n"))
        assert counts == [1, 1, 2, 2, 3]

    def test_the_table_has_rewards_at_the_left_and_the_rest_by_group(self) -> None:
        table = metrics_table(self.METRICS, 10)
        cells = [list(column.cells) for column in table.columns]
        assert cells == [
            ["reward/total", "reward/a", "reward/b", ""], ["1.500", "-2.0e-03", "0.250", ""],
            ["tracking/linear_error_m_s", "tracking/yaw_error_rad_s", "episode/length_s", "learning/kl"],
            ["0.123", "0.568", "12.340", "0.000"],
        ]  # fmt: skip
        assert metrics_table(self.METRICS, 2).row_count == 2
        assert metrics_table(self.METRICS, 0).row_count == 1


class TestJournal:
    @pytest.fixture
    def told(self, run: Run, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A journal from the third iteration on, its clock and what it showed."""
        now = SimpleNamespace(s=50.0)
        monkeypatch.setattr(journal, "time", SimpleNamespace(monotonic=lambda: now.s))
        shown: list[Any] = []
        screen = SimpleNamespace(update=lambda *each: shown.append(each), say=shown.append)
        return SimpleNamespace(journal=journal.Journal(run, 2, screen), now=now, shown=shown, run=run)  # type: ignore[arg-type]

    def test_an_iteration_is_logged_and_shown_by_its_steps_and_speed(self, told: SimpleNamespace) -> None:
        told.now.s += 2.0
        told.journal.report(3, {"reward/total": 1.0, "episode/length_s": 0.0})
        told.now.s += 2.0
        told.journal.report(4, {"reward/total": np.float32(2.0), "episode/length_s": 3.0})
        assert told.shown == [
            (768, 128.0, {"reward/total": 1.0}), (1024, 128.0, {"reward/total": 2.0,
            "episode/length_s": 3.0}),
        ]  # fmt: skip
        lines = [json.loads(line) for line in (told.run.folder / "metrics.jsonl").read_text().splitlines()]
        assert lines == [
            {"step": 768, "reward/total": 1.0, "speed/steps_per_s": 128.0},
            {"step": 1024, "reward/total": 2.0, "episode/length_s": 3.0, "speed/steps_per_s": 128.0},
        ]

    def test_a_checkpoint_that_does_not_fit_is_said_once_and_tried_again(self, told: SimpleNamespace) -> None:
        def refuse() -> None:
            raise CannotWriteError("the disk is full")

        told.now.s += 2.1  # the preset's interval is 2 s
        assert told.journal.checkpoint_due
        told.journal.save(refuse)
        assert not told.journal.checkpoint_due
        told.journal.save(refuse)
        told.journal.save(lambda: None)
        told.journal.save(lambda: None)
        assert told.shown == [
            "the disk is full; training goes on and tries again",
            "checkpoint can be written again",
        ]

    def test_a_failure_is_logged_before_it_ends_the_training(self, told: SimpleNamespace) -> None:
        with pytest.raises(UserError, match="iteration 3: a is not finite"):
            told.journal.report(3, {"a": math.nan})
        assert '"step": 768' in (told.run.folder / "metrics.jsonl").read_text()
        assert told.shown == []


def test_a_resumed_log_keeps_what_was_before_it(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    path.write_text('{"step": 10}\n{"step": 20}\nhalf a li\n{"no": 1}\n{"step": 30}\n')
    MetricsLog(tmp_path, 20).close()
    assert path.read_text() == '{"step": 10}\n{"step": 20}\n'


def test_of_two_signals_the_second_interrupts_and_handlers_are_put_back() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with StopRequest() as stop:
        assert not stop.requested
        signal.raise_signal(signal.SIGTERM)
        assert stop.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


class TestSettings:
    def test_iterations_cover_all_steps(self) -> None:
        for steps, iterations in ((1, 1), (18, 1), (19, 2), (36, 2), (37, 3)):
            assert replace(CONFIG, total_steps=steps).iterations == iterations
        assert CONFIG.steps_per_iteration == 18

    @pytest.mark.parametrize(
        "change",
        [
            {"total_steps": 0}, {"num_envs": 0}, {"num_steps_per_env": 0},
            {"num_mini_batches": 0}, {"num_learning_epochs": 0},
            {"learning_rate": 0.0},
            {"desired_kl": 0.0}, {"clip_param": 0.0}, {"max_grad_norm": 0.0}, {"init_noise_std": 0.0},
            {"actor_hidden_dims": (3, 0)},
            {"critic_hidden_dims": (0,)}, {"actor_hidden_dims": ()}, {"critic_hidden_dims": ()},
            {"final_learning_rate": -1e-9},
            {"entropy_coef": -1e-9}, {"gamma": 1.01}, {"gamma": -0.01}, {"lam": 1.01},
            {"num_envs": 7},
        ],
    )  # fmt: skip
    def test_what_cannot_be_is_refused(self, change: dict[str, Any]) -> None:
        with pytest.raises(ValueError, match=r"must be|need a hidden|not a multiple"):
            replace(CONFIG, **change)

    def test_what_just_can_be_is_taken(self) -> None:
        just = {
            "final_learning_rate": 0.0,
            "entropy_coef": 0.0,
            "gamma": 1.0,
            "lam": 0.0,
            "desired_kl": None,
        }
        assert isinstance(replace(CONFIG, **just), PpoConfig)
        with pytest.raises(ValueError, match="checkpoint_interval_s"):
            TrainConfig(CONFIG, load_preset("smoke").env, checkpoint_interval_s=-0.1)


class TestRslRl:
    def test_every_setting_reaches_upstream(self) -> None:
        pytest.importorskip("rsl_rl")
        from footfall.train.rsl_rl.ppo import LimitedPpo
        from footfall.train.rsl_rl.settings import runner_settings

        config = replace(
            CONFIG,
            max_grad_norm=0.7,
            init_noise_std=0.37,
            actor_hidden_dims=(9, 8),
            critic_hidden_dims=(7,),
            desired_kl=0.02,
        )
        network = {"class_name": "MLPModel", "activation": "elu", "obs_normalization": True}
        noise = {"class_name": "GaussianDistribution", "init_std": 0.37, "std_type": "log"}
        assert runner_settings(config, None) == {
            "num_steps_per_env": UNROLL, "check_for_nan": False,
            "obs_groups": {"actor": ["state"], "critic": ["privileged_state"]},
            "actor": network | {"hidden_dims": [9, 8], "distribution_cfg": noise},
            "critic": network | {"hidden_dims": [7]},
            "algorithm": {
                "class_name": LimitedPpo, "num_learning_epochs": 4, "num_mini_batches": 3, "clip_param": 0.13,
                "gamma": 0.91, "lam": 0.82, "entropy_coef": 0.017, "learning_rate": 2e-3,
                "max_grad_norm": 0.7,
                "schedule": "adaptive", "desired_kl": 0.02, "symmetry_cfg": None,
            },
        }  # fmt: skip
        algorithm = runner_settings(replace(config, desired_kl=None), max)["algorithm"]
        assert algorithm["schedule"] == "fixed"
        assert algorithm["symmetry_cfg"] == {"data_augmentation_func": max, "use_data_augmentation": True}

    def test_metrics_are_means_over_steps_and_environments_and_lengths_of_episodes_that_ended(self) -> None:
        pytest.importorskip("rsl_rl")
        from footfall.train.rsl_rl.environment import TorchEnvironment

        steps = [{"done": 0.25, "length": 2.0, "a": 1.0}, {"done": 0.5, "length": 5.0, "a": 2.0}]
        seen: Any = SimpleNamespace(_metrics=list(steps), num_envs=4, _period_s=0.05)
        metrics = TorchEnvironment.take_metrics(seen)
        # Three episodes ended, after 28 control steps in all.
        assert metrics == pytest.approx({"a": 1.5, "episode/length_s": 28 / 3 * 0.05})
        assert seen._metrics == []
        seen._metrics.append({"done": 0.0, "length": 0.0, "a": 3.0})
        assert TorchEnvironment.take_metrics(seen) == {"a": 3.0, "episode/length_s": 0.0}


class TestSweep:
    @pytest.fixture
    def sweep(self) -> Any:
        from footfall.train.sweeps import sweep

        return sweep

    def test_a_sweep_counts_its_trainings(self, sweep: Any) -> None:
        space = {"a": {"grid_search": [1, 2, 3]}, "b": {"uniform": [0, 1]}, "c": {"grid_search": [1, 2]}}
        assert sweep.SweepConfig(space, seeds=(1, 2), trials=5).points == 60
        assert sweep.SweepConfig({}).points == 1
        for wrong in ({"seeds": ()}, {"trials": 0}):
            with pytest.raises(ValueError, match=r"empty|at least 1"):
                sweep.SweepConfig({}, **wrong)

    @pytest.mark.parametrize("mode", ["min", "max"])
    def test_results_are_ranked_written_and_what_is_left_is_counted(
        self, sweep: Any, tmp_path: Path, mode: str
    ) -> None:
        config = sweep.SweepConfig(
            {"ppo.clip_param": {"grid_search": [0.1, 0.2]}}, seeds=(0, 1), trials=2, metric="m", mode=mode
        )
        grid = []
        for name, clip, seed, values, done, error in (
            ("t0", 0.1, 0, [5.0, 4.0], True, None), ("t1", 0.1, 1, [2.0], True, None), ("t2", 0.2, 0,
            [1.0], True, "a\nb"),
            ("t3", 0.2, 1, [3.5], False, None), ("t4", 0.2, 1, [], True, None), ("t5", 0.2, 0, [3.6],
            False, None),
        ):  # fmt: skip
            (tmp_path / name).mkdir()
            lines = "".join(json.dumps({"step": k, "m": value}) + "\n" for k, value in enumerate(values))
            (tmp_path / name / "metrics.jsonl").write_text(lines)
            settings = {"ppo.clip_param": clip, "seed": seed}
            metrics = {"done": done, "environment_steps": 10 * seed + 5}
            grid.append(
                SimpleNamespace(metrics=metrics, config=settings, path=f"/elsewhere/{name}", error=error)
            )
        (tmp_path / "t5" / "policy.onnx").touch()
        found = sweep._results(grid, config, tmp_path)
        good = ["t1", "t5", "t0"] if mode == "min" else ["t0", "t5", "t1"]
        assert [trial.folder for trial in found.trials[:4]] == [*good, "t4"]
        by_name = {trial.folder: trial for trial in found.trials}
        assert (by_name["t0"].value, by_name["t0"].steps, by_name["t1"].steps) == (4.5, 5, 15)
        assert {name: trial.error for name, trial in by_name.items()} == {
            "t0": "", "t1": "", "t2": "b", "t3": "unfinished", "t4": "", "t5": "",
        }  # fmt: skip
        assert by_name["t3"].settings == {"ppo.clip_param": 0.2}
        assert found.unfinished == 8 - 5
        rows = list(csv.reader((tmp_path / "results.csv").open()))
        assert rows[0] == ["folder", "seed", "ppo.clip_param", "m", "environment_steps", "error"]
        assert rows[1 + good.index("t0")] == ["t0", "0", "0.1", "4.5", "5", ""]
        points = list(csv.reader((tmp_path / "points.csv").open()))
        assert points[0] == ["ppo.clip_param", "mean m", "standard deviation", "seeds", "failed"]
        assert points[1][0] == "0.1"
        assert [float(x) for x in points[1][1:]] == pytest.approx([3.25, np.std([4.5, 2.0], ddof=1), 2, 0])
        assert points[2][0] == "0.2"
        assert [points[2][k] for k in (1, 3, 4)] == ["3.6", "1", "3"]

    def test_points_are_ranked_by_their_mean_in_the_direction_asked_for(self, sweep: Any) -> None:
        from footfall.train.sweeps.results import Trial, points_of

        trials = [Trial("f", seed, {"a": a}, 1.0 * a + seed, 1, "") for a in (3, 1, 2) for seed in (0, 1)]
        assert [(p.settings["a"], p.mean, p.seeds) for p in points_of(trials, "min")] == [
            (1, 1.5, 2), (2, 2.5, 2), (3, 3.5, 2),
        ]  # fmt: skip
        assert [p.settings["a"] for p in points_of(trials, "max")] == [3, 2, 1]

    def test_a_trial_reports_what_a_display_would_show(self, sweep: Any) -> None:
        told: list[Any] = []
        reporter = sweep._Reporter(told.append)
        reporter.update(256, 12.5, {"a": 1.0})
        reporter.update(512, 13.5, {"a": 2.0, "episode/length_s": 4.0})
        assert math.isnan(told[0].pop("episode/length_s"))
        assert told == [
            {"environment_steps": 256, "speed/steps_per_s": 12.5, "a": 1.0},
            {"environment_steps": 512, "speed/steps_per_s": 13.5, "a": 2.0, "episode/length_s": 4.0},
        ]

    def test_a_trial_is_begun_once_with_its_own_settings_and_then_resumed(
        self, sweep: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        done: list[Any] = []
        monkeypatch.setattr(sweep, "begin", done.append)
        monkeypatch.setattr(sweep, "resume", lambda folder, display: done.append((folder, display._report)))
        config, folder = sweep.SweepConfig({}, preset="smoke"), tmp_path / "t0"
        sweep._train(config, folder, {"ppo.clip_param": 0.33, "seed": 6}, "report")
        request, resumed = done
        assert (request.robot, request.seed, request.out) == ("go1", 6, folder)
        assert resumed == (folder, "report")
        assert load_preset(request.preset).ppo.clip_param == 0.33
        done.clear()
        folder.mkdir()
        (folder / "run.yaml").touch()
        sweep._train(config, folder, {"ppo.clip_param": 0.33, "seed": 6}, "report")
        assert done == [(folder, "report")]
