"""The simulated robot on CAN interfaces, in wall-clock time, instead of the real robot.

It runs in its own process, beside the controller's: `python -m footfall.plant.serve --robot NAME`.
"""

import argparse
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from footfall.common.errors import UserError
from footfall.common.limits import MAX_DURATION_S
from footfall.deploy.bus import Bus
from footfall.deploy.clock import WallClock
from footfall.deploy.frames import Frames
from footfall.deploy.interfaces import open_interfaces
from footfall.deploy.python_can_bus import MULTICAST
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot, load_robot

PERIOD_US = 1000
MAX_STEP_US = 5 * PERIOD_US


def serve(body: SimulatedRobot, wires: SimulatedWires, bus: Bus, stop: threading.Event) -> None:
    """Run a simulated robot in wall-clock time, its wires connected to a bus, until `stop` is set.

    Each cycle first simulates up to the present and then receives frames. Otherwise, after a pause, replies
    to earlier frames would find the wires busy with present frames.

    If the machine falls behind, simulated time falls behind too. Catching up would run the missed time on
    the last command, and a busy machine would never catch up. Frames sent meanwhile are lost, since the
    wires could not carry all of them in simulated time.
    """
    clock = WallClock(PERIOD_US)
    previous_wall_us = now_us = 0
    while not stop.is_set():
        wall_us = clock.next_tick()
        now_us += min(wall_us - previous_wall_us, MAX_STEP_US)
        previous_wall_us = wall_us
        body.advance(now_us)
        for frames in bus.receive(now_us):
            wires.send(Side.HOST, not_before(frames, now_us - MAX_STEP_US), now_us)
        for frames in wires.receive(Side.HOST, now_us):
            bus.send(frames, now_us)


def not_before(frames: Frames, time_us: int) -> Frames:
    """The frames that did not arrive before a time; all, if arrival times are unknown."""
    if frames.time_us is None or (frames.time_us >= time_us).all():
        return frames
    return frames.take(frames.time_us >= time_us)


@contextmanager
def serving(
    robot: Robot, interface: str, config: PlantConfig | None = None, seed: int = 0
) -> Iterator[SimulatedRobot]:
    """A simulated robot on a bus, in a thread, while the context lasts.

    Raises:
        UserError: the plant does not fit, or the bus cannot be opened.
    """
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses, host_queue=1000)  # the interface has a queue already
    body = SimulatedRobot(robot, wiring, wires, config, seed)
    bus = open_interfaces(interface, wiring.buses, open_motor_end(wiring).filters)
    stop = threading.Event()
    thread = threading.Thread(target=serve, args=(body, wires, bus, stop), name="robot", daemon=True)
    thread.start()
    try:
        yield body
    finally:
        stop.set()
        thread.join()
        bus.close()


class _Parser(argparse.ArgumentParser):
    """Reports a bad option as one line, like other bad input."""

    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message} (see python -m footfall.plant.serve --help)")


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= MAX_DURATION_S:
        raise argparse.ArgumentTypeError(
            f"expected a number above 0, and at most {MAX_DURATION_S:g}, a day, found '{text}'"
        )
    return value


def main() -> None:
    """Command line of the simulated robot."""
    parser = _Parser(description="A simulated robot on CAN interfaces.")
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="name or folder of the robot")
    parser.add_argument("--bus", default=MULTICAST, help="kind of interface")
    parser.add_argument("--plant", type=Path, help="another MJCF than the robot's own")
    parser.add_argument("--motor-timeout", type=_seconds, help="seconds; default: robot.yaml's")
    parser.add_argument("--duration", type=_seconds, help="seconds until it ends by itself")
    try:
        options = parser.parse_args()
        config = PlantConfig(options.plant, motor_timeout_s=options.motor_timeout)
        robot = load_robot(options.robot)
        with serving(robot, options.bus, config):
            print(f"{robot.name} is on {options.bus}", flush=True)
            threading.Event().wait(options.duration)
    except UserError as error:
        print(f"footfall: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
