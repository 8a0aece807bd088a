"""C physics against MJX on this machine's processors: the physics, the environment, PPO's iteration.

    python benchmarks/cpu_physics.py

Both use the cpu preset's settings, each with its best batch size. Rounds of both alternate in one process, so
that other load slows both alike. A figure is the median of the rounds; a ratio is that of the medians. The
environment and PPO are first warmed up with random actions. Each round begins in the final state of the
previous one, so that episodes end and begin as in training; the share of steps that ended an episode is
printed. Run it on a quiet machine.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import footfall.gym
from footfall.envs.batch import step_batch
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.engines import ENGINES
from footfall.envs.physics.interface import Drive, Motion
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.brax.iteration import make_iteration
from footfall.train.brax.networks import make_networks
from footfall.train.brax.state import initial_state
from footfall.train.config import TrainConfig, load_preset

ROBOT = load_robot("go1")
WARM_UP = 200  # control steps after which the robots no longer fall at the same time
STD = 0.3  # of random actions
# Runs some steps; returns the number of environment steps, and how many of them ended an episode.
Round = Callable[[], tuple[int, float]]


def main() -> None:
    """Measure each level and print one line for it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--batches", type=int, nargs="+", default=[256, 1024])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--levels", nargs="+", choices=list(LEVELS), default=list(LEVELS))
    options = parser.parse_args()
    preset = load_preset("cpu")
    for name in options.levels:
        rounds = {
            (physics, batch): LEVELS[name](with_physics(preset, physics), batch)
            for physics in ENGINES
            for batch in options.batches
        }
        rates, ended = measure(rounds, options.rounds)
        best = {physics: max((r, b) for (p, b), r in rates.items() if p == physics) for physics in ENGINES}
        (c, c_batch), (mjx, mjx_batch) = best["c"], best["mjx"]
        print(
            f"{name:12s} C {c:7.0f} /s ({c_batch} robots), MJX {mjx:7.0f} /s ({mjx_batch} robots):"
            f" {c / mjx:.1f} times; {ended:.2%} of steps ended an episode",
            flush=True,
        )


def measure(rounds: dict[Any, Round], count: int) -> tuple[dict[Any, float], float]:
    """Median environment steps per second of each physics, and the share of steps that ended an episode."""
    seen: dict[Any, list[float]] = {key: [] for key in rounds}
    steps_done, episodes_ended = 0, 0.0
    for run_round in rounds.values():
        run_round()  # compiles
    for _ in range(count):
        for key, run_round in rounds.items():
            began = time.perf_counter()
            steps, ended = run_round()
            seen[key].append(steps / (time.perf_counter() - began))
            steps_done, episodes_ended = steps_done + steps, episodes_ended + ended
    return {key: statistics.median(rates) for key, rates in seen.items()}, episodes_ended / steps_done


def continued_rounds(advance: Callable[[Any], tuple[Any, Any]], state: Any, steps: int, batch: int) -> Round:
    """A function that runs one round from the final state of the previous one; a warm-up comes first.

    Args:
        advance: function of a state that returns the next state and the number of episodes that ended.
        state: the initial state.
        steps: environment steps of one call of `advance`, of all robots.
        batch: number of robots.
    """

    def run_round() -> tuple[int, float]:
        nonlocal state
        state, ended = jax.block_until_ready(advance(state))
        return steps, float(ended)

    for _ in range(math.ceil(WARM_UP * batch / steps)):
        run_round()
    return run_round


def with_physics(preset: TrainConfig, physics: Any) -> TrainConfig:
    return replace(preset, env=replace(preset.env, physics=physics))


def physics_alone(config: TrainConfig, batch: int, calls: int = 20) -> Round:
    """Robots that hold poses near the default one."""
    substeps = config.env.substeps
    model = training_model(ROBOT, config.env.timestep_s)
    simulate = jax.vmap(ENGINES[config.env.physics](model, ROBOT))
    state, _ = begin(LocomotionEnv(ROBOT, config.env), batch)

    def batched(values: np.ndarray) -> jax.Array:
        return jnp.tile(jnp.asarray(values, jnp.float32), (batch, 1))

    target = jnp.repeat(state.target[:, None], substeps, axis=1)
    bias = jnp.zeros_like(state.target)
    drive = Drive(target, batched(ROBOT.kp), batched(ROBOT.kd), jax.tree.map(batched, ROBOT.motor), bias)

    @jax.jit
    def roll_out(motion: Motion) -> Motion:
        step = lambda motion, _: (simulate(motion, drive, state.fields)[0], None)  # noqa: E731
        return jax.lax.scan(step, motion, None, calls)[0]

    motion = Motion(state.qpos, state.qvel, state.qacc_warmstart)

    def run_round() -> tuple[int, float]:
        jax.block_until_ready(roll_out(motion))
        return batch * calls, 0.0

    return run_round


def environment(config: TrainConfig, batch: int, calls: int = 20) -> Round:
    """Steps and restarts of episodes, with random actions, in one compiled program."""
    env = LocomotionEnv(ROBOT, config.env)
    state, _ = begin(env, batch)

    @jax.jit
    def roll_out(state: Any, key: jax.Array) -> Any:
        def step(state: Any, key: jax.Array) -> tuple[Any, Any]:
            action = STD * jax.random.normal(key, (batch, env.action_size))
            state, _, result = step_batch(env, state, action)
            return state, (
                result.metrics["done"].sum(),
                result.reward.sum(),
                result.observation["state"].sum(),
            )

        return jax.lax.scan(step, state, jax.random.split(key, calls))

    def advance(state_and_round: tuple[Any, int]) -> Any:
        state, k = state_and_round
        state, (done, *_) = roll_out(state, jax.random.PRNGKey(k))
        return (state, k + 1), done.sum()

    return continued_rounds(advance, (state, 0), batch * calls, batch)


def gymnasium_vector(config: TrainConfig, batch: int, calls: int = 20) -> Round:
    """Environment steps through gymnasium's vector interface, step by step from Python."""
    env = footfall.gym.make_vector("go1", batch, physics=config.env.physics)
    env.reset(seed=0)
    generator = np.random.default_rng(0)

    def roll_out(nothing: None) -> tuple[None, int]:  # the state is the environment's own
        done = 0
        for action in generator.normal(0.0, STD, (calls, batch, len(ROBOT.joint_names))):
            _, _, terminated, truncated, _ = env.step(action)
            done += int(np.count_nonzero(terminated | truncated))
        return nothing, done

    return continued_rounds(roll_out, None, batch * calls, batch)


def ppo(config: TrainConfig, batch: int) -> Round:
    """Whole iterations: acting and learning."""
    config = replace(config, ppo=replace(config.ppo, num_envs=batch))
    env = LocomotionEnv(ROBOT, config.env)
    networks = make_networks(env.observation_sizes, env.action_size, config.ppo)
    iterate = jax.jit(make_iteration(env, networks, config.ppo))

    def advance(state: Any) -> Any:
        state, *_ = iterate(state)
        ended = state.env.steps < config.ppo.num_steps_per_env  # an episode that ended twice counts once
        return state, jnp.sum(ended)

    state = jax.jit(lambda: initial_state(env, networks, config.ppo, 0))()
    return continued_rounds(advance, state, config.ppo.steps_per_iteration, batch)


def begin(env: LocomotionEnv, batch: int) -> Any:
    return jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), batch))


LEVELS = {
    "physics": physics_alone,
    "environment": environment,
    "gymnasium": gymnasium_vector,
    "PPO": ppo,
}

if __name__ == "__main__":
    main()
