"""Processor time of a frame on Linux's CAN interfaces: raw sockets beside python-can, in turn.

    python benchmarks/socketcan_cost.py [--ticks 100] [--rounds 3]

Needs the interfaces can0 to can3 and nobody on them; `benchmarks/socketcan_qemu.py --run` has such a machine,
whose microsecond is a thousand instructions. A tick sends a command to each of twelve motors and takes in
their replies and the three frames of an IMU. Prints a JSON object for each round: microseconds of the thread,
the kernel's included, for each of the frames.
"""

import argparse
import json
import time

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import Frames
from footfall.deploy.python_can_bus import PythonCanBus
from footfall.deploy.socketcan_bus import SOCKETCAN, SocketCanBus
from footfall.deploy.wiring import wire
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.description import load_robot

ROBOT = "go1"
QUEUE_FRAMES = 1000  # no write shall wait


def frame_us(bus: Bus, command: Frames, motors: Bus, answer: Frames, ticks: int) -> float:
    """Mean time of a frame that is sent or received."""
    took_s, frames = 0.0, 0
    for _ in range(ticks):
        motors.send(answer, 0)
        begun = time.thread_time()
        bus.send(command, 0)
        received = bus.receive(0)
        took_s += time.thread_time() - begun
        frames += len(command.id) + sum(len(batch.id) for batch in received)
        motors.receive(0)
    return 1e6 * took_s / frames


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
    answer = Frames(*(np.concatenate(pair) for pair in zip(replies[:4], inertial[:4], strict=True)))
    filters = (*driver.filters, *imu.FILTERS)
    for _ in range(options.rounds):
        shown = {}
        for name in ("python-can", "raw socket"):
            motors = SocketCanBus(wiring.buses, end.filters, QUEUE_FRAMES)
            bus: Bus = (
                SocketCanBus(wiring.buses, filters, QUEUE_FRAMES)
                if name == "raw socket"
                else PythonCanBus(SOCKETCAN, wiring.buses, filters, QUEUE_FRAMES)
            )
            frame_us(bus, command, motors, answer, 2)
            shown[name] = round(frame_us(bus, command, motors, answer, options.ticks), 2)
            bus.close()
            motors.close()
        print(json.dumps(shown), flush=True)


if __name__ == "__main__":
    main()
