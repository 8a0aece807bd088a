"""Training speed by number of devices, each with the preset's environments (weak scaling).

    python benchmarks/scaling.py --preset gpu --devices 1,2,4 --json scaling.json

Prints environment steps per second of whole PPO iterations, and the efficiency: the speed per device relative
to that of the first count. Iterations overlap as in a training, which reads the metrics of one iteration
while the next is computed. Otherwise several devices would wait for the host between iterations.
"""

import argparse
import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
from throughput import Spread, rates_of, timed

from footfall.robots.description import load_robot
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.parts import assemble
from footfall.train.config import load_preset


def main() -> None:
    """Measure, print a line for each number of devices, write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--devices", default="1,2,4")
    parser.add_argument("--iterations", type=int, default=20, help="PPO iterations of each measurement")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    counts = [int(count) for count in options.devices.split(",")]
    if max(counts) > jax.device_count():
        parser.error(f"this machine has {jax.device_count()} devices, not {max(counts)}")
    results: list[dict[str, float]] = []
    for count in counts:
        slowest, rate, fastest = steps_per_s(options, count)
        first = results[0] if results else {"devices": count, "steps_per_s": rate}
        efficiency = rate / count / (first["steps_per_s"] / first["devices"])
        results.append(
            {
                "devices": count,
                "steps_per_s": rate,
                "min": slowest,
                "max": fastest,
                "efficiency": efficiency,
            }
        )
        kind = jax.devices()[0].device_kind
        print(
            f"{count} x {kind}: {rate:,.0f} [{slowest:,.0f} to {fastest:,.0f}] env-steps/s,"
            f" efficiency {efficiency:.1%}",
            flush=True,
        )
    if options.json:
        content = {"device": jax.devices()[0].device_kind, "preset": options.preset, "results": results}
        options.json.write_text(json.dumps(content, indent=2) + "\n")


def steps_per_s(options: argparse.Namespace, devices: int) -> Spread:
    """Speed of whole iterations on the first few devices: minimum, median, maximum."""
    robot = load_robot(options.robot)
    config = load_preset(options.preset, robot)
    ppo = replace(config.ppo, num_envs=config.ppo.num_envs * devices)
    parts = assemble(replace(config, ppo=ppo), robot)
    state, compiled = parts.prepare(device_mesh(ppo, devices), 0, print)

    def iterate(state: Any) -> Any:
        for _ in range(options.iterations):
            state, *_ = compiled(state)
        return state

    seconds = []
    for _ in range(1 + options.repeats):
        took_s, state = timed(partial(iterate, state))
        seconds.append(took_s / options.iterations)
    return rates_of(seconds[1:], ppo.steps_per_iteration)  # the first repeat is slower


if __name__ == "__main__":
    main()
