"""Switches between policies at random times of a walk: falls, and largest rate of a joint target.

    python benchmarks/policy_switches.py --robot go1 --pair go1-flat,trot --switches 100 --workers 2

Each episode walks with sensor noise, with a new random command after each switch, and switches back and
forth. Prints a JSON object: switches in each direction, falls, faults, the time from request to change, and
the largest rate of a joint target, as a share of the robot's target rate.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from footfall.deploy.command_source import Request, Status
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

SWITCHES = 10  # switches per episode
BETWEEN_S = (0.6, 1.6)  # walking time between two switches
EPISODE_TIMEOUT_S = 120.0


class Switcher:
    """Walks with random commands, and requests the other policy at random times."""

    stopped = None

    def __init__(self, names: tuple[str, str], max_command: np.ndarray, rng: np.random.Generator) -> None:
        self._names, self._max_command, self._rng = names, max_command, rng
        # From request to change, by the policy that takes over.
        self.took_s: dict[str, list[float]] = {name: [] for name in names}
        self._requested_s: float | None = None
        self._request = Request(np.zeros(3))
        self._walk(0.0, names[0])

    def poll(self, status: Status) -> Request:
        now_s = status.walking_s
        if self._requested_s is None:
            if now_s >= self._next_s:
                self._requested_s = now_s
                self._request = self._request._replace(policy=self._other)
        elif status.policy == self._other:
            self.took_s[status.policy].append(now_s - self._requested_s)
            self._walk(now_s, status.policy)
        return self._request

    @property
    def done(self) -> bool:
        return sum(map(len, self.took_s.values())) >= SWITCHES

    def _walk(self, now_s: float, policy: str) -> None:
        self._requested_s = None
        self._other = next(name for name in self._names if name != policy)
        self._next_s = now_s + self._rng.uniform(*BETWEEN_S)
        self._request = Request(self._max_command * self._rng.uniform([-0.5, -1.0, -1.0], 1.0))


def episode(
    robot_name: str, pair: tuple[str, str], max_command: tuple[float, ...], seed: int
) -> dict[str, Any]:
    """One walk with `SWITCHES` switches, or until a fall."""
    robot = load_robot(robot_name)
    first, second = (load_policy(name, robot) for name in pair)
    source = Switcher(pair, np.array(max_command), np.random.default_rng(seed))
    config = deploy_config(robot)
    max_change_rad, previous_target = 0.0, robot.default_pose

    def watch(loop: ControlLoop, _: object) -> None:
        nonlocal max_change_rad, previous_target
        if loop.walking:
            max_change_rad = max(max_change_rad, float(np.abs(loop.target - previous_target).max()))
            if source.done:
                loop.finish()
        previous_target = loop.target

    trace = run_episode(
        robot,
        first,
        Episode(
            source,
            EPISODE_TIMEOUT_S,
            seed=seed,
            noise=load_scenarios(robot).noise,
            config=replace(config, stop_s=0.0),
            others={pair[1]: second},
            record=False,
        ),
        watch,
    )
    allowed_rad = robot.description.target_rate_rad_s * config.tick_us * 1e-6
    return {
        "took_s": source.took_s,
        "fell": trace.fell,
        "faults": [*trace.faults],
        "rate_share": max_change_rad / allowed_rad,
    }


def measure(
    robot: str, pair: tuple[str, str], max_command: tuple[float, ...], switches: int, workers: int
) -> dict:
    """Switches of a pair, at least `switches` in each direction."""
    seeds = range(-(-2 * switches // SWITCHES))
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(partial(episode, robot, pair, max_command), seeds))
    took_s = {name: [time for each in found for time in each["took_s"][name]] for name in pair}
    all_times = [time for times in took_s.values() for time in times]
    return {
        "robot": robot,
        "pair": pair,
        "command": max_command,
        "switches": {f"to {name}": len(times) for name, times in took_s.items()},
        "falls": sum(each["fell"] for each in found),
        "faults": [fault for each in found for fault in each["faults"]],
        "took_s_mean": float(np.mean(all_times)),
        "took_s_max": float(np.max(all_times)),
        "target_rate_share_max": max(each["rate_share"] for each in found),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--pair", default="go1-flat,trot")
    parser.add_argument(
        "--command", default="0.5,0.2,0.5", help="largest forward, leftward m/s and yaw rad/s"
    )
    parser.add_argument("--switches", type=int, default=100, help="number in each direction")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    first, second = options.pair.split(",")
    max_command = tuple(float(part) for part in options.command.split(","))
    print(
        json.dumps(
            measure(options.robot, (first, second), max_command, options.switches, options.workers), indent=1
        )
    )


if __name__ == "__main__":
    main()
