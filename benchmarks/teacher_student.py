"""A student learns by imitation (DAgger) from one teacher that sees the ground exactly, or from two teachers.

    footfall train --preset EXACT.yaml --out runs/teacher     # `rough`, all height_scan_errors 0
    python benchmarks/teacher_student.py runs/teacher/policy.onnx --out student.onnx
    python benchmarks/teacher_student.py ROUGH.onnx --level-teacher FLAT.onnx --out student.onnx

The student starts from the teacher's network. It acts with noise in the environment of `--preset`, whose
height scans have errors and can stop. In each state its mean action is fitted to the teacher's by least
squares. A single teacher reads exact heights. With two teachers, the second gives the actions where the
ground around the robot is level and scans arrive, the first one elsewhere; both read the student's
observation. Their student has both networks side by side and a few more units; at first its actions are the
first teacher's.
"""

import argparse
import time
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from side_by_side import side_by_side

from footfall.envs.batch import step_batch
from footfall.envs.make import make_environment
from footfall.envs.state import State
from footfall.envs.terms.data import example_data
from footfall.policies.contract import Contract
from footfall.policies.height_scan import HEIGHT_SCAN
from footfall.policies.learned import open_network
from footfall.policies.observation import size_per_step, term_size
from footfall.robots.description import load_robot
from footfall.train.actor import LOGGED_OBSERVATIONS, Actor
from footfall.train.config import load_preset
from footfall.train.export import export
from footfall.train.origin import Exported, read_exported

Array = jax.Array | np.ndarray
Layers = tuple[tuple[Array, Array], ...]  # kernel and bias
STEPS, BATCHES = 8, 8  # control steps of an iteration; mini-batches of its samples
LAST_RATE = 0.01  # share of the learning rate at the end
LEVEL_SHARE = 0.07  # of the standing height: heights that differ by less are level ground
EXTRA_SHARE = 0.25  # additional units of a layer, as a share of the first teacher's
REPORTS = 10


def mean_action(layers: Layers, observed: Any) -> Any:
    """The network's output for normalised observations (k, observation): (k, n)."""
    for kernel, bias in layers[:-1]:
        observed = jax.nn.elu(observed @ kernel + bias)
    kernel, bias = layers[-1]
    return observed @ kernel + bias


def action_of(policy: Exported, observed: Array) -> jax.Array:
    """Mean actions (k, n) of a policy for its observations (k, observation)."""
    return mean_action(policy.layers, (observed - policy.mean) / policy.std)


class Student(NamedTuple):
    """The state that an iteration changes."""

    layers: Layers
    optimizer: Any
    episodes: Any  # the environments' states, and the observations for the next actions
    key: jax.Array


@dataclass(frozen=True)
class Imitation:
    """Training of a student; holds constants only."""

    env: Any
    teacher: Exported
    envs: int
    iterations: int
    noise: float  # deviation of the student's actions
    learning_rate: float
    level_weight: float  # of errors on level ground, where the second teacher gives the actions
    epochs: int  # passes over an iteration's samples

    @cached_property
    def optimizer(self) -> optax.GradientTransformation:
        """Adam with a falling learning rate."""
        steps = self.iterations * self.epochs * BATCHES
        rates = optax.cosine_decay_schedule(self.learning_rate, steps, LAST_RATE)
        return optax.chain(optax.clip_by_global_norm(1.0), optax.adam(rates))

    def first_layers(self, key: jax.Array) -> Layers:
        """The student's network before the first iteration."""
        return jax.tree.map(jnp.asarray, self.teacher.layers)

    def begin(self, seed: int) -> Student:
        """The student before the first iteration."""
        key = jax.random.PRNGKey(seed)
        layers = self.first_layers(key)
        episodes = jax.jit(jax.vmap(self.env.reset))(jax.random.split(key, self.envs))
        return Student(layers, self.optimizer.init(layers), episodes, key)

    def iterate(self, student: Student) -> tuple[Student, jax.Array]:
        """Act, then learn.

        Also returns the loss, the loss on level ground, falls per step, and the mean level.
        """
        key, steps, order = jax.random.split(student.key, 3)
        act = partial(self._control_step, student.layers)
        episodes, (samples, figures) = jax.lax.scan(act, student.episodes, jax.random.split(steps, STEPS))
        epoch = partial(self._epoch, samples=samples)
        learner = (student.layers, student.optimizer)
        learner, losses = jax.lax.scan(epoch, learner, jax.random.split(order, self.epochs))
        figures = jnp.concatenate([losses.mean(axis=(0, 1)), figures.mean(axis=0)])
        return Student(*learner, episodes, key), figures

    def teacher_action(self, state: State, observation: dict[str, jax.Array]) -> tuple[jax.Array, jax.Array]:
        """Teacher's actions, (envs, n), and whether the teacher for level ground gives them, (envs, 1)."""
        # The critic's observation begins with the student's and a frame without errors.
        contract, size = self.env.contract, self.teacher.mean.size
        points, end = term_size(contract.observation[-1], contract), size + size_per_step(contract)
        exact = observation["privileged_state"][:, end - points : end]
        observed = jnp.concatenate([observation["state"][:, : size - points], exact], axis=1)
        return action_of(self.teacher, observed), jnp.zeros((self.envs, 1), bool)

    def actor(self, student: Student) -> Actor:
        """The student on the host."""
        layers = jax.tree.map(np.asarray, student.layers)

        def act(observed: np.ndarray) -> np.ndarray:
            values = (observed - self.teacher.mean) / self.teacher.std
            for kernel, bias in layers[:-1]:  # in double precision: single precision adds to the difference
                values = values.astype(float) @ kernel + bias
                values = np.where(values > 0.0, values, np.expm1(np.minimum(values, 0.0)))
            kernel, bias = layers[-1]
            return values @ kernel + bias

        return Actor("imitation", self.teacher.mean, self.teacher.std, layers, act)

    def _control_step(self, layers: Layers, episodes: Any, key: jax.Array) -> Any:
        state, observation = episodes
        target, on_level = self.teacher_action(state, observation)
        observed = (observation["state"] - self.teacher.mean) / self.teacher.std
        action = mean_action(layers, observed)
        action += self.noise * jax.random.normal(key, action.shape)
        state, observation, step = step_batch(self.env, state, action)
        figures = jnp.stack([step.terminated.mean(), step.metrics["terrain/level"].mean()])
        return (state, observation), ((observed, target, on_level), figures)

    def _epoch(self, learner: Any, key: jax.Array, samples: Any) -> Any:
        rows = jax.random.permutation(key, self.envs).reshape(BATCHES, -1)
        batches = jax.tree.map(lambda x: x[:, rows].swapaxes(0, 1).reshape(BATCHES, -1, x.shape[-1]), samples)
        return jax.lax.scan(self._mini_batch, learner, batches)

    def _mini_batch(self, learner: Any, batch: tuple[jax.Array, jax.Array, jax.Array]) -> Any:
        observed, target, on_level = batch

        def loss(layers: Layers) -> tuple[jax.Array, jax.Array]:
            error = (mean_action(layers, observed) - target) ** 2
            figures = jnp.stack([error.mean(), error.mean(where=on_level)])
            return jnp.mean(jnp.where(on_level, self.level_weight, 1.0) * error), figures

        layers, optimizer_state = learner
        gradient, figures = jax.grad(loss, has_aux=True)(layers)
        updates, optimizer_state = self.optimizer.update(gradient, optimizer_state, layers)
        return (optax.apply_updates(layers, updates), optimizer_state), figures


@dataclass(frozen=True)
class TwoTeachers(Imitation):
    """Training by a second teacher on level ground, and by the first one elsewhere."""

    on_level: Exported
    seen: np.ndarray  # indices of the second teacher's observation in the student's

    def first_layers(self, key: jax.Array) -> Layers:
        """Both teachers' networks, and a few additional units."""
        return side_by_side(self.teacher, self.on_level, self.seen, EXTRA_SHARE, key)

    def teacher_action(self, state: State, observation: dict[str, jax.Array]) -> tuple[jax.Array, jax.Array]:
        """Teacher's actions, (envs, n), and whether the teacher for level ground gives them, (envs, 1)."""
        observed = observation["state"]
        on_level = jax.vmap(self._sees_level_ground)(state)[:, None]
        elsewhere = action_of(self.teacher, observed)
        return jnp.where(on_level, action_of(self.on_level, observed[:, self.seen]), elsewhere), on_level

    def _sees_level_ground(self, state: State) -> jax.Array:
        """Whether scans arrive, and heights around the robot differ by less than a level ground's."""
        env, height = self.env, self.env.scene.standing_height
        data = env.terrain.with_base(state, example_data(env.scene))
        leftward = jnp.stack([-data.forward[1], data.forward[0]])
        along, across = jnp.arange(-1.0, 3.0)[:, None, None], jnp.arange(-1.0, 2.0)[:, None]
        positions = data.base_position[:2] + height * (along * data.forward + across * leftward)
        errors = state.terms[HEIGHT_SCAN][HEIGHT_SCAN].errors
        without_scan = errors.useless | (state.steps * env.period_s > errors.end_s)
        return (jnp.ptp(data.ground(positions)) < LEVEL_SHARE * height) & ~without_scan


def indices_of(part: Contract, whole: Contract) -> np.ndarray:
    """Indices of a policy's observation in another one's, which has the same terms at the same scales."""
    starts, start = {}, 0
    for term in whole.observation:
        starts[term.name] = start, term.history, term.scale
        start += term.history * term_size(term, whole)
    found = []
    for term in part.observation:
        first, history, scale = starts[term.name]
        assert scale == term.scale, term.name
        assert history >= term.history, term.name
        size = term_size(term, whole)
        found.append(first + size * (history - term.history) + np.arange(size * term.history))
    return np.concatenate(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "teacher", type=Path, help="exported policy whose observation ends with a height scan"
    )
    parser.add_argument("--level-teacher", type=Path, help="exported policy for level ground")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="rough", help="preset in whose environment the student acts")
    parser.add_argument("--steps", type=int, default=200_000_000)
    parser.add_argument("--envs", type=int, default=32768)
    parser.add_argument("--noise", type=float, default=0.1, help="deviation of the student's actions")
    parser.add_argument("--learning-rate", type=float, default=5e-4)
    parser.add_argument("--level-weight", type=float, default=1.0, help="weight of errors on level ground")
    parser.add_argument("--epochs", type=int, default=3, help="passes over an iteration's samples")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    robot = load_robot(options.robot)
    env: Any = make_environment(robot, load_preset(options.preset, robot).env)
    _, contract = open_network(options.teacher)
    if contract.observation != env.contract.observation or contract.observation[-1].name != HEIGHT_SCAN:
        parser.error("the teacher's observation is not the preset's, or does not end with a height scan")
    count = max(1, options.steps // (STEPS * options.envs))
    settings = options.noise, options.learning_rate, options.level_weight, options.epochs
    common = (env, read_exported(options.teacher), options.envs, count, *settings)
    imitation = Imitation(*common)
    if options.level_teacher:
        seen = indices_of(open_network(options.level_teacher)[1], contract)
        imitation = TwoTeachers(*common, read_exported(options.level_teacher), seen)
    student, iterate, began_s = imitation.begin(options.seed), jax.jit(imitation.iterate), time.perf_counter()
    for k in range(1, count + 1):
        student, figures = iterate(student)
        if k % max(1, count // REPORTS) == 0 or k == count:
            loss, on_level, fell, level = np.asarray(figures)
            progress = f"{time.perf_counter() - began_s:.0f} s, {k * STEPS * options.envs:,} steps"
            losses = f"loss {loss:.2e}, on level ground {on_level:.2e}"
            print(f"{progress}: {losses}, falls a step {fell:.1e}, level {level:.2f}", flush=True)
    observations = np.asarray(student.episodes[1]["state"][:LOGGED_OBSERVATIONS])
    difference = export(imitation.actor(student), env.contract, observations, options.out)
    print(f"exported {options.out}; ONNX Runtime differs by at most {difference:.1e}")


if __name__ == "__main__":
    main()
