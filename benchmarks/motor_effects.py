"""Cost of the optional motor effects: rate with all of them over the rate without, in CPU time.

python benchmarks/motor_effects.py
"""

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median

import jax
import numpy as np

from footfall import load_policy, load_robot
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.domain_rand.sample import draw
from footfall.envs.locomotion import LocomotionEnv
from footfall.plant.episode import Episode, run_episode
from footfall.robots.model import plant_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
EFFECTS = {
    "torque_lag_s": Distribution(0.001, 0.006),
    "stribeck_friction": Distribution(0.1, 0.4),
    "load_friction": Distribution(0.02, 0.1),
    "backlash_rad": Distribution(0.001, 0.005),
    "gear_compliance": Distribution(0.001, 0.004),
}
ENVIRONMENTS, STEPS, WALK_S, REPEATS = 512, 20, 3.0, 5


def training(with_effects: bool) -> Callable[[], None]:
    """Environment steps of the preset `cpu`, compiled, without learning."""
    config = load_preset("cpu").env
    randomisation = replace(config.randomisation, **EFFECTS) if with_effects else config.randomisation
    env = LocomotionEnv(ROBOT, replace(config, randomisation=randomisation))
    start = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), ENVIRONMENTS))[0]
    action = 0.3 * jax.random.normal(jax.random.PRNGKey(1), (ENVIRONMENTS, len(ROBOT.joint_names)))
    step = jax.jit(jax.vmap(env.step))

    def run_steps() -> None:
        state = start
        for _ in range(STEPS):
            state, _ = step(state, action)
        jax.block_until_ready(state.qpos)

    return run_steps


def lockstep(with_effects: bool) -> Callable[[], None]:
    """A walk of `go1-flat` on the simulated robot, over the bus."""
    bodies = plant_model(ROBOT).nbody - 1
    family, rng = Randomisation(**(EFFECTS if with_effects else {})), np.random.default_rng(0)
    sample = draw(family, rng.random, len(ROBOT.joint_names), bodies)
    policy = load_policy("go1-flat", ROBOT)

    def walk() -> None:
        run_episode(ROBOT, policy, Episode(lambda _: np.array([0.5, 0.0, 0.0]), WALK_S, sample=sample))

    return walk


def main() -> None:
    for name, case in (("training", training), ("lockstep", lockstep)):
        without, with_effects = case(False), case(True)
        seconds: dict[Callable[[], None], list[float]] = {without: [], with_effects: []}
        for run in (without, with_effects) * (REPEATS + 1):
            began = time.process_time()
            run()
            seconds[run].append(time.process_time() - began)
        ratio = median(seconds[without][1:]) / median(seconds[with_effects][1:])  # the first one compiles
        print(f"{name}: {ratio:.2f} of the rate without effects")


if __name__ == "__main__":
    main()
