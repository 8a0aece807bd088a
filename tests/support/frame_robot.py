"""A robot made of frames alone, a clock of given times and a log in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np
from some_motors import report

from footfall import JointCommand, PolicyInput, Robot
from footfall.deploy.bus import BusStatistics
from footfall.deploy.drivers import imu
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Request, Requests

TICK_US = 2000
ROWS = np.arange(12)
Vector = tuple[float, float, float]


class FrameRobot:
    """A robot on a bus: it replies at every tick with its attributes, and keeps the received requests."""

    def __init__(self, robot: Robot, wiring: Wiring | None = None) -> None:
        self.wiring = wiring or wiring_of(robot)
        self._end = open_motor_end(self.wiring)
        self.readings = np.array([robot.default_pose, np.zeros(12), np.zeros(12)])
        self.quaternion = (1.0, 0.0, 0.0, 0.0)
        self.gyro = (0.0, 0.0, 0.0)
        self.acceleration = (0.0, 0.0, 9.8)
        self.error = np.zeros(12, dtype=np.uint64)
        self.temperature_c = 30
        self.silent: list[int] = []
        self.imu_silent = False
        self.refuses = 0
        self.bus_fault = ""
        self.sent: list[tuple[int, Requests]] = []
        self._count = 0

    def send(self, frames: Frames, now_us: int) -> int:
        self.sent.append((now_us, self._end.requests(frames)))
        return self.refuses

    def receive(self, now_us: int) -> list[Frames]:
        answering = np.setdiff1d(ROWS, self.silent)
        reported = report(self.readings[:, answering], self.error[answering], self.temperature_c)
        batches = [self._end.reply(answering, reported)]
        if not self.imu_silent:
            self._count += 1
            reading = imu.Inertial(self.gyro, self.acceleration, self.quaternion)
            channel, data = np.full(3, self.wiring.imu_channel), imu.encode(reading, self._count)
            batches.append(Frames(channel, np.array(imu.IDS), data, np.full(3, 8)))
        return batches

    def fault(self) -> str:
        return self.bus_fault

    def statistics(self) -> list[BusStatistics]:
        return [BusStatistics("can0", 7)]

    def kinds(self) -> list[int]:
        """Kind of the last request to each motor."""
        kind = self.sent[-1][1].kind
        return [Request.COMMAND] * 12 if kind is None else kind.tolist()

    def command(self) -> JointCommand:
        return JointCommand(*self.sent[-1][1].values)


class Ticks:
    """A clock that returns given times."""

    realtime = False

    def __init__(self, times_us: Any) -> None:
        self._times = iter(times_us)

    def next_tick(self) -> int:
        return int(next(self._times))

    def lateness_us(self) -> float:
        return 17.0


class Notebook:
    """A log that keeps its records: the method's name and its arguments."""

    def __init__(self) -> None:
        self.result: list[tuple] = []

    def __getattr__(self, kind: str) -> Callable[..., None]:
        return lambda *record: self.result.append((kind, *record))

    def tick(self, now_us: int, sensed: Any, result: Any, commanded: np.ndarray | None) -> None:
        self.result.append(("tick", now_us, sensed, commanded))

    def policy_step(self, now_us: int, inputs: PolicyInput, command: JointCommand, policy: Any) -> None:
        self.result.append(("policy_step", now_us, inputs, command))

    def of(self, kind: str) -> list[tuple]:
        return [each[1:] for each in self.result if each[0] == kind]
