"""Trains MuJoCo Playground's Go1 with its own settings and keeps intermediate policies.

    python benchmarks/playground_training.py --out playground.npz

Run by `time_to_quality.py`. For each kept policy, the file has the seconds since --began, the environment
steps, and the actor: mean and standard deviation of the observation, kernels and biases.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import playground


def main() -> None:
    """Train; write the policies at the end, so that the training does not wait for files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--impl", default="jax", choices=["jax", "warp"])
    parser.add_argument("--began", type=float, help="start of the command, seconds since the epoch")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=NUMBER", help="changed setting")
    options = parser.parse_args()
    began = options.began or time.time()
    playground.supply_device_put_replicated()
    settings = playground.ppo_settings(options.impl)
    settings |= {key: int(value) for key, value in (item.split("=") for item in options.set)}
    kept: list[tuple[float, int, Any]] = []

    def keep(steps: int, _: Any, params: Any) -> None:
        kept.append((time.time() - began, steps, [np.asarray(leaf) for leaf in actor_arrays(params)]))
        print(f"{kept[-1][0]:.1f} s: {steps} steps", flush=True)

    with playground.placeholder_meshes():
        playground.run_brax(options.impl, settings, keep)
        facts = task_facts(options.impl)
    arrays = {f"{index}/{part}": a for index, (*_, actor) in enumerate(kept) for part, a in enumerate(actor)}
    np.savez(options.out, time_s=[k[0] for k in kept], steps=[k[1] for k in kept], **facts, **arrays)


def task_facts(impl: str) -> dict[str, Any]:
    """Settings that the actor assumes: joints in its order, default pose, gains, action scale."""
    from mujoco_playground import registry

    env = registry.load(playground.TASK, config_overrides={"impl": impl})
    model, config = env.mj_model, registry.get_default_config(playground.TASK)
    return {
        "joints": [model.joint(i).name for i in range(1, model.njnt)],
        "default_pose": model.keyframe("home").qpos[7:],
        "kp": config.Kp,
        "kd": config.Kd,
        "action_scale": config.action_scale,
    }


def actor_arrays(params: Any) -> list[Any]:
    """Mean and deviation of the observation, then kernel and bias of each layer."""
    normalizer, policy, _ = params
    layers = policy["params"]
    found = [normalizer.mean["state"], normalizer.std["state"]]
    for index in range(len(layers)):
        layer = layers[f"hidden_{index}"]
        found += [layer["kernel"], layer["bias"]]
    return found


if __name__ == "__main__":
    main()
