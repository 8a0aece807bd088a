"""Trains a policy as `footfall train` does, and exports it at intervals as ONNX files.

    python benchmarks/footfall_training.py --preset gpu --out kept

Run by `time_to_quality.py`. Writes one file for each policy that was kept, and `kept.json` with the seconds
since --began and the environment steps of each. Kept parameters are copied to the host between two
iterations, while the training waits; files are written at its end.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import jax
import numpy as np
from throughput import prepared_training

from footfall.train.brax.networks import actor_means_function, trained_actor
from footfall.train.export import export


def main() -> None:
    """Train, then export the saved policies."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--every", type=float, default=5.0, help="seconds between kept policies")
    parser.add_argument("--until", type=float, default=1e9, help="seconds after which to stop early")
    parser.add_argument("--began", type=float, help="start of the command, seconds since the epoch")
    options = parser.parse_args()
    began = options.began or time.time()
    parts, config, state, compiled = prepared_training(options.robot, options.preset, {}, options.seed)
    print(f"{time.time() - began:.1f} s: ready", flush=True)
    kept: list[tuple[float, int, Any]] = []
    observed: Any = None
    next_s = options.every
    for iteration in range(1, config.ppo.iterations + 1):
        state, _, observed = compiled(state)
        if iteration == config.ppo.iterations or iteration % 8 == 0:
            jax.block_until_ready(state)  # the elapsed time must include queued iterations
        elapsed = time.time() - began
        if elapsed > next_s or iteration == config.ppo.iterations:
            actor = jax.device_get((state.normalizer, state.params.policy))
            kept.append((time.time() - began, iteration * config.ppo.steps_per_iteration, actor))
            next_s = elapsed + options.every
        if elapsed > options.until:
            break
    options.out.mkdir(parents=True, exist_ok=True)
    logged = np.asarray(jax.device_get(observed))
    index, means = [], actor_means_function(parts.exact_networks)
    for time_s, steps, (normalizer, policy) in kept:
        path = options.out / f"{time_s:06.1f}.onnx"
        export(trained_actor(means, normalizer, policy), parts.env.contract, logged, path)
        index.append({"time_s": time_s, "steps": steps, "file": path.name})
    (options.out / "kept.json").write_text(json.dumps(index, indent=1) + "\n")
    print(f"{kept[-1][0]:.1f} s: {kept[-1][1]} steps, {len(kept)} policies kept", flush=True)


if __name__ == "__main__":
    main()
