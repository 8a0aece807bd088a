"""Opens the stop inputs that a robot declares, beside its buses."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from footfall.common.errors import UserError
from footfall.deploy.bus import Bus
from footfall.deploy.command_source import StopSource
from footfall.deploy.drivers import choice, foot_force
from footfall.deploy.drivers.choice import by_driver, imu_driver_class
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.stop_inputs.frame import StopFrameBus, filter_of
from footfall.deploy.stop_inputs.key import StopKeyInput
from footfall.deploy.wiring import Wiring
from footfall.robots.description import Robot


def filters_of(robot: Robot, wiring: Wiring) -> tuple[CanFilter, ...]:
    """Which frames a robot's motors, its IMU and its stop frame's sender send.

    Raises:
        UserError: a motor or an IMU without a driver.
    """
    frame = robot.description.stop_inputs.frame
    return (*choice.filters_of(wiring), *(() if frame is None else (filter_of(frame),)))


@contextmanager
def stop_inputs(robot: Robot, wiring: Wiring, bus: Bus) -> Iterator[tuple[Bus, Sequence[StopSource]]]:
    """The bus for the loop, and the stop inputs, until the context ends.

    Raises:
        UserError: one cannot be opened, or its identifier is a motor's or a sensor's.
    """
    declared, sources = robot.description.stop_inputs, list[StopSource]()
    with ExitStack() as resources:
        if declared.frame is not None:
            frame, channel = declared.frame, wiring.buses.index(declared.frame.bus)
            if not frame.extended and frame.id in _taken(wiring, channel):
                raise UserError(f"stop_inputs.frame: {frame.id:#x} on {frame.bus} is a motor's or a sensor's")
            bus = stop_bus = StopFrameBus(bus, frame, channel)
            sources.append(stop_bus)
        if declared.key is not None:
            key = StopKeyInput(declared.key)
            resources.callback(key.close)
            sources.append(key)
        yield bus, sources


def _taken(wiring: Wiring, channel: int) -> set[int]:
    """Identifiers that the motors and the sensors use on a bus."""
    of_feet = foot_force.identifiers(len(wiring.foot_channel))[wiring.foot_channel == channel]
    taken = {*imu_driver_class(wiring.imu_protocol).identifiers, *of_feet.tolist()}
    for driver, joints in by_driver(wiring):
        for joint in joints[wiring.channel[joints] == channel]:
            taken.update(driver.identifiers(int(wiring.motor_id[joint])))
    return taken
