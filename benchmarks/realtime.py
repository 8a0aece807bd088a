"""Lateness of the control loop's ticks in real time, and duration of their stages.

    python benchmarks/realtime.py [--policy go1-flat] [--seconds 60] [--priority 80] [--log FILE]

The simulated robot runs in a separate process, as a real robot does. Both are connected by SocketCAN's code
with sockets that cost the same system calls (`socket_pairs`). With --one-thread its physics is a stage of the
tick instead. At the same time an empty loop runs in another process, at the same rate and priority, as a
reference for the machine. Prints a JSON object, in microseconds: lateness of both loops, and of the ticks
before which the loop had paused; overruns and skipped ticks; stages with their budgets. Exit status 1
if p99 of the loop's lateness exceeds 0.3 ms, or a stage exceeds its budget.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from relaxed_limits import RELAXED
from socket_pairs import Ends, in_place_of_interfaces, socket_pairs

from footfall.deploy.clock import WallClock, realtime_thread
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Display, Session, SessionResult, run_on_interface
from footfall.deploy.socketcan_bus import SOCKETCAN
from footfall.deploy.timing import Durations, Timing
from footfall.deploy.wiring import wiring_of
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.serve import serving
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

LIMIT_US = 300.0  # p99 of the lateness
BUDGET_US = {  # p99 of each stage; the period at 500 Hz is 2,000
    "plant": 800.0,  # only with --one-thread
    "readings": 300.0,  # one system call per frame
    "signals": 250.0,  # one tick in 20 compares the readings with each other
    "supervisor": 50.0,
    "estimator": 150.0,
    "policy": 600.0,
    "command": 250.0,
    "log": 100.0,
}
QUANTILES = (50, 99, 99.9)


class Stages:
    """Measures the duration of parts of a loop by wrapping them."""

    def __init__(self) -> None:
        self.durations = {name: Durations() for name in BUDGET_US}
        self.timing = Timing()  # timing of the loop, once it runs
        self._inside: list[float] = []  # for each running stage, time taken by nested stages

    def wrap(self, name: str, owner: Any, method: str) -> None:
        """Add a method's duration to a stage, minus the stages nested in it."""
        work: Callable[..., Any] = getattr(owner, method)
        durations, inside = self.durations[name], self._inside

        def timed(*arguments: Any) -> Any:
            inside.append(0.0)
            began = time.perf_counter()
            try:
                return work(*arguments)
            finally:
                took = (time.perf_counter() - began) * 1e6
                durations.add(took - inside.pop())
                if inside:
                    inside[-1] += took

        setattr(owner, method, timed)

    @contextmanager
    def watch(self, loop: ControlLoop) -> Iterator[None]:
        """Measure the parts of a loop that is about to run."""
        self.timing = loop.timing
        for name, owner, method in (
            ("plant", SimulatedRobot, "advance"),
            ("readings", loop._bus, "receive"),
            ("readings", loop._joints, "absorb"),
            ("signals", loop._signals, "update"),
            ("supervisor", loop, "_supervise"),
            ("estimator", loop._estimate, "update"),
            ("policy", loop._runner, "step"),
            ("command", loop._actions, "frames"),
            ("command", loop._bus, "send"),
        ):
            self.wrap(name, owner, method)
        if loop._log is not None:
            self.wrap("log", loop._log, "tick")
            self.wrap("log", loop._log, "policy_step")
        yield

    def summary(self) -> dict[str, dict[str, float]]:
        return {
            name: figures(durations.values()) | {"longest": durations.longest, "budget_p99": BUDGET_US[name]}
            for name, durations in self.durations.items()
            if durations.count
        }


def lateness_after_pause(timing: Timing, period_us: float) -> np.ndarray:
    """Lateness of ticks that were due after the previous tick's work had ended, us."""
    lateness, work = timing.lateness_us.values(), timing.tick_us.values()
    return lateness[1:][lateness[:-1] + work[:-1] < period_us]


def figures(values: np.ndarray) -> dict[str, float]:
    return {f"p{q:g}": float(np.percentile(values, q)) for q in QUANTILES}


def with_longest(values: np.ndarray) -> dict[str, float]:
    return figures(values) | {"max": float(values.max(initial=0.0))}


def empty_loop(period_us: int, priority: int | None, pipe: Connection) -> None:
    """An empty loop: reports that it runs, stops on a message, then sends its lateness, us."""
    clock, lateness = WallClock(period_us), Durations()
    with realtime_thread(priority):
        pipe.send("running")
        while not pipe.poll():
            clock.next_tick()
            lateness.add(clock.lateness_us())
    pipe.send(lateness.values())


def simulate(folder: str, config: DeployConfig, ends: Ends, pipe: Connection) -> None:
    """Simulate the robot of this folder at these socket ends.

    Reports that it runs, stops on a message, confirms. If the loop has a real-time priority, the robot has
    the lowest one, because real motors always respond.
    """
    priority = None if config.realtime_priority is None else 1
    plant = PlantConfig(motor_timeout_s=config.motor_timeout_s)
    with (
        realtime_thread(priority),  # inherited by the robot's thread
        in_place_of_interfaces(ends),
        serving(load_robot(folder), SOCKETCAN, plant),
    ):
        pipe.send("running")
        pipe.recv()
    pipe.send("over")


@contextmanager
def in_another_process(work: Callable[..., None], *arguments: Any) -> Iterator[list[Any]]:
    """Run one of these functions in another process; yields a list that gets its last message at the end."""
    context = get_context("spawn")
    last_message: list[Any] = []
    parent_end, child_end = context.Pipe()
    process = context.Process(target=work, args=(*arguments, child_end), daemon=True)
    process.start()
    child_end.close()
    parent_end.recv()
    try:
        yield last_message
    finally:
        parent_end.send("stop")
        last_message.append(parent_end.recv())
        process.join()


def in_one_thread(robot: Robot, policy: Policy, session: Session, display: Display) -> SessionResult:
    """A session on the simulated bus, with the physics in the loop's thread."""
    episode = Episode(
        session.command_source,
        session.duration_s,
        realtime=True,
        config=session.config,
        record=False,
        log=session.log,
        display=lambda loop, velocity: display(loop),
    )
    return run_episode(robot, policy, episode)


def in_two_processes(robot: Robot, policy: Policy, session: Session, display: Display) -> SessionResult:
    """A session with SocketCAN's code, and the simulated robot in a separate process."""
    near, far = socket_pairs(wiring_of(robot).buses)
    with in_another_process(simulate, str(robot.folder), session.config, far), in_place_of_interfaces(near):
        return run_on_interface(robot, policy, SOCKETCAN, replace(session, display=display))


def rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return round(value, 1) if isinstance(value, float) else value


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=500.0, help="joint rate, Hz")
    parser.add_argument("--priority", type=int, default=80, help="SCHED_FIFO priority; 0 for none")
    parser.add_argument("--log", type=Path, help="record the run, too")
    parser.add_argument("--one-thread", action="store_true", help="simulate in the loop's thread")
    options = parser.parse_args()
    priority = options.priority or None
    robot = load_robot(options.robot)
    policy = load_policy(options.policy, robot)
    # Lateness is measured: it must not end the run.
    config = replace(RELAXED, joint_rate_hz=options.rate, realtime_priority=priority)
    command, stages = np.array([0.5, 0.0, 0.0]), Stages()
    session = Session(lambda _: command, options.seconds, log=options.log, config=config)
    run = in_one_thread if options.one_thread else in_two_processes
    with in_another_process(empty_loop, config.tick_us, priority) as empty_lateness:
        outcome = run(robot, policy, session, stages.watch)
    timing, durations = outcome.timing, stages.summary()
    over_budget = [name for name, each in durations.items() if each["p99"] > each["budget_p99"]]
    over_budget += ["lateness"] if timing["lateness_us_p99"] > LIMIT_US else []
    report = {
        "policy": policy.name,
        "final_state": outcome.final_state,
        "faults": list(outcome.faults),
        "notes": list(outcome.notes),
        "lateness_us": {name: timing[f"lateness_us_{name}"] for name in ("p50", "p99", "max")},
        "lateness_after_pause_us": with_longest(lateness_after_pause(stages.timing, config.tick_us)),
        "empty_loop_us": with_longest(empty_lateness[0]),
        "tick_us": {name: timing[f"tick_us_{name}"] for name in ("p50", "p99", "max")},
        **{name: timing[name] for name in ("ticks", "overruns", "ticks_skipped")},
        "stages_us": durations,
        "over_budget": over_budget,
    }
    print(json.dumps(rounded(report), indent=2))
    return 1 if over_budget else 0


if __name__ == "__main__":
    sys.exit(main())
