"""Success of a policy on fixed levels of ground: in the training environment and on the simulated robot.

    LEVELS="--scenario-file benchmarks/rough_ground.yaml"
    footfall evaluate RUN $LEVELS --scenarios high_stairs --json stairs.json
    python benchmarks/success_per_level.py RUN $LEVELS high_stairs stairs.json

In both, a robot starts in the middle and gets the scenario's first command. It succeeds if it does not fall
and covers 70 % of the commanded path. The training environment draws robots, noise and delays as in the run;
the scenario draws from the robot's own. So they differ in more than the contacts, unless `--same-robots` lets
the training environment draw robots, noise and errors of height scans as the scenario does.
`--exact-friction` gives feet the simulated robot's friction cone. A second table has the training
environment's successes by the friction that was drawn.
"""

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table
from teacher_student import action_of

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import randomisation_of
from footfall.envs.batch import step_batch
from footfall.envs.config import EnvConfig, TerrainConfig
from footfall.envs.make import make_environment
from footfall.envs.terrain import KEY
from footfall.evaluate.metrics import SUCCESS_PROGRESS
from footfall.evaluate.scenarios import GROUND_LEVELS, Scenario, ScenarioFile, load_scenarios
from footfall.evaluate.scenarios import at_level as ground_at_level
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot, load_robot
from footfall.train.config import read_config
from footfall.train.origin import Exported, read_exported

FRICTION_RANGES = (0.0, 0.466, 0.5, 0.55, 0.6, 0.7, 2.0)  # a slope of 25 degrees needs 0.466
SETTLED_S = 0.5  # end of the episode, in which the environment would begin the next one


def at_level(config: EnvConfig, scenario: Scenario, level: dict[str, float]) -> EnvConfig:
    """The training environment on the scenario's ground only, at its first command, without pushes.

    Args:
        config: the training environment of the run.
        scenario: a scenario with a ground.
        level: value of a parameter of the ground, or of a drawn quantity, which it fixes.
    """
    assert scenario.ground is not None
    assert config.terrain is not None
    ground = ground_at_level(scenario.ground, level)
    fixed = {name: Distribution(value, value) for name, value in level.items() if name not in GROUND_LEVELS}
    terrain: TerrainConfig = replace(
        config.terrain, grounds=(ground,), levels=2, start_levels=1, spread_m=0.0
    )
    command = scenario.script[0]
    axes = ("forward_m_s", "leftward_m_s", "yaw_rad_s")
    ranges = CommandRange(**{axis: (getattr(command, axis) or 0.0,) * 2 for axis in axes})
    commands = replace(
        config.commands,
        ranges=ranges,
        hold_s=Distribution(2 * scenario.duration_s, 2 * scenario.duration_s),
        standing_probability=0.0,
        single_axis_probability=0.0,
    )
    return replace(
        config,
        randomisation=replace(config.randomisation, **fixed),
        terrain=terrain,
        commands=commands,
        events=tuple(event for event in config.events if event.term != "push"),
        curricula=(),
        episode_s=scenario.duration_s + SETTLED_S,
    )


def as_drawn(config: EnvConfig, robot: Robot, file: ScenarioFile) -> EnvConfig:
    """The training environment with the robots, the noise and the height scans of a scenario file."""
    return replace(
        config,
        randomisation=randomisation_of(robot),
        noise=file.noise,
        height_scan_errors=file.height_scan_errors,
    )


class Successes(NamedTuple):
    """Robots in the training environment."""

    succeeded: np.ndarray  # (robots,)
    friction: np.ndarray  # (robots,), drawn


def successes(
    robot: Robot, config: EnvConfig, policy: Exported, duration_s: float, count: int, seed: int
) -> Successes:
    """Which of `count` robots succeed in the training environment."""
    env: Any = make_environment(robot, config)
    steps = round(duration_s * config.control_rate_hz)

    @jax.jit
    def run(keys: jax.Array) -> tuple[jax.Array, jax.Array]:
        state, observation = jax.vmap(env.reset)(keys)
        friction = state.sample["friction"]

        def step(carry: Any, _: None) -> tuple[Any, None]:
            state, observation, fell = carry
            with jax.default_matmul_precision("highest"):
                action = action_of(policy, observation["state"])
            state, observation, outcome = step_batch(env, state, action)
            return (state, observation, fell | (outcome.terminated > 0)), None

        start = state, observation, jnp.zeros(count, bool)
        (state, _, fell), _ = jax.lax.scan(step, start, None, length=steps)
        walked = state.terms[KEY][KEY]
        return ~fell & (walked.along >= SUCCESS_PROGRESS * walked.commanded), friction

    succeeded, friction = run(jax.random.split(jax.random.PRNGKey(seed), count))
    return Successes(np.asarray(succeeded), np.asarray(friction).reshape(count))


def by_friction(found: Successes) -> list[str]:
    """Successes of the robots in each of `FRICTION_RANGES`."""
    cells = []
    for low, high in itertools.pairwise(FRICTION_RANGES):
        in_range = found.succeeded[(found.friction >= low) & (found.friction < high)]
        cells.append(f"{in_range.sum()} of {in_range.size}")
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="run folder, or a policy's folder in policies/zoo/")
    parser.add_argument("scenario")
    parser.add_argument("results", type=Path, help="JSON file of footfall evaluate")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--scenario-file", type=Path, required=True)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--same-robots", action="store_true", help="drawn as the scenario does")
    parser.add_argument(
        "--exact-friction", action="store_true", help="the friction cone of the simulated robot"
    )
    options = parser.parse_args()
    robot, config = load_robot(options.robot), read_config(options.run / "config.yaml").env
    file = load_scenarios(robot, options.scenario_file)
    scenario = file.scenarios[options.scenario]
    if options.same_robots:
        config = as_drawn(config, robot, file)
    if options.exact_friction and config.terrain is not None:
        config = replace(config, terrain=replace(config.terrain, exact_friction=True))
    policy = read_exported(options.run / "policy.onnx")
    table = Table("level", "training environment", "simulated robot", "difference, points")
    friction_table = Table(
        "level", *(f"friction {a:g} to {b:g}" for a, b in itertools.pairwise(FRICTION_RANGES))
    )
    (name,) = scenario.rows
    for row in json.loads(options.results.read_text())["scenarios"][options.scenario]["rows"]:
        level_config = at_level(config, scenario, {name: row[name]})
        found = successes(robot, level_config, policy, scenario.duration_s, options.robots, options.seed)
        difference = row["success_rate"] - found.succeeded.mean()
        counts = (
            f"{found.succeeded.sum()} of {options.robots}",
            f"{row['successes']} of {row['episodes']}",
        )
        table.add_row(f"{name} {row[name]:g}", *counts, f"{100 * difference:+.0f}")
        friction_table.add_row(f"{name} {row[name]:g}", *by_friction(found))
    Console(width=120).print(table, friction_table)


if __name__ == "__main__":
    main()
