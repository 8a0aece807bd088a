"""Processor time that the control loop takes for its motors, by the kind of bus.

    python benchmarks/bus_load.py [--robots go1 hexapod]
        [--buses in-process socket-pairs virtual udp_multicast]

A whole loop (`stand`: joint layer, supervisor, sensor checks, driver, bus) runs at its joint rate by the wall
clock. Its simulated motors have no physics: they stand still and answer every frame at once. They run in the
same process, or in another one for udp_multicast, socketcan and socket-pairs. socketcan needs the interfaces
that `robot.yaml` names; socket-pairs is its code without the kernel's CAN stack (`socket_pairs`). Prints a
JSON object for each case:

`share` is the share of a processor that the loop's thread takes, without the motors: its processor time per
tick times the joint rate. Ticks that a busy machine skips do not lower it. `bus_share` is the part of
`share` for sending and receiving. `calibration_ms` is the processor time of a fixed reference loop, just
before and after: divide shares by it to compare machines or times of day.
"""

import argparse
import json
import multiprocessing
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from relaxed_limits import RELAXED
from socket_pairs import Ends, in_place_of_interfaces, socket_pairs

from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.clock import WallClock
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import filters_of
from footfall.deploy.frames import Frames
from footfall.deploy.interfaces import open_interfaces
from footfall.deploy.loop import ControlLoop
from footfall.deploy.python_can_bus import MULTICAST
from footfall.deploy.session import Session, run_session
from footfall.deploy.socketcan_bus import SOCKETCAN
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Report
from footfall.plant.wires import Side, SimulatedWires
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

IN_PROCESS = "in-process"
PAIRS = "socket-pairs"
OTHER_PROCESS = (MULTICAST, SOCKETCAN, PAIRS)  # buses whose motors run in another process
PERIOD_US = 1000
START_S = 20.0  # limit for the start of the motors
QUEUE_FRAMES = 64  # enough that no write waits


class StillRobot:
    """Motors and an IMU that answer at once: all joints are in the default pose."""

    def __init__(self, robot: Robot) -> None:
        wiring = wiring_of(robot)
        self._end = open_motor_end(wiring)
        n = len(robot.joint_names)
        self._readings = np.array([robot.default_pose, np.zeros(n), np.zeros(n)])
        self._all_motors, self._no_error = np.arange(n), np.zeros(n, np.uint64)
        self._counter = 0
        self._imu = Frames(
            np.full(3, wiring.imu_channel), np.array(imu.IDS), np.zeros((3, 8), np.uint8), np.full(3, 8)
        )

    def answers(self, frames: Frames) -> Frames | None:
        requests = self._end.requests(frames)
        motor, readings = self._all_motors[requests.motor], self._readings[:, requests.motor].copy()
        if not len(motor):
            return self._end.settings_replies(frames)
        if requests.kind is None:
            position, velocity, kp, kd, torque = requests.values
            readings[2] = kp * (position - readings[0]) + kd * velocity + torque
        on = np.ones(len(motor), bool)
        return self._end.reply(motor, Report(readings, self._no_error[motor], on))

    def inertial(self) -> Frames:
        self._counter += 1
        reading = imu.Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))
        return self._imu._replace(data=imu.encode(reading, self._counter))


class InProcessBus:
    """Simulated wires with a still robot on them; `elsewhere_s` is the time that its motors take."""

    def __init__(self, robot: Robot) -> None:
        wiring = wiring_of(robot)
        self._robot, self._wires = StillRobot(robot), SimulatedWires(wiring.buses, host_queue=20)
        self.elsewhere_s = 0.0

    def send(self, frames: Frames, now_us: int) -> int:
        return self._wires.send(Side.HOST, frames, now_us)

    def receive(self, now_us: int) -> list[Frames]:
        start_s = time.thread_time()
        for frames in self._wires.receive(Side.ROBOT, now_us):
            if (answers := self._robot.answers(frames)) is not None:
                self._wires.send(Side.ROBOT, answers, now_us - PERIOD_US)
        self._wires.send(Side.ROBOT, self._robot.inertial(), now_us - PERIOD_US)
        self.elsewhere_s += time.thread_time() - start_s
        return self._wires.receive(Side.HOST, now_us)

    def fault(self) -> str:
        return ""

    def statistics(self) -> list[BusStatistics]:
        return []

    def close(self) -> None:
        """No resource is open."""


class TimedBus:
    """A bus that measures the thread's processor time in its `send` and `receive`, `spent_s`."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self.spent_s = bus, 0.0
        self.statistics, self.fault, self.close = bus.statistics, bus.fault, bus.close

    @property
    def elsewhere_s(self) -> float:
        """The part of `spent_s` that the simulated motors took."""
        return getattr(self._bus, "elsewhere_s", 0.0)

    def send(self, frames: Frames, now_us: int) -> int:
        start_s = time.thread_time()
        refused = self._bus.send(frames, now_us)
        self.spent_s += time.thread_time() - start_s
        return refused

    def receive(self, now_us: int) -> list[Frames]:
        start_s = time.thread_time()
        arrived = self._bus.receive(now_us)
        self.spent_s += time.thread_time() - start_s
        return arrived


class Event(Protocol):
    """`threading.Event` or `multiprocessing.Event`."""

    def set(self) -> None: ...

    def is_set(self) -> bool: ...


def answer(name: str, kind: str, ready: Event, stop: Event, ends: Ends) -> None:
    """Simulate a still robot on an interface, or at these socket ends, until `stop` is set."""
    robot = load_robot(name)
    wiring, still = wiring_of(robot), StillRobot(robot)
    with in_place_of_interfaces(ends):
        bus = open_interfaces(interface_of(kind), wiring.buses, open_motor_end(wiring).filters)
    clock = WallClock(PERIOD_US)
    ready.set()
    while not stop.is_set():
        now_us = clock.next_tick()
        for frames in bus.receive(now_us):
            if (answers := still.answers(frames)) is not None:
                bus.send(answers, now_us)
        if now_us % (2 * PERIOD_US) == 0:
            bus.send(still.inertial(), now_us)
    bus.close()


@contextmanager
def answering(name: str, kind: str) -> Iterator[None]:
    """Context in which a still robot answers, in a thread or process, and interfaces lead to it."""
    near, far = socket_pairs(wiring_of(load_robot(name)).buses) if kind == PAIRS else ({}, {})
    context = multiprocessing.get_context("spawn")
    make_worker: Any = context.Process if kind in OTHER_PROCESS else threading.Thread
    make_event: Any = context.Event if kind in OTHER_PROCESS else threading.Event
    ready, stop = make_event(), make_event()
    responder = make_worker(target=answer, args=(name, kind, ready, stop, far), daemon=True)
    responder.start()
    ready.wait(START_S)
    try:
        with in_place_of_interfaces(near):
            yield
    finally:
        stop.set()
        responder.join(5.0)


def interface_of(kind: str) -> str:
    return SOCKETCAN if kind == PAIRS else kind


def calibration_ms() -> float:
    """Processor time of a loop that resembles the control loop, ms: Python arithmetic and small arrays."""
    values, total = np.linspace(-1.0, 1.0, 12), 0.0
    start_s = time.thread_time()
    for round_ in range(2000):
        for number in range(20):
            total += (round_ ^ number) & 7
        total += float((values * round_ + values).clip(-1.0, 1.0).sum())
    return (time.thread_time() - start_s) * 1e3


def open_bus(robot: Robot, kind: str) -> Bus:
    """The controller's end of the buses."""
    if kind == IN_PROCESS:
        return InProcessBus(robot)
    wiring = wiring_of(robot)
    return open_interfaces(interface_of(kind), wiring.buses, filters_of(wiring), QUEUE_FRAMES)


def measure(name: str, kind: str, seconds: float, rate_hz: float) -> dict[str, object]:
    """Figures of one case."""
    robot = load_robot(name)
    wiring = wiring_of(robot)
    calibrations = [calibration_ms() for _ in range(3)]
    marks: list[tuple[float, float]] = []  # first and latest: processor time of the thread and of the bus, s
    ticks = [0]

    def mark(loop: ControlLoop) -> None:
        if loop.walking:
            now = (time.thread_time() - bus.elsewhere_s, bus.spent_s - bus.elsewhere_s)
            marks[1:] = [now]  # in an empty list, this is the first
            ticks[0] += 1

    config = replace(RELAXED, joint_rate_hz=rate_hz, stand_s=0.3)
    session = Session(lambda _: np.zeros(3), seconds, realtime=True, config=config)
    with nullcontext() if kind == IN_PROCESS else answering(name, kind):
        bus = TimedBus(open_bus(robot, kind))
        outcome = run_session(robot, load_policy("stand", robot), bus, session, mark)
        bus.close()
    calibration = float(np.median(calibrations + [calibration_ms() for _ in range(3)]))
    thread_s, bus_s = ((end - begin) / (ticks[0] - 1) for begin, end in zip(*marks, strict=True))
    return {
        "robot": name,
        "motors": len(robot.joint_names),
        "bus": kind,
        "buses": len(wiring.buses),
        "rate_hz": rate_hz,
        "share": round(thread_s * rate_hz, 3),
        "bus_share": round(bus_s * rate_hz, 3),
        "calibration_ms": round(calibration, 2),
        "calibrations_per_tick": round(thread_s * 1e3 / calibration, 4),
        "ticks": ticks[0],
        "ticks_planned": round(seconds * rate_hz),
        "faults": list(outcome.faults),
        "processors": os.cpu_count(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=["go1", "hexapod"])
    parser.add_argument("--buses", nargs="+", default=[IN_PROCESS, PAIRS, "virtual", MULTICAST])
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rate", type=float, default=500.0)
    options = parser.parse_args()
    for robot in options.robots:
        for kind in options.buses:
            print(json.dumps(measure(robot, kind, options.seconds, options.rate)), flush=True)


if __name__ == "__main__":
    main()
