"""Time from scratch to a walking policy: several seeds, with an empty or a filled compilation cache.

    python benchmarks/time_to_walk.py --preset cpu --seeds 5
    python benchmarks/time_to_walk.py --preset gpu-quick --seeds 4 --warm
    python benchmarks/time_to_walk.py --preset gpu --first 1 --seeds 1 --checks go1

Prints, for each seed, the seconds from the start of the command to the exported policy and to the command's
end, and how many checks of `walking.yaml` the policy then passes over the bus. With --warm, the
first seed fills the cache for the others.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from footfall.evaluate.requirements import outcomes_of, parse_requirements
from footfall.robots.default import DEFAULT_ROBOT

LISTS = yaml.safe_load(Path(__file__).with_name("walking.yaml").read_text())
SEED = 0  # of every evaluation, so that all policies have the same commands


def main() -> None:
    """Train, evaluate, print one line per seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds")
    parser.add_argument("--warm", action="store_true", help="share one compilation cache")
    parser.add_argument("--robot", default=DEFAULT_ROBOT)
    parser.add_argument("--checks", default="walks", choices=list(LISTS), help="list of checks")
    options = parser.parse_args()
    checks = LISTS[options.checks]
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.seeds):
            seed_folder = Path(folder) / str(seed)
            run, cache = seed_folder / "run", (Path(folder) if options.warm else seed_folder) / "cache"
            environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(cache)}
            began = time.time()  # same clock as the files' times
            footfall(
                environment, "train", "--robot", options.robot, "--preset", options.preset, "--seed", seed,
                "--out", run, "--no-evaluate",
            )  # fmt: skip
            ended_s, policy_s = time.time() - began, (run / "policy.onnx").stat().st_mtime - began
            print(
                f"seed {seed}: policy after {policy_s:.1f} s, end after {ended_s:.1f} s"
                f" ({'warm' if options.warm and seed > options.first else 'empty'} cache);"
                f" {'; '.join(checked(run, options.robot, checks))}",
                flush=True,
            )


def checked(run: Path, robot: str, checks: dict[str, Any]) -> Iterator[str]:
    """Number of checks that a run's policy passes, and each checked figure; a failed check is marked."""
    results: dict[str, Any] = {}
    for scenario, episodes in checks["episodes"].items():
        file = run / f"{scenario}.json"
        footfall(
            os.environ, "evaluate", run, "--robot", robot, "--scenarios", scenario, "--episodes", episodes,
            "--seed", SEED, "--json", file,
        )  # fmt: skip
        results |= json.loads(file.read_text())["scenarios"]
    requirements = parse_requirements(checks["checks"], list(results))
    outcomes = outcomes_of(requirements, {run.name: {"scenarios": results}})
    yield f"{sum(outcome.met for outcome in outcomes)} of {len(outcomes)} checks met"
    for outcome in outcomes:
        yield f"{'' if outcome.met else 'NOT MET: '}{outcome.line.removeprefix(f'{run.name}: ')}"


def footfall(environment: Mapping[str, str], *arguments: object) -> None:
    """Run one command of the command line, without output."""
    command = [sys.executable, "-m", "footfall", *map(str, arguments)]
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
