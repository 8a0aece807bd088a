"""Reward of policies in the training of another robot, without exploration noise.

    python benchmarks/reward_elsewhere.py wide wide-1 identified --robot robots_of_study/identified

All policies get the same robots, commands and pushes; each keeps its own gains. If a policy earns more in
another robot's training than the policy trained there, the training is the reason, not the robot. Rewards are
per second, at the final level of the preset's curriculum. `difference` is the mean difference from the first
policy over episodes, `deviation` its standard deviation.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from recordings.tables import table

from footfall.envs.batch import step_batch
from footfall.envs.locomotion import LocomotionEnv
from footfall.policies.contract import Contract
from footfall.policies.learned import open_network
from footfall.robots.description import Robot, load_robot
from footfall.train.config import load_preset

SHOWN = ("track_linear", "track_yaw", "gait_contact", "torque", "power", "swing_height", "slip")


def with_gains(robot: Robot, contract: Contract) -> Robot:
    """The robot with a policy's stiffness, which follows from the armature. Masses and inertias stay."""
    armature = robot.armature * np.array(contract.kp) / robot.kp
    return replace(robot, armature=armature)


def rewards(
    policy: Path, robot: Robot, preset: str, episodes: int, steps: int, seed: int
) -> dict[str, np.ndarray]:
    """Mean of each reward term and of their sum, "total", by episode, (episodes,)."""
    network, contract = open_network(policy / "policy.onnx")
    config = load_preset(preset, robot).env
    env = LocomotionEnv(with_gains(robot, contract), replace(config, physics="c"))
    step = jax.jit(lambda state, action: step_batch(env, state, action))
    keys = jax.random.split(jax.random.PRNGKey(seed), episodes)
    state, observation = jax.jit(jax.vmap(env.reset))(keys)
    sums: dict[str, np.ndarray] = {}
    for _ in range(steps):
        (action,) = network.run(None, {network.get_inputs()[0].name: np.asarray(observation["state"])})
        state, observation, result = step(state, jnp.asarray(action))
        found = {name.removeprefix("reward/"): value for name, value in result.metrics.items()}
        for name, value in (found | {"total": result.reward / env.period_s}).items():
            sums[name] = sums.get(name, 0.0) + np.asarray(value) / steps
    return sums


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("policies", type=Path, nargs="+", help="run folders")
    parser.add_argument(
        "--robot", required=True, help="name or folder of the robot in whose training the policies run"
    )
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--episodes", type=int, default=16)
    parser.add_argument("--steps", type=int, default=400, help="control steps, 50 per s")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot = load_robot(options.robot)
    rows: list[list[str]] = []
    first: np.ndarray | None = None
    for policy in options.policies:
        found = rewards(policy, robot, options.preset, options.episodes, options.steps, options.seed)
        total = found["total"]
        first = total if first is None else first
        difference = total - first
        deviation = float(np.std(difference, ddof=1) / np.sqrt(len(difference)))
        rows.append([policy.name, f"{total.mean():.3f}", f"{difference.mean():+.3f}", f"{deviation:.3f}"])
        rows[-1] += [f"{found[name].mean():.3f}" for name in SHOWN]
    print(table(["policy", "reward", "difference", "deviation", *SHOWN], rows))


if __name__ == "__main__":
    main()
