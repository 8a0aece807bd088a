"""How each gait walks: five metres straight ahead, and round a rectangle steered by the robot's own odometry.

    python benchmarks/gait_walks.py --workers 16 --out gait_walks.jsonl

Every gait of every robot, over the simulated bus with the scenarios' sensor noise. The straight walk is told
a velocity and nothing else; what it drifts is the gait's. On the rectangle, 2 by 1 m, a path follower that
sees the estimator's pose alone walks along each side and turns at each corner; what counts is how far from
its start the robot really stands at the end. Prints a table.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from resumable_runs import run_resumable

from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, Watch, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.trace import Trace
from footfall.policies.controllers.walk import Walk
from footfall.policies.policy import Policy, PolicyInput
from footfall.policies.registry import load_policy, walking_controllers
from footfall.robots.actuator import JointCommand
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot, available_robots, load_robot

WAY_M = 5.0
CORNERS = ((2.0, 0.0), (2.0, 1.0), (0.0, 1.0), (0.0, 0.0))
SHARE = 0.5  # of the robot's highest commands
LONGEST_S = 400.0
NEAR_M, NEAR_RAD = 0.01, 0.04  # where a side and a turn have ended
STAND_S = 3.0  # at the end, so that the gait comes to rest


class Trial(NamedTuple):
    """One walk."""

    robot: str
    gait: str
    course: str  # straight or rectangle
    seed: int


class PathFollower:
    """Steers along the sides of a polygon that begins at the origin, by an estimated pose."""

    def __init__(self, commands: CommandRange) -> None:
        self._ahead, self._turn = SHARE * commands.forward_m_s[1], SHARE * commands.yaw_rad_s[1]
        self._from, self._to = (0.0, 0.0), list(CORNERS)
        self._turns = False
        self.done = False

    def command(self, x: float, y: float, yaw: float) -> np.ndarray:
        """Velocity (3,) at a pose, m and rad."""
        if not self._to:
            self.done = True
            return np.zeros(3)
        (from_x, from_y), (to_x, to_y) = self._from, self._to[0]
        side = math.hypot(to_x - from_x, to_y - from_y)
        along_x, along_y = (to_x - from_x) / side, (to_y - from_y) / side
        left_m = (to_x - x) * along_x + (to_y - y) * along_y
        beside_m = (y - from_y) * along_x - (x - from_x) * along_y
        off = wrap_angle(math.atan2(along_y, along_x) - yaw)
        if self._turns:
            if abs(off) > NEAR_RAD:
                return np.array([0.0, 0.0, math.copysign(self._slowly(self._turn, 1.5 * abs(off)), off)])
            self._turns = False
        if left_m < NEAR_M:
            self._from, self._turns = self._to.pop(0), True
            return self.command(x, y, yaw)
        turn = off - min(max(2.0 * beside_m, -0.4), 0.4)
        return np.array(
            [
                self._slowly(self._ahead, 1.5 * left_m),
                0.0,
                min(max(1.5 * turn, -self._turn), self._turn),
            ]
        )

    @staticmethod
    def _slowly(most: float, wanted: float) -> float:
        return min(most, max(0.4 * most, wanted))


class PathFollowingPolicy:
    """A policy whose commands come from a path follower, by the pose that its own estimator works out."""

    contract = None
    needs_estimate = False

    def __init__(self, inner: Policy, robot: Robot, follower: PathFollower) -> None:
        self.name, self.rate_hz = inner.name, inner.rate_hz
        self._inner, self._follower, self._estimator = inner, follower, BaseEstimator(robot)
        self._plan: np.ndarray | None = None

    @property
    def notes(self) -> list[str]:
        return list(self._inner.notes)

    def reset(self, inputs: PolicyInput) -> None:
        self._inner.reset(inputs)
        self._estimator.reset(inputs.sensed)
        self._plan = None

    def act(self, inputs: PolicyInput) -> JointCommand:
        if inputs.time_s > 0.0:
            self._estimator.update(inputs.sensed, self._plan, 1.0 / self.rate_hz)
        pose = self._estimator.odometry()
        x, y, _ = pose.position.tolist()
        told = self._inner.act(inputs._replace(command=self._follower.command(x, y, pose.yaw)))
        self._plan = self._inner.stance()
        return told

    def stance(self) -> np.ndarray | None:
        return self._inner.stance()


def walk(trial: Trial) -> dict[str, Any]:
    """One walk and its figures."""
    robot = load_robot(trial.robot)
    policy = load_policy(trial.gait, robot)
    if not isinstance(policy, Walk):
        raise TypeError(f"{trial.gait} is no gait of the generator")
    course = _straight if trial.course == "straight" else _rectangle
    return {**trial._asdict(), **course(robot, policy, load_scenarios(robot).noise, trial.seed)}


def _straight(robot: Robot, policy: Walk, noise: Any, seed: int) -> dict[str, Any]:
    ahead = np.array([SHARE * robot.description.commands.forward_m_s[1], 0.0, 0.0])
    start: list[float] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if not loop.walking or loop.now_us % 100_000:
            return
        x = float(body.truth().base_position[0])
        if not start:
            start.append(x)
        if x - start[0] >= WAY_M:
            loop.finish()

    trace = _run(robot, policy, noise, seed, lambda _: ahead, watch)
    went, turned = _moved(trace)
    height = trace.base_position[:, 2]
    late = len(height) // 4
    return {
        "fell": trace.fell,
        "faults": list(trace.faults),
        "notes": list(trace.notes),
        "way_m": float(went[0]),
        "speed_m_s": float(went[0] / max(trace.time_s[-1], 1e-9)),
        "sideways_percent": 100.0 * float(abs(went[1])) / max(float(went[0]), 1e-9),
        "turned_deg": math.degrees(abs(turned)),
        "lowest_m": float(height[late:].min()),
        "sunk_m": float(height[late : 2 * late].mean() - height[-late:].mean()) if late else 0.0,
    }


def _rectangle(robot: Robot, policy: Walk, noise: Any, seed: int) -> dict[str, Any]:
    follower = PathFollower(robot.description.commands)
    done_us: list[int] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if follower.done and not done_us:
            done_us.append(loop.now_us)
        if done_us and loop.now_us > done_us[0] + 1e6 * STAND_S:
            loop.finish()

    trace = _run(
        robot, PathFollowingPolicy(policy, robot, follower), noise, seed, lambda _: np.zeros(3), watch
    )
    went, turned = _moved(trace)
    return {
        "fell": trace.fell,
        "faults": list(trace.faults),
        "came_round": follower.done,
        "lap_s": float(trace.time_s[-1] - STAND_S),
        "closing_m": float(np.hypot(went[0], went[1])),
        "turned_deg": math.degrees(wrap_angle(turned)),
    }


def _run(robot: Robot, policy: Policy, noise: Any, seed: int, command: Any, watch: Watch) -> Trace:
    episode = Episode(
        command_source=command, duration_s=LONGEST_S, seed=seed, noise=noise, record_rate_hz=20.0
    )
    return run_episode(robot, policy, episode, watch)


def _moved(trace: Trace) -> tuple[np.ndarray, float]:
    """Displacement (3,) m in the frame of the start, and how far it has turned in all, rad."""
    yaw = np.unwrap([float(heading(quaternion)) for quaternion in trace.base_quaternion])
    return heading_matrix(-yaw[0]) @ (trace.base_position[-1] - trace.base_position[0]), yaw[-1] - yaw[0]


def table(walks: list[dict[str, Any]]) -> Iterator[str]:
    """A row for each gait, in Markdown."""
    yield (
        "| robot | gait | falls | speed, m/s | sideways, % of 5 m: median, worst | turned, degrees: worst |"
        " lowest base, m | sunk, m: worst | rectangle closes, m: median, worst | lap, s |"
    )
    yield "|" + " --- |" * 10
    for robot, gait in dict.fromkeys((walk["robot"], walk["gait"]) for walk in walks):
        own = [walk for walk in walks if (walk["robot"], walk["gait"]) == (robot, gait)]
        straight = [walk for walk in own if walk["course"] == "straight"]
        round_ = [walk for walk in own if walk["course"] == "rectangle"]
        closing = [walk["closing_m"] if walk["came_round"] else math.inf for walk in round_]
        yield (
            f"| {robot} | {gait} | {sum(walk['fell'] for walk in own)} of {len(own)} |"
            f" {_median(straight, 'speed_m_s'):.3f} |"
            f" {_median(straight, 'sideways_percent'):.1f}, {_worst(straight, 'sideways_percent'):.1f} |"
            f" {_worst(straight, 'turned_deg'):.1f} |"
            f" {min((walk['lowest_m'] for walk in straight), default=math.nan):.3f} |"
            f" {_worst(straight, 'sunk_m'):.3f} |"
            f" {np.median(closing) if closing else math.nan:.3f}, {max(closing, default=math.nan):.3f} |"
            f" {_median(round_, 'lap_s'):.0f} |"
        )


def _median(walks: list[dict[str, Any]], key: str) -> float:
    return float(np.median([walk[key] for walk in walks])) if walks else math.nan


def _worst(walks: list[dict[str, Any]], key: str) -> float:
    return max((walk[key] for walk in walks), default=math.nan)


def _gaits(name: str) -> list[str]:
    robot = load_robot(name)
    return [each for each in walking_controllers(robot) if isinstance(load_policy(each, robot), Walk)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default=",".join(available_robots()))
    parser.add_argument("--gaits", default="", help="A,B: these only, of those that each robot has")
    parser.add_argument("--courses", default="straight,rectangle")
    parser.add_argument("--seeds", type=int, default=5, help="walks of each kind")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file that keeps every walk; those in it are not run again")
    parser.add_argument("--time-limit", type=float, help="seconds until no walk begins")
    options = parser.parse_args()
    wanted = [name for name in options.gaits.split(",") if name]
    trials = [
        Trial(robot, gait, course, seed)
        for robot in options.robots.split(",")
        for gait in _gaits(robot)
        if not wanted or gait in wanted
        for course in options.courses.split(",")
        for seed in range(options.seeds)
    ]
    walks, errors = run_resumable(walk, trials, options.out, options.workers, options.time_limit)
    for line in [*table(walks), *errors]:
        print(line)


if __name__ == "__main__":
    main()
