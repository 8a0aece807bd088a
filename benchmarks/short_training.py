"""The cpu preset from nothing to a policy that walks, several seeds, each without a compilation cache.

    python benchmarks/short_training.py --seeds 5

Prints, for each seed, the seconds from the command's start to the exported policy, and how it then walks
over the bus (scenario `gentle`, 24 episodes of 10 s).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENARIO = "gentle"


def main() -> None:
    """Train, evaluate, print one line per seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=24)
    options = parser.parse_args()
    for seed in range(options.seeds):
        with tempfile.TemporaryDirectory() as folder:
            run, figures = Path(folder) / "run", Path(folder) / "figures.json"
            environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(Path(folder) / "cache")}
            began = time.monotonic()
            footfall(
                environment, "train", "--preset", options.preset, "--seed", seed, "--out", run,
                "--no-evaluate",
            )  # fmt: skip
            trained_s = time.monotonic() - began
            footfall(
                environment, "evaluate", run, "--scenarios", SCENARIO, "--episodes", options.episodes,
                "--seed", seed, "--json", figures,
            )  # fmt: skip
            total_s = time.monotonic() - began
            result = json.loads(figures.read_text())["scenarios"][SCENARIO]
        print(
            f"seed {seed}: policy after {trained_s:.0f} s, evaluated after {total_s:.0f} s;"
            f" {result['falls']} of {result['episodes']} fell,"
            f" RMSE {result['lin_vel_rmse']:.3f} m/s, {result['yaw_rate_rmse']:.3f} rad/s",
            flush=True,
        )


def footfall(environment: dict[str, str], *arguments: object) -> None:
    """Run one command of the command line, quietly."""
    command = [sys.executable, "-m", "footfall", *map(str, arguments)]
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
