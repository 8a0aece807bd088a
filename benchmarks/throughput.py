"""Environment steps per second of a training and of MuJoCo Playground's, in the same process.

    python benchmarks/throughput.py --preset gpu --playground --json throughput.json
    python benchmarks/throughput.py --preset gpu --physics generated mjx   # engines side by side
    python benchmarks/throughput.py --preset gpu --shares          # where the time of an iteration goes
    python benchmarks/throughput.py --preset cpu --set ppo.num_envs=128 --cases ships

PPO is measured end to end: whole iterations after compilation, waiting for each. The output has the median
and, in brackets, the slowest and the fastest iteration. "Physics alone" is the joint law and MJX
(Playground: its actuators and MJX), or another engine, without rewards, observations and resets. The
operations per second of the generated physics are printed as a share of the GPU's peak; MuJoCo needs
several times as many operations. Playground is measured by `playground.py` in this folder. An environment
step is a control step of 20 ms in both.
"""

import argparse
import functools
import itertools
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
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.engines import ENGINES
from footfall.envs.physics.generated.expression import schedule
from footfall.envs.physics.generated.substep import SINGLE, substep
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.iteration import iteration_keys
from footfall.train.brax.parts import Parts, assemble
from footfall.train.brax.rollout import roll_out
from footfall.train.config import TrainConfig
from footfall.train.sweeps.config import trial_config

PHYSICS, PPO = "physics alone", "PPO, end to end"
# Changes of each case to the preset. Playground's task has 8,192 environments and 5 steps of 4 ms.
CASES: dict[str, dict[str, Any]] = {
    "ships": {},
    "8192": {"ppo.num_envs": 8192},
    "5x4ms": {"env.substeps": 5},
    "8192-5x4ms": {"ppo.num_envs": 8192, "env.substeps": 5},
}
# Single precision without tensor cores, from NVIDIA's data sheets.
PEAK_FLOP_S = {"NVIDIA H200": 67e12, "NVIDIA H100 80GB HBM3": 67e12}
PLAYGROUND_ENVIRONMENTS = (8192, 32768)

Spread = tuple[float, float, float]  # minimum, median, maximum


def main() -> None:
    """Measure, print tables, write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--cases", help=f"{', '.join(CASES)}, joined by +; all with --playground")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="applies to every case"
    )
    parser.add_argument("--iterations", type=int, default=20)
    parser.add_argument("--physics", nargs="+", default=["generated"], choices=sorted(ENGINES))
    parser.add_argument("--shares", action="store_true", help="also measure the parts of an iteration")
    parser.add_argument("--playground", action="store_true", help="also measure Playground")
    parser.add_argument("--warp", action="store_true", help="also measure Playground's physics in Warp")
    parser.add_argument("--playground-task", default=playground.TASK, help="Playground's name of its task")
    parser.add_argument("--playground-environments", default=",".join(map(str, PLAYGROUND_ENVIRONMENTS)))
    parser.add_argument(
        "--playground-iterations", type=int, default=5, help="PPO iterations between two reports"
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    chosen = list(CASES) if options.playground else ["ships"]
    if options.cases:
        chosen = options.cases.split("+")
    results: dict[str, Any] = {
        "device": jax.devices()[0].device_kind,
        "jax": jax.__version__,
        "python": platform.python_version(),
        "preset": options.preset,
        "settings": options.set,
        "footfall": {},
        "playground": [],
    }
    try:
        common = {key: yaml.safe_load(value) for key, value in (s.split("=", 1) for s in options.set)}
        changes = {
            f"{case}, {engine}": common | CASES[case] | {"env.physics": engine}
            for engine in options.physics
            for case in chosen
        }
    except KeyError as error:
        parser.error(f"no case {error}: there are {', '.join(CASES)}, joined by +")

    def keep() -> None:
        if options.json:
            options.json.write_text(json.dumps(results, indent=2) + "\n")

    for case, settings in changes.items():
        try:
            found = measure_footfall(
                options.robot, options.preset, settings, options.iterations, options.shares
            )
        except UserError as error:
            parser.error(str(error))
        results["footfall"][case] = found
        keep()
    if options.playground:
        results["differences"] = differences(options.robot, options.preset, options.playground_task)
        counts = [int(count) for count in options.playground_environments.split(",")]
        runs = [("jax", count) for count in counts] + ([("warp", counts[0])] if options.warp else [])
        for run in runs:
            found = playground.measure(*run, options.playground_iterations, options.playground_task)
            results["playground"].append(found)
            keep()
    show(results)
    keep()


def prepared_training(
    robot: str, preset: str, settings: dict[str, Any], seed: int = 0
) -> tuple[Parts, TrainConfig, Any, Callable[[Any], Any]]:
    """Parts and settings of a training, its initial state, and its compiled iteration."""
    config = trial_config(preset, settings, load_robot(robot))
    parts = assemble(config, load_robot(robot))
    state, compiled = parts.prepare(device_mesh(config.ppo), seed, print)
    return parts, config, state, compiled


def measure_footfall(
    robot: str, preset: str, settings: dict[str, Any], iterations: int, shares: bool
) -> dict[str, Any]:
    """Steps per second of whole iterations and of their parts, and seconds until the first iteration."""
    began = time.perf_counter()
    parts, config, first, compiled = prepared_training(robot, preset, settings)
    ready_s = time.perf_counter() - began
    env, ppo = parts.env, config.ppo
    assert isinstance(env, LocomotionEnv)  # its physics is measured separately
    _, keys, _ = iteration_keys(first, ppo)
    actions = jax.random.normal(jax.random.key(0), (ppo.num_steps_per_env, ppo.num_envs, env.action_size))

    def environment(state: Any) -> Any:
        def step(episodes: Any, action: jax.Array) -> tuple[Any, jax.Array]:
            episodes, _, result = step_batch(env, episodes, action)
            return episodes, result.reward.mean()

        return jax.lax.scan(step, state.env, actions)

    def physics(state: Any) -> Any:
        def step(episodes: Any, _: None) -> tuple[Any, None]:
            with jax.default_matmul_precision("highest"):
                return jax.vmap(env.simulate)(episodes)[0], None

        return jax.lax.scan(step, state.env, None, length=ppo.num_steps_per_env)

    measured: dict[str, Callable[[Any], Any]] = {PHYSICS: physics}
    if shares:
        measured |= {
            "environment, fixed actions": environment,
            "rollout": lambda state: roll_out(env, parts.networks, ppo, state, keys),
        }
    rates = {
        name: rates_of(repeat(jax.jit(function), first, iterations), ppo.steps_per_iteration)
        for name, function in measured.items()
    }
    rates[PPO] = rates_of(iterate(compiled, first, iterations), ppo.steps_per_iteration)
    return {
        "share_of_peak": share_of_peak(env, rates[PHYSICS][1]),
        "environments": ppo.num_envs,
        "physics_steps": f"{config.env.substeps} x {1e3 * config.env.timestep_s:g} ms",
        "ready_s": ready_s,
        "steps_per_s": rates,
    }


def share_of_peak(env: LocomotionEnv, steps_per_s: float) -> float | None:
    """Operations per second of the generated physics relative to the device's peak; None if unknown."""
    peak = PEAK_FLOP_S.get(jax.devices()[0].device_kind)
    if env.engine.name != "generated" or peak is None:
        return None
    model = training_model(env.robot, env.config.timestep_s)
    step = substep(model, env.robot, {}, SINGLE)
    return len(schedule(step.results, step.fixed_inputs).step) * env.config.substeps * steps_per_s / peak


def repeat(function: Callable[[Any], Any], state: Any, count: int) -> list[float]:
    """Seconds of each call, after one call that compiles."""
    jax.block_until_ready(function(state))
    return [timed(lambda: function(state))[0] for _ in range(count)]


def iterate(compiled: Callable[[Any], Any], state: Any, count: int) -> list[float]:
    """Seconds of each iteration, after one iteration that is not timed."""
    state, *_ = compiled(state)
    seconds = []
    for _ in range(count):
        duration, (state, *_) = timed(functools.partial(compiled, state))
        seconds.append(duration)
    return seconds


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds until all results of a call are ready, and the results."""
    began = time.perf_counter()
    result = jax.block_until_ready(call())
    return time.perf_counter() - began, result


def rates_of(seconds: list[float], steps: int) -> Spread:
    """Steps per second: minimum, median, maximum."""
    return steps / max(seconds), steps / statistics.median(seconds), steps / min(seconds)


def differences(robot: str, preset: str, task: str) -> list[tuple[str, str, str]]:
    """Other differences between the two trainings: name, footfall's value, Playground's value."""
    described = load_robot(robot)
    config = trial_config(preset, {}, described)
    ppo, model = config.ppo, training_model(described, config.env.timestep_s)
    footfall_facts = {
        "physics steps": f"{config.env.substeps} x {1e3 * config.env.timestep_s:g} ms",
        "constraint rows": playground.constraint_rows(model),
        "sensors in the model": model.nsensor,
        "environments": ppo.num_envs,
        "updates of the networks": f"{ppo.num_mini_batches * ppo.num_learning_epochs} each"
        f" {ppo.steps_per_iteration:,} steps,"
        f" {ppo.num_learning_epochs} epochs",
        "steps of the recipe": f"{ppo.total_steps:,}",
        "history in the observation": f"up to {max(term.history for term in config.env.observation)} frames",
        "delays of actions and readings": "yes" if config.env.randomisation.action_delay_s else "no",
        "pushes": "yes" if any(event.term == "push" for event in config.env.events) else "no",
        "a new episode": "drawn afresh",
    }
    playground_facts = playground.facts(task)
    return [
        (name, str(value), str(playground_facts.get(name, "-"))) for name, value in footfall_facts.items()
    ]


def show(results: dict[str, Any]) -> None:
    """Print tables on the terminal."""
    console = Console(width=140)
    table = Table("", "environments", "physics", "thousand env-steps/s", box=None, title=results["device"])
    for case, found in results["footfall"].items():
        for name, rate in found["steps_per_s"].items():
            table.add_row(
                f"footfall ({case}), {name}",
                f"{found['environments']:,}",
                found["physics_steps"],
                in_thousands(rate),
            )
    for found in results["playground"]:
        label = f"Playground, {found['impl']}"
        if "failed" in found:
            table.add_row(label, f"{found['environments']:,}", "5 x 4 ms", f"not run: {found['failed']}")
            continue
        for name, rate in found["steps_per_s"].items():
            table.add_row(f"{label}, {name}", f"{found['environments']:,}", "5 x 4 ms", in_thousands(rate))
    console.print(table)
    for (case, found), playground_run in itertools.product(
        results["footfall"].items(), results["playground"]
    ):
        if "failed" in playground_run:
            continue
        name = f"{playground_run['impl']}, {playground_run['environments']:,}"
        for what in (PPO, PHYSICS):
            if what in playground_run["steps_per_s"]:
                ratio = found["steps_per_s"][what][1] / playground_run["steps_per_s"][what][1]
                print(f"footfall ({case}) over Playground ({name}), {what}: {ratio:.2f}")
    if "differences" in results:
        table = Table("what differs", "footfall", "Playground", box=None)
        for row in results["differences"]:
            table.add_row(*row)
        console.print(table)
    for case, found in results["footfall"].items():
        share = found["share_of_peak"]
        of_peak = f"; its physics alone uses {share:.1%} of the device's peak" if share else ""
        print(f"footfall ({case}) was ready to iterate after {found['ready_s']:.1f} s{of_peak}")


def in_thousands(rate: Spread) -> str:
    slowest, median, fastest = (value / 1e3 for value in rate)
    return f"{median:,.1f} [{slowest:,.1f} to {fastest:,.1f}]"


if __name__ == "__main__":
    main()
