"""Processor time of a frame on Linux's CAN interfaces: ours on raw sockets beside python-can's, in turn.

    python benchmarks/socketcan_cost.py [--ticks 100] [--rounds 3]

Needs the interfaces can0 to can3 and nobody on them; `benchmarks/socketcan_qemu.py --run` has such a machine,
whose microsecond is a thousand instructions. A tick sends a command to each of twelve motors and takes in
their replies and the three frames of an IMU. Prints a JSON object for each round: microseconds of the thread,
the kernel's included, for each of the 27 frames.
"""

import argparse
import json
import time
from typing import Any

import numpy as np

from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, Frames, joined
from footfall.deploy.socketcan_bus import SOCKETCAN, SocketCanBus
from footfall.deploy.wiring import wire
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.description import load_robot

ROBOT = "go1"
QUEUE_FRAMES = 1000  # no write shall wait


class PythonCan:
    """As little as sending and receiving takes with python-can, the kernel's filters included."""

    def __init__(self, names: tuple[str, ...], filters: tuple[CanFilter, ...]) -> None:
        import can

        self._can = can
        self._buses = [
            can.Bus(interface=SOCKETCAN, channel=name, can_filters=list(filters)) for name in names
        ]

    def send(self, frames: Frames, _: int) -> None:
        for channel, identifier, data, length in zip(
            frames.channel.tolist(), frames.id.tolist(), frames.data, frames.length.tolist(), strict=True
        ):
            message = self._can.Message(
                arbitration_id=identifier & ~EXTENDED,
                is_extended_id=bool(identifier & EXTENDED),
                data=data[:length].tobytes(),
                check=False,
            )
            self._buses[channel].send(message)

    def receive(self, _: int) -> list[Any]:
        messages = []
        for bus in self._buses:
            while (message := bus.recv(timeout=0)) is not None:
                messages.append(message)
        return messages

    def close(self) -> None:
        for bus in self._buses:
            bus.shutdown()


def frame_us(bus: Any, command: Frames, motors: SocketCanBus, answer: Frames, ticks: int) -> float:
    """Mean time of a frame that is sent or received."""
    took_s = 0.0
    for _ in range(ticks):
        motors.send(answer, 0)
        begun = time.thread_time()
        bus.send(command, 0)
        bus.receive(0)
        took_s += time.thread_time() - begun
        motors.receive(0)
    return 1e6 * took_s / ticks / (len(command.id) + len(answer.id))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=100, help="of each round")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    wiring = wire(load_robot(ROBOT))
    driver, end, n = open_driver(wiring), open_motor_end(wiring), len(wiring.motor_id)
    command = driver.command(np.zeros((5, n)))
    replies = end.reply(np.arange(n), np.zeros((3, n)), 30, np.zeros(n, np.uint64), np.ones(n, bool))
    inertial = Frames(
        np.full(3, wiring.imu_channel), np.array(imu.IDS), np.zeros((3, 8), np.uint8), np.full(3, 8)
    )
    filters = (*driver.filters, *imu.FILTERS)
    for _ in range(options.rounds):
        shown = {}
        for name in ("python-can", "raw sockets"):
            motors = SocketCanBus(wiring.buses, end.filters, QUEUE_FRAMES)
            ours = name == "raw sockets"
            bus: Any = (
                SocketCanBus(wiring.buses, filters, QUEUE_FRAMES)
                if ours
                else PythonCan(wiring.buses, filters)
            )
            answer = joined([replies, inertial])
            frame_us(bus, command, motors, answer, 2)
            shown[name] = round(frame_us(bus, command, motors, answer, options.ticks), 2)
            bus.close()
            motors.close()
        print(json.dumps(shown), flush=True)


if __name__ == "__main__":
    main()
