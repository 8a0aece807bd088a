"""Faults that need a wall clock: a late policy, a loop that pauses once, a loop that is late at every tick.

    python benchmarks/fault_clock.py [--seeds 3] [--rate 500]

`fault_table.py` covers the other faults, in lockstep. `go1-flat` walks in simulation. The fault begins after
half a second; the run ends two seconds later. The row without a fault shows whether the machine keeps up at
this rate: nothing else should run on it. Exit status 1 if a row is not as expected.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from fault_runs import SAFE
from fault_subjects import NOISE

from footfall.deploy.config import deploy_config
from footfall.deploy.frames import Frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.bus import SimulatedBus
from footfall.plant.injection import InjectingBus, InjectingPolicy
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import load_robot

ROBOT, POLICY = "go1", "go1-flat"
COMMAND = np.array([0.4, 0.0, 0.0])
AT_S, OBSERVED_S = 0.5, 2.0  # walking time before the fault, and time from the fault to the end of the run
STAND_S = 0.8


class AddedDelay:
    """Delays each policy step and each tick, or one tick alone."""

    def __init__(self, in_step_s: float = 0.0, in_tick_s: float = 0.0, once: bool = False) -> None:
        self._in_step_s, self._in_tick_s, self._once = in_step_s, in_tick_s, once

    def step(self) -> None:
        time.sleep(self._in_step_s)

    def tick(self) -> None:
        seconds, self._in_tick_s = self._in_tick_s, 0.0 if self._once else self._in_tick_s
        time.sleep(seconds)


class TimingFault(NamedTuple):
    """One row.

    `within_s` limits the time from the fault to damping or lying down; None: no detection is required.
    """

    name: str
    delay: Callable[[], AddedDelay]
    within_s: float | None
    reason: str = ""


KINDS = (
    TimingFault("nothing", AddedDelay, None, "the machine keeps up"),
    TimingFault("each policy step takes 30 ms", lambda: AddedDelay(in_step_s=0.03), 0.25, "five in a row"),
    TimingFault(
        "each policy step takes 150 ms", lambda: AddedDelay(in_step_s=0.15), 0.11, "interrupted after 70 ms"
    ),
    TimingFault(
        "each policy step takes 60 ms", lambda: AddedDelay(in_step_s=0.06), 0.11, "no frame goes out"
    ),
    TimingFault(
        "a pause of 30 ms",
        lambda: AddedDelay(in_tick_s=0.03, once=True),
        None,
        "the robot keeps walking",
    ),
    TimingFault(
        "a pause of 60 ms",
        lambda: AddedDelay(in_tick_s=0.06, once=True),
        0.1,
        "motors that get no frame send no reply",
    ),
    TimingFault(
        "a pause of 200 ms", lambda: AddedDelay(in_tick_s=0.2, once=True), 0.1, "a guard damps after 77 ms"
    ),
    TimingFault(
        "ticks of 10 ms", lambda: AddedDelay(in_tick_s=0.01), 0.6, "a share of the last second's ticks"
    ),
    TimingFault(
        "ticks of 20 ms", lambda: AddedDelay(in_tick_s=0.02), 0.6, "a share of the last second's ticks"
    ),
)


class Watch:
    """Injects the fault, and records when the first frames are sent that damp or lower the robot."""

    def __init__(self, kind: TimingFault, body: SimulatedRobot, is_damping: Callable[[Frames], bool]) -> None:
        self._kind, self._body, self._is_damping = kind, body, is_damping
        self.delay: AddedDelay | None = None
        self.injected_s = self.safe_s = 0.0  # by the process' clock; 0 for not yet
        self.fell = False

    def sent(self, frames: Frames) -> None:
        """Frames of the loop or of the guard, which has a thread of its own."""
        if self.injected_s and not self.safe_s and self._is_damping(frames):
            self.safe_s = time.perf_counter()

    def tick(self, loop: ControlLoop) -> None:
        if self.injected_s and not self.safe_s and loop.state.mode in SAFE:
            self.safe_s = time.perf_counter()
        if not self.injected_s and loop.walking and loop.walking_s >= AT_S:
            self.injected_s, self.delay = time.perf_counter(), self._kind.delay()
        if self.delay is not None and not self.safe_s:
            self.fell = self.fell or self._body.fall() is not None
            self.delay.tick()
        if loop.walking and loop.walking_s >= AT_S + OBSERVED_S:
            self.delay = None
            loop.finish()


def run(kind: TimingFault, seed: int, rate_hz: float) -> dict[str, Any]:
    """One run by the wall clock."""
    robot = load_robot(ROBOT)
    config = replace(deploy_config(robot), stand_s=STAND_S, joint_rate_hz=rate_hz)
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses, config.host_queue)
    plant = PlantConfig(noise=NOISE, motor_timeout_s=config.motor_timeout_s)
    body = SimulatedRobot(robot, wiring, wires, plant, seed)
    bus, end = InjectingBus(SimulatedBus(wires, body)), open_motor_end(wiring)

    def is_damping(frames: Frames) -> bool:
        requests = end.requests(frames)
        kp = requests.values[2]
        return requests.kind is None and not kp.any()  # commands without stiffness

    policy, watch = InjectingPolicy(load_policy(POLICY, robot)), Watch(kind, body, is_damping)
    bus.watch = watch.sent

    def delayed(decision: JointCommand) -> JointCommand:
        if watch.delay is not None:
            watch.delay.step()
        return decision

    policy.change_decision = delayed
    session = Session(command_source=lambda _: COMMAND, duration_s=20.0, realtime=True, config=config)
    outcome = run_session(robot, policy, bus, session, watch.tick)
    return {
        "kind": kind.name,
        "fault": outcome.faults[0] if outcome.faults else "",
        "seconds": watch.safe_s - watch.injected_s if outcome.faults and watch.safe_s else None,
        "final_state": outcome.final_state,
        "fell": watch.fell,
        "skipped_share": outcome.timing["ticks_skipped"] * config.tick_us * 1e-6 / outcome.run_s,
    }


def as_expected(kind: TimingFault, runs: list[dict[str, Any]]) -> bool:
    """Whether the fault was detected in time in every run.

    Without a time limit: whether no run had a supervisor's fault or a fall.
    """
    if kind.within_s is None:
        return not any(run["fault"] or run["fell"] for run in runs)
    return all(run["seconds"] is not None and run["seconds"] <= kind.within_s for run in runs)


def row(kind: TimingFault, runs: list[dict[str, Any]]) -> str:
    """A line of the table."""
    seconds = [run["seconds"] for run in runs if run["seconds"] is not None]
    median, longest, limit = (
        "–" if value is None else f"{1e3 * value:.0f}"
        for value in (np.median(seconds) if seconds else None, max(seconds, default=None), kind.within_s)
    )
    states = Counter(run["final_state"] for run in runs)
    ends = ", ".join(f"{state} {count}" for state, count in sorted(states.items()))
    messages = "; ".join(dict.fromkeys(run["fault"] for run in runs if run["fault"]))
    cells = (
        kind.name,
        f"{len(seconds)}/{len(runs)}",
        f"{median}, {longest} ({limit})",
        ends,
        str(sum(run["fell"] for run in runs)),
        messages if as_expected(kind, runs) else f"**{messages or 'missed'}**",
        kind.reason,
    )
    return "| " + " | ".join(cells) + " |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--rate", type=float, default=500.0, help="rate of the joint loop, Hz")
    options = parser.parse_args()
    print("| fault | noticed | safe after, ms: p50, longest (limit) | ends | fell first | message | |")
    print("| --- | ---: | ---: | --- | ---: | --- | --- |")
    wrong, skipped_share = 0, 0.0
    for kind in KINDS:
        runs = [run(kind, seed, options.rate) for seed in range(options.seeds)]
        print(row(kind, runs), flush=True)
        wrong += not as_expected(kind, runs)
        if kind is KINDS[0]:
            skipped_share = max(run["skipped_share"] for run in runs)
    print(f"{skipped_share:.0%} of the ticks skipped without a fault")
    print(f"{len(KINDS)} rows, {wrong} not as expected")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
