"""Long runs: constant memory, no drift of time, all faults detected.

    python benchmarks/soak.py [--lockstep-minutes 60] [--wall-minutes 10] [--faults 100] [--workers 1]

First, short runs in lockstep with one fault each; its kind, joint and time are drawn from the seed. The
simulator's own fall detection is off in these runs. Then one run in real time and one in lockstep, both with
a log and changing commands.

Each run's result is written to --out when it ends. A soak that was stopped continues with the missing runs.
--time-limit ends a long run properly; it then counts with its duration so far. Prints a JSON object for each
part; exit status 1 if memory grew, time drifted, a run ended early or a fault was missed.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from resumable_runs import run_resumable

from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

MAX_GROWTH = 0.02  # relative growth of memory from the first tenth of a run to its end
MAX_DRIFT_TICKS = 2.0
NOTICED_WITHIN_S = 2.0
PAGE = 4096
WALL_CLOCK, LOCKSTEP = "wall clock", "lockstep"
MEASUREMENTS = 200  # number of measurements of memory and time in a long run


def command_at(time_s: float) -> np.ndarray:
    """Forward 0.1 to 0.7 m/s with alternating turns, so that the robot stays near its origin."""
    return np.array([0.4 + 0.3 * np.sin(0.1 * time_s), 0.0, 0.5 * np.sin(0.05 * time_s)])


class Watcher:
    """Measures memory and time during a run, and ends the run at its deadline."""

    def __init__(self, every_s: float, realtime: bool, end_s: float) -> None:
        """`end_s` is a time of `time.monotonic`."""
        self._every_us, self._next_us, self._realtime = every_s * 1e6, 0.0, realtime
        self._end_us = end_s * 1e6
        self.out_of_time = False
        self._start_us = 0.0  # wall-clock time at the loop's time 0
        self.memory_mib: list[float] = []
        self._behind_us: list[float] = []  # delay of the loop's time relative to the other clock

    def update(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Measure; to be called after each tick."""
        wall_us = time.monotonic() * 1e6
        if not self._start_us:
            self._start_us = wall_us - loop.now_us
        if wall_us > self._end_us and not self.out_of_time:
            self.out_of_time = True
            loop.finish()
        if loop.now_us < self._next_us:
            return
        self._next_us += self._every_us
        other_us = wall_us - self._start_us if self._realtime else float(body.time_us)
        self._behind_us.append(other_us - loop.now_us)
        self.memory_mib.append(int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 2**20)

    def drift_us(self) -> float:
        """Drift of the loop's clock relative to the other clock, from the first to the last tenth of the run.

        A late tick is behind the other clock, never ahead of it: so the minimum of each tenth is used.
        """
        tenth = max(len(self._behind_us) // 10, 1)
        return min(self._behind_us[-tenth:]) - min(self._behind_us[:tenth])

    def growth(self) -> float:
        """Relative growth of memory from the first tenth of the run to its end."""
        first, last = self.memory_mib[len(self.memory_mib) // 10], self.memory_mib[-1]
        return last / first - 1.0


def long_run(task: tuple[str, float, int, str, str], end_s: float) -> dict[str, Any]:
    """One run with measurements; the task is kind, minutes, seed, robot and policy."""
    kind, minutes, seed, robot_name, policy = task
    realtime, robot = kind == WALL_CLOCK, load_robot(robot_name)
    config, seconds = DeployConfig(realtime_priority=80 if realtime else None), minutes * 60
    watcher = Watcher(seconds / MEASUREMENTS, realtime, end_s)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "soak.mcap"
        episode = Episode(command_at, seconds, seed, realtime=realtime, log=log, record=False, config=config)
        began = time.monotonic()
        trace = run_episode(robot, load_policy(policy, robot), episode, watcher.update)
        wall_s, log_mib = time.monotonic() - began, log.stat().st_size / 2**20
    long_enough = watcher.out_of_time or abs(trace.walked_s - seconds) < 0.1
    complete = trace.final_state == "IDLE" and long_enough
    memory_constant = watcher.growth() < MAX_GROWTH
    in_time = abs(watcher.drift_us()) <= MAX_DRIFT_TICKS * config.tick_us
    return {
        "part": kind,
        "good": complete and memory_constant and in_time,
        "out_of_time": watcher.out_of_time,
        "walked_s": trace.walked_s,
        "wall_s": wall_s,
        "final_state": trace.final_state,
        "faults": list(trace.faults),
        "notes": list(trace.notes),
        "memory_mib": [watcher.memory_mib[0], watcher.memory_mib[-1], max(watcher.memory_mib)],
        "growth": watcher.growth(),
        "drift_us": watcher.drift_us(),
        "log_mib": log_mib,
        "timing": trace.timing,
    }


def _silence(body: SimulatedRobot, joint: int) -> None:
    body.faults.motors.silent[joint] = True


def _error(body: SimulatedRobot, joint: int) -> None:
    body.faults.motors.error[joint] = 1


def _repeat(body: SimulatedRobot, joint: int) -> None:
    body.faults.motors.stuck[joint] = True


def _reboot(body: SimulatedRobot, joint: int) -> None:
    body.reboot(np.array([joint]))


def _imu_silent(body: SimulatedRobot, _: int) -> None:
    body.faults.imu_silent = True


def _imu_stuck(body: SimulatedRobot, _: int) -> None:
    body.faults.imu_stuck = True


def _topple(body: SimulatedRobot, _: int) -> None:
    body.push((0.0, 12.0, 0.0))


FAULTS: dict[str, Callable[[SimulatedRobot, int], None]] = {
    "motor silent": _silence,
    "motor reports an error": _error,
    "motor repeats its reply": _repeat,
    "motor reboots": _reboot,
    "IMU silent": _imu_silent,
    "IMU stuck": _imu_stuck,
    "toppled": _topple,
}


def with_fault(task: tuple[str, int, str, str]) -> dict[str, Any]:
    """A short run with one fault, drawn from its seed; returns when it was detected."""
    _, seed, robot_name, policy = task
    rng = np.random.default_rng(seed)
    robot = load_robot(robot_name)
    kind = list(FAULTS)[int(rng.integers(len(FAULTS)))]
    joint, at_s = int(rng.integers(len(robot.joint_names))), float(rng.uniform(0.5, 4.0))
    injected_s: list[float] = []
    detected_s: list[float] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        body.fall = lambda _=None: None  # type: ignore[method-assign, assignment]
        if not injected_s and loop.walking and loop.walking_s >= at_s:
            FAULTS[kind](body, joint)
            injected_s.append(loop.now_us * 1e-6)
        if injected_s and not detected_s and loop.state.faults:
            detected_s.append(loop.now_us * 1e-6)

    episode = Episode(command_at, at_s + NOTICED_WITHIN_S, seed, record=False)
    trace = run_episode(robot, load_policy(policy, robot), episode, watch)
    after_s = detected_s[0] - injected_s[0] if injected_s and detected_s else None
    return {
        "seed": seed,
        "kind": kind,
        "joint": joint,
        "at_s": at_s,
        "noticed_after_s": after_s,
        "faults": list(trace.faults),
    }


def faults_summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Summary of all faults."""
    missed = [each for each in found if each["noticed_after_s"] is None]
    slowest = {
        kind: max((e["noticed_after_s"] or 0.0 for e in found if e["kind"] == kind), default=0.0)
        for kind in FAULTS
    }
    counts = {kind: sum(each["kind"] == kind for each in found) for kind in FAULTS}
    return {
        "part": "faults",
        "good": not missed,
        "injected": counts,
        "missed": missed,
        "slowest_noticed_after_s": slowest,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--lockstep-minutes", type=float, default=60.0)
    parser.add_argument("--wall-minutes", type=float, default=10.0)
    parser.add_argument("--faults", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1, help="processes for the runs with faults")
    parser.add_argument("--out", type=Path, help="file with the results of all runs; these are not repeated")
    parser.add_argument("--time-limit", type=float, help="seconds for all runs together")
    options = parser.parse_args()
    end_s = time.monotonic() + (options.time_limit or math.inf)
    subject = (options.robot, options.policy)
    parts: list[dict[str, Any]] = []
    seeds = range(options.seed, options.seed + options.faults)
    short = [("fault", seed, *subject) for seed in seeds]
    found, errors = run_resumable(with_fault, short, options.out, options.workers, options.time_limit)
    parts += [faults_summary(found)] if found else []
    for kind, minutes in ((WALL_CLOCK, options.wall_minutes), (LOCKSTEP, options.lockstep_minutes)):
        if minutes:  # in a separate process, whose memory is measured
            task = (kind, minutes, options.seed, *subject)
            remaining_s = max(end_s - time.monotonic(), 0.0)
            runs, run_errors = run_resumable(
                partial(long_run, end_s=end_s), [task], options.out, 1, remaining_s
            )
            parts, errors = parts + runs, errors + run_errors
    for each in parts:
        print(json.dumps(each), flush=True)
    for line in errors:
        print(line, file=sys.stderr)
    return 0 if all(each["good"] for each in parts) and not errors else 1


if __name__ == "__main__":
    sys.exit(main())
