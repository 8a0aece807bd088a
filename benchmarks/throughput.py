"""Environment steps per second of a training on all devices, and of MuJoCo Playground's if it is there.

    python benchmarks/throughput.py --preset gpu --set ppo.environments=32768 --set ppo.unroll=10
    python benchmarks/throughput.py --preset gpu --playground --json throughput.json

PPO is measured end to end: whole iterations after compilation, each waited for, median of them. The shares
below it are the same code with less in it: the rollout without learning, the environment with fixed actions,
the physics alone (joint law and MJX, or MuJoCo in C).

Playground is measured by `playground.py` beside this file, in this same process after ours.
"""

import argparse
import functools
import json
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import playground
import yaml
from rich.console import Console
from rich.table import Table

from footfall.common.errors import UserError
from footfall.envs.batch import step_batch
from footfall.robots.description import load_robot
from footfall.train.brax.parts import assemble
from footfall.train.brax.ppo import iteration_keys, make_rollout
from footfall.train.runs.folder import Provenance, Run
from footfall.train.sweeps.sweep import trial_config


def main() -> None:
    """Measure, print a table, write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="instead of the preset's"
    )
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--playground", action="store_true", help="measure Playground too")
    parser.add_argument("--impl", default="jax", choices=["jax", "warp"], help="Playground's physics")
    parser.add_argument(
        "--playground-iterations",
        type=int,
        default=14,  # as in its own training of 200 M steps
        help="of its PPO between two of four reports; one is enough for a slow machine",
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    try:
        settings = {key: yaml.safe_load(value) for key, value in (s.split("=", 1) for s in options.set)}
        results = measure_ours(options.robot, options.preset, settings, options.iterations)
    except UserError as error:
        parser.error(str(error))
    if options.playground:
        results |= playground.measure(options.impl, options.playground_iterations)
    show(results)
    if options.json:
        options.json.write_text(json.dumps(results, indent=2) + "\n")


def measure_ours(robot: str, preset: str, settings: dict[str, Any], iterations: int) -> dict[str, Any]:
    """Steps per second of whole iterations and of their parts, and the seconds until the first can begin."""
    config = trial_config(preset, settings)
    provenance = Provenance(robot, 0, preset, "brax", jax.devices()[0].device_kind, "", "", {})
    parts = assemble(Run(Path(), provenance, config), load_robot(robot))
    env, ppo = parts.env, config.ppo
    began = time.perf_counter()
    first, _, compiled = parts.prepare(None)
    ready_s = time.perf_counter() - began
    _, keys, _ = iteration_keys(first, ppo)
    actions = jax.random.normal(jax.random.key(0), (ppo.unroll, ppo.environments, env.action_size))

    def environment(state: Any) -> Any:
        def step(episodes: Any, action: jax.Array) -> tuple[Any, jax.Array]:
            episodes, _, result = step_batch(env, episodes, action)
            return episodes, result.reward.mean()

        return jax.lax.scan(step, state.env, actions)

    def physics(state: Any) -> Any:
        def step(episodes: Any, _: None) -> tuple[Any, None]:
            with jax.default_matmul_precision("highest"):
                return jax.vmap(env._simulate)(episodes)[0], None

        return jax.lax.scan(step, state.env, None, length=ppo.unroll)

    roll_out = make_rollout(env, parts.networks, ppo)
    shares = {
        "physics alone": lambda: repeat(jax.jit(physics), first, iterations),
        "environment, fixed actions": lambda: repeat(jax.jit(environment), first, iterations),
        "rollout": lambda: repeat(jax.jit(functools.partial(roll_out, keys=keys)), first, iterations),
    }
    rates = {name: ppo.steps_per_iteration / run() for name, run in shares.items()}
    rates["PPO, end to end"] = ppo.steps_per_iteration / iterate(compiled, first, iterations)
    return {
        "device": jax.devices()[0].device_kind,
        "jax": jax.__version__,
        "python": platform.python_version(),
        "preset": preset,
        "settings": settings,
        "environments": ppo.environments,
        "unroll": ppo.unroll,
        "ready_s": ready_s,
        "steps_per_s": rates,
    }


def repeat(function: Callable[[Any], Any], state: Any, count: int) -> float:
    """Median seconds of a call, after one that compiles."""
    jax.block_until_ready(function(state))
    return statistics.median(timed(lambda: function(state))[0] for _ in range(count))


def iterate(compiled: Callable[[Any], Any], state: Any, count: int) -> float:
    """Median seconds of an iteration that follows others."""
    state, *_ = compiled(state)
    seconds = []
    for _ in range(count):
        duration, (state, *_) = timed(functools.partial(compiled, state))
        seconds.append(duration)
    return statistics.median(seconds)


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds until all of a call's results are there, and the results."""
    began = time.perf_counter()
    result = jax.block_until_ready(call())
    return time.perf_counter() - began, result


def show(results: dict[str, Any]) -> None:
    """The table."""
    ours = results["steps_per_s"]
    table = Table(
        "env-steps/s", "", box=None, title=f"{results['device']}, {results['environments']} environments"
    )
    for name, rate in ours.items():
        table.add_row(f"footfall, {name}", f"{rate:,.0f}")
    if "playground" in results:
        theirs = results["playground"]["steps_per_s"]
        table.add_row(f"Playground ({results['playground']['impl']}), PPO end to end", f"{theirs:,.0f}")
        table.add_row("ratio", f"{ours['PPO, end to end'] / theirs:.2f}")
    Console().print(table)
    print(f"ready to iterate after {results['ready_s']:.1f} s")


if __name__ == "__main__":
    main()
