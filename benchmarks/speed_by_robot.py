"""How fast a policy walks in the environment that it was trained in, by what differs of its robots.

    python benchmarks/speed_by_robot.py --policy policies/zoo/go1-flat/policy.onnx --preset gpu --forward 1.5

One line for each group of randomised quantities, drawn as in training while all others are nominal: the mean
over robots of their mean forward speed after the first two seconds, its standard error, the standard
deviation between robots, and how many fell and are not counted. Nothing pushes; the physics is MuJoCo C's.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation
from footfall.envs.config import CommandConfig, EnvConfig, PushConfig
from footfall.envs.velocity import VelocityEnv
from footfall.policies.learned import open_network
from footfall.robots.commands import CommandRange
from footfall.robots.description import load_robot
from footfall.train.config import load_preset

SETTLE_S = 2.0
# What the simulated bus adds by itself: readings are a joint tick old, and frames take half a millisecond.
BUS = {"observation_delay_s": Distribution(0.002, 0.002), "action_delay_s": Distribution(0.0005, 0.0005)}
GROUPS = {
    "nothing": (),
    "friction": ("friction",),
    "bodies": ("link_mass", "payload_kg", "com_offset_m", "inertia", "armature"),
    "motors": ("joint_friction", "motor_strength", "kp", "kd", "battery"),
    "joint_damping": ("joint_damping",),
    "action_delay_s": ("action_delay_s",),
    "observation_delay_s": ("observation_delay_s",),
    "sensors": ("encoder_bias", "gyro_bias", "gravity_bias"),
    "all": tuple(QUANTITIES),
}


class SpeedResult(NamedTuple):
    """Mean speeds of the robots that stayed up, m/s, and how many fell."""

    speeds: np.ndarray
    fell: int


def main() -> None:
    """Walk each group and print its line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--policy", type=Path, default=Path("policies/zoo/go1-flat/policy.onnx"))
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--preset", default="gpu")
    parser.add_argument("--forward", type=float, default=1.5, help="m/s")
    parser.add_argument("--robots", type=int, default=96)
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    config = load_preset(options.preset, load_robot(options.robot)).env
    for name, drawn in families(config).items():
        walked = walk(straight_ahead(drawn, options.forward), options)
        between = walked.speeds.std()
        print(
            f"{name:32s} {walked.speeds.mean():.4f} ± {between / np.sqrt(len(walked.speeds)):.4f} m/s,"
            f" between robots {between:.4f}, {walked.fell} fell",
            flush=True,
        )


def families(config: EnvConfig) -> dict[str, EnvConfig]:
    """The environment by what is drawn in it: each of `GROUPS`, without noise, and three more."""
    still = replace(config, noise=Noise())
    named = {
        name: replace(
            still, randomisation=Randomisation(**{q: getattr(config.randomisation, q) for q in group})
        )
        for name, group in GROUPS.items()
    }
    return named | {
        "nothing, with the bus's delays": replace(still, randomisation=Randomisation(**BUS)),
        "all but delays, which are the bus's": replace(
            config, randomisation=replace(config.randomisation, **BUS)
        ),
        "all, with noise": config,
    }


def straight_ahead(config: EnvConfig, forward_m_s: float) -> EnvConfig:
    """The same environment where one command holds for ever and nothing pushes."""
    ranges = CommandRange((forward_m_s, forward_m_s), (0.0, 0.0), (0.0, 0.0))
    for_ever = Distribution(1e6, 1e6)
    commands = CommandConfig(ranges, for_ever, 0.0, 0.0, config.commands.standing_command)
    return replace(config, physics="c", commands=commands, pushes=PushConfig(for_ever), episode_s=1e6)


def walk(config: EnvConfig, options: argparse.Namespace) -> SpeedResult:
    """Let as many robots walk as asked for."""
    env = VelocityEnv(load_robot(options.robot), config)
    session, _ = open_network(options.policy)
    keys = jax.random.split(jax.random.key(0), options.robots)
    state, observation = jax.jit(jax.vmap(env.reset))(keys)
    step, speed = jax.jit(jax.vmap(env.step)), jax.jit(jax.vmap(env.base.linear_velocity))
    up, speeds = np.ones(options.robots, bool), []
    for index in range(round(options.seconds / env.period_s)):
        action = session.run(None, {"observation": np.asarray(observation["state"])})[0]
        state, result = step(state, action)
        observation = result.observation
        up &= np.asarray(result.terminated) == 0.0
        if index * env.period_s >= SETTLE_S:
            speeds.append(np.asarray(speed(state.qpos, state.qvel))[:, 0])
    return SpeedResult(np.mean(speeds, axis=0)[up], int((~up).sum()))


if __name__ == "__main__":
    main()
