"""Environment steps per second of each trainer on the same environment, and parts of an iteration's time.

    python benchmarks/trainers.py --preset gpu --iterations 20
    python benchmarks/trainers.py --preset cpu --trainers rsl_rl --set ppo.num_envs=128

Times whole iterations after compilation: rollout, learning, metrics. brax also runs with float32 networks, as
rsl_rl does. For rsl_rl it prints the seconds of the rollout, of its environment steps, and of learning.
Needs the extra `rsl-rl`.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import yaml

from footfall.robots.description import load_robot
from footfall.train.runs.folder import Provenance, Run
from footfall.train.sweeps.config import trial_config
from footfall.train.trainer import Trainer
from footfall.train.trainers import TRAINERS, find_trainer

SINGLE: dict[str, Any] = {"ppo.bfloat16": False}


def main() -> None:
    """Measure each trainer, print a line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--trainers", nargs="+", default=list(TRAINERS), choices=list(TRAINERS))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--iterations", type=int, default=20)
    options = parser.parse_args()
    common = {key: yaml.safe_load(value) for key, value in (s.split("=", 1) for s in options.set)}
    for name in options.trainers:
        cases = {"": common} | ({", single precision": common | SINGLE} if name == "brax" else {})
        for case, settings in cases.items():
            trainer, steps = prepared(name, options.robot, options.preset, settings)
            iteration_s, parts = measured(name, trainer, options.iterations)
            shares = "".join(f"; {part} {1e3 * seconds:.1f} ms" for part, seconds in parts.items())
            print(
                f"{name}{case}: {steps / iteration_s / 1e6:.3f} M env-steps/s,"
                f" {1e3 * iteration_s:.1f} ms an iteration of {steps:,} steps{shares}",
                flush=True,
            )


def prepared(name: str, robot: str, preset: str, settings: dict[str, Any]) -> tuple[Trainer, int]:
    """A trainer that is ready to iterate, and the environment steps of one iteration."""
    described = load_robot(robot)
    config = trial_config(preset, settings, described)
    provenance = Provenance(robot, 0, preset, name, jax.devices()[0].device_kind, "", "", {})
    trainer = find_trainer(name)(Run(Path(tempfile.mkdtemp()), provenance, config), described)
    trainer.prepare(print)
    return trainer, config.ppo.steps_per_iteration


def measured(name: str, trainer: Any, iterations: int) -> tuple[float, dict[str, float]]:
    """Median seconds of an iteration, and mean seconds of its parts if they can be separated."""
    parts: dict[str, float] = {}
    if name == "rsl_rl":
        algorithm, environment = trainer.runner.alg, trainer.environment
        algorithm.update = clocked(algorithm.update, "learning", parts)
        environment.step = clocked(environment.step, "environment", parts)
    seconds_of(trainer.iterate)
    seconds_of(trainer.iterate)
    parts.clear()
    seconds = [seconds_of(trainer.iterate) for _ in range(iterations)]
    return statistics.median(seconds), {part: total / iterations for part, total in parts.items()}


def clocked(function: Callable[..., Any], part: str, parts: dict[str, float]) -> Callable[..., Any]:
    """The function, with the sum of its seconds, including the device's, added to `parts`."""

    def call(*arguments: Any) -> Any:
        synchronise()
        began = time.perf_counter()
        result = function(*arguments)
        synchronise()
        parts[part] = parts.get(part, 0.0) + time.perf_counter() - began
        return result

    return call


def seconds_of(iterate: Callable[[], dict[str, Any]]) -> float:
    """Seconds until an iteration's metrics are ready."""
    began = time.perf_counter()
    jax.block_until_ready(iterate())
    return time.perf_counter() - began


def synchronise() -> None:
    """Wait for all computations of torch and JAX."""
    import torch

    if torch.cuda.is_available():
        torch.cuda.synchronize()


if __name__ == "__main__":
    main()
