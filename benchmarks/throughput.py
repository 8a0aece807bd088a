"""Environment steps per second of a training on all devices, and of MuJoCo Playground's if it is there.

    python benchmarks/throughput.py --preset gpu --set ppo.environments=32768 --set ppo.unroll=10
    python benchmarks/throughput.py --preset gpu --playground --json throughput.json

PPO is measured end to end: whole iterations after compilation, each waited for, median of them. The shares
below it are the same code with less in it: the rollout without learning, the environment with fixed actions,
the physics alone (joint law and MJX, or MuJoCo in C).

Playground is its Go1JoystickFlatTerrain with its own PPO settings, networks and randomisation, trained by
brax's own train function in this same process after ours. Its figure is taken from the wall clock between
progress reports after the first, since brax's own `training/sps` counts num_resets_per_eval epochs against
the time of one.
"""

import argparse
import functools
import importlib.util
import itertools
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import yaml
from rich.console import Console
from rich.table import Table

from envs.batch import step_batch
from robots.description import load_robot
from robots.errors import UserError
from train.parts import assemble
from train.ppo import iteration_keys, make_rollout
from train.run import Provenance, Run
from train.sweep import trial_config

PLAYGROUND_TASK = "Go1JoystickFlatTerrain"
PLAYGROUND_REPORTS = 4  # the first one contains the compilation
PLAYGROUND_ITERATIONS = 14  # between two reports and resets, as in its own 200 M step training


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
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    try:
        settings = {key: yaml.safe_load(value) for key, value in (s.split("=", 1) for s in options.set)}
        results = measure_ours(options.robot, options.preset, settings, options.iterations)
    except UserError as error:
        parser.error(str(error))
    if options.playground:
        results |= measure_playground(options.impl)
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


def measure_playground(impl: str) -> dict[str, Any]:
    """Playground's steps per second of PPO, end to end; empty where it cannot run, after saying why."""
    if importlib.util.find_spec("mujoco_playground") is None:
        print("Playground is not installed (pip install playground): no ratio")
        return {}
    if not hasattr(jax, "device_put_replicated"):  # brax still calls it; pmap takes a stacked array as well
        jax.device_put_replicated = lambda tree, devices: jax.tree.map(
            lambda leaf: jnp.stack([jnp.asarray(leaf)] * len(devices)), tree
        )
    try:
        times_and_steps = train_playground(impl)
    except Exception as error:  # someone else's program: its failure is a result, not ours
        lines = str(error).strip().splitlines()
        print(f"Playground did not run, no ratio: {type(error).__name__}: {lines[0] if lines else ''}")
        return {}
    (begun_s, _), *reports = times_and_steps
    rates = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(reports)]
    return {
        "playground": {
            "task": PLAYGROUND_TASK,
            "impl": impl,
            "first_report_s": reports[0][0] - begun_s,
            "steps_per_s": statistics.median(rates),
        }
    }


def train_playground(impl: str) -> list[tuple[float, int]]:
    """Time and environment steps at the start and at each report."""
    from brax.training.agents.ppo import networks, train
    from mujoco_playground import registry, wrapper
    from mujoco_playground.config import locomotion_params

    os.environ.setdefault("GIT_TERMINAL_PROMPT", "0")  # its assets are cloned on first use
    settings = dict(locomotion_params.brax_ppo_config(PLAYGROUND_TASK, impl))
    factory = settings.pop("network_factory")
    iteration = settings["batch_size"] * settings["num_minibatches"] * settings["unroll_length"]
    settings |= {
        "num_timesteps": PLAYGROUND_REPORTS * PLAYGROUND_ITERATIONS * iteration,
        "num_evals": PLAYGROUND_REPORTS + 1,
        "num_resets_per_eval": 1,
    }
    reports = [(time.perf_counter(), 0)]
    train.train(
        environment=registry.load(PLAYGROUND_TASK, config_overrides={"impl": impl}),
        randomization_fn=registry.get_domain_randomizer(PLAYGROUND_TASK),
        wrap_env_fn=wrapper.wrap_for_brax_training,
        network_factory=functools.partial(networks.make_ppo_networks, **factory),
        progress_fn=lambda steps, _: reports.append((time.perf_counter(), steps)),
        run_evals=False,
        max_devices_per_host=1,
        **settings,
    )
    return reports


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
