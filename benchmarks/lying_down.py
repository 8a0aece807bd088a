"""How a robot lies down after its policy fails while walking: on its belly, or on its back.

    python benchmarks/lying_down.py --policy go1-flat --speed 1.8 --seeds 20
    python benchmarks/lying_down.py --speed 1.8 --set sink_share=0.0 sink_rate_rad_s=8.0

Runs in lockstep, with sensor noise. From a random time on, the policy's targets are NaN.
"""

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from footfall.common.rotations import tilt
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.domain_rand.noise import Noise
from footfall.plant.episode import Episode, run_episode
from footfall.plant.injection import InjectingPolicy
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import load_robot

NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)
FAILS_S = (1.2, 1.7)  # walking time at which the policy fails, after the robot has reached its speed
LEVEL_RAD = 0.3  # largest tilt of a base that lies on its belly


class Watch:
    """Makes the policy fail at a given time, and measures the base's motion afterwards."""

    def __init__(self, policy: InjectingPolicy, at_s: float) -> None:
        self._policy, self._at_s = policy, at_s
        self.max_tilt = self.last_tilt = self.speed = 0.0
        # Downward speed of the base at its first contact with the ground.
        self.touched_m_s: float | None = None
        self._descent_m_s = 0.0

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        qpos, qvel = body.data.qpos, body.data.qvel
        if (
            loop.state.mode is Mode.WALKING
            and loop.walking_s >= self._at_s
            and self._policy.change_decision is None
        ):
            self._policy.change_decision = _nan_targets
            self.speed = float(np.hypot(*qvel[:2]))
        if loop.state.faults:
            self.last_tilt = tilt(qpos[3:7])
            self.max_tilt = max(self.max_tilt, self.last_tilt)
            if self.touched_m_s is None and body.fall() == "the base touched the ground":
                self.touched_m_s = self._descent_m_s
        self._descent_m_s = -float(qvel[2])


def _nan_targets(command: JointCommand) -> JointCommand:
    return command._replace(position=command.position * np.nan)


def run(robot_name: str, policy_name: str, speed: float, seed: int, changes: dict[str, float]) -> Watch:
    """One run: forward, with a small lateral velocity and yaw rate."""
    robot, rng = load_robot(robot_name), np.random.default_rng(seed)
    command = np.array([speed, rng.uniform(-0.1, 0.1), rng.uniform(-0.3, 0.3)])
    policy = InjectingPolicy(load_policy(policy_name, robot))
    watch = Watch(policy, rng.uniform(*FAILS_S))
    config = replace(deploy_config(robot), stand_s=0.6, **changes)  # type: ignore[arg-type]
    settings: dict[str, Any] = {"seed": seed, "noise": NOISE, "config": config, "lie_down": True}
    run_episode(robot, policy, Episode(lambda _: command, 5.0, record=False, **settings), watch)
    return watch


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--speed", type=float, default=1.8, help="m/s, forward")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="changed deploy settings")
    options = parser.parse_args()
    changes = {name: float(value) for name, value in (each.split("=") for each in options.set)}
    runs = [run(options.robot, options.policy, options.speed, seed, changes) for seed in range(options.seeds)]
    on_belly = sum(each.last_tilt < LEVEL_RAD for each in runs)
    touched = [each.touched_m_s for each in runs if each.touched_m_s is not None]
    print(f"{options.policy} at {np.mean([each.speed for each in runs]):.2f} m/s, {len(runs)} runs")
    print(f"  on the belly at the end: {on_belly}")
    print(f"  largest tilt, rad: {_spread([each.max_tilt for each in runs])}")
    print(f"  speed at contact, m/s: {_spread(touched)}")


def _spread(values: list[float]) -> str:
    return f"{np.median(values):.2f} in the median, {max(values):.2f} at most" if values else "none"


if __name__ == "__main__":
    main()
