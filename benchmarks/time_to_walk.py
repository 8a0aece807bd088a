"""Time from scratch to a walking policy: several seeds, with an empty or a filled compilation cache.

    python benchmarks/time_to_walk.py --preset cpu --seeds 5
    python benchmarks/time_to_walk.py --preset gpu-quick --seeds 4 --warm

Prints, for each seed, the seconds from the start of the command to the exported policy and to the command's
end, and how the policy then walks over the bus (scenario `walk`, 64 episodes of 10 s). With --warm, the first
seed fills the cache for the others.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def main() -> None:
    """Train, evaluate, print one line per seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--warm", action="store_true", help="share one compilation cache")
    parser.add_argument("--scenario", default="walk")
    parser.add_argument("--episodes", type=int, default=64)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seeds):
            here = Path(folder) / str(seed)
            run, figures = here / "run", here / "figures.json"
            cache = Path(folder) / "cache" if options.warm else here / "cache"
            environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(cache)}
            began = time.time()  # same clock as the files' times
            footfall(
                environment, "train", "--preset", options.preset, "--seed", seed, "--out", run,
                "--no-evaluate",
            )  # fmt: skip
            ended_s, policy_s = time.time() - began, (run / "policy.onnx").stat().st_mtime - began
            footfall(
                environment, "evaluate", run, "--scenarios", options.scenario, "--episodes", options.episodes,
                "--seed", seed, "--json", figures,
            )  # fmt: skip
            result = json.loads(figures.read_text())["scenarios"][options.scenario]
            print(
                f"seed {seed}: policy after {policy_s:.1f} s, end after {ended_s:.1f} s"
                f" ({'warm' if options.warm and seed else 'empty'} cache);"
                f" {result['falls']} of {result['episodes']} fell,"
                f" RMSE {result['lin_vel_rmse']:.3f} m/s, {result['yaw_rate_rmse']:.3f} rad/s",
                flush=True,
            )


def footfall(environment: dict[str, str], *arguments: object) -> None:
    """Run one command of the command line, without output."""
    command = [sys.executable, "-m", "footfall", *map(str, arguments)]
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
