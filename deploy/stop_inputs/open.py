"""Opens the stop inputs declared by a robot, along with its buses."""

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
    """Filters for the frames of a robot's motors, IMU and stop frame.

    Raises:
        UserError: no driver for a motor or the IMU.
    """
    frame = robot.description.stop_inputs.frame
    return (*choice.filters_of(wiring), *(() if frame is None else (filter_of(frame),)))


@contextmanager
def stop_inputs(robot: Robot, wiring: Wiring, bus: Bus) -> Iterator[tuple[Bus, Sequence[StopSource]]]:
    """The bus for the loop, and the stop inputs; closed at the end of the context.

    Raises:
        UserError: a stop input cannot be opened, or a motor or sensor already uses its identifier.
    """
    declared, sources = robot.description.stop_inputs, list[StopSource]()
    with ExitStack() as resources:
        if declared.frame is not None:
            frame, channel = declared.frame, wiring.buses.index(declared.frame.bus)
            if not frame.extended and frame.id in _taken(wiring, channel):
                raise UserError(
                    f"stop_inputs.frame: {frame.id:#x} on {frame.bus} is already used by a motor or sensor"
                )
            bus = stop_bus = StopFrameBus(bus, frame, channel)
            sources.append(stop_bus)
        if declared.key is not None:
            key = StopKeyInput(declared.key)
            resources.callback(key.close)
            sources.append(key)
        yield bus, sources


def _taken(wiring: Wiring, channel: int) -> set[int]:
    """Identifiers used by the motors and sensors on a bus."""
    foot_identifiers = foot_force.identifiers(len(wiring.foot_channel))[wiring.foot_channel == channel]
    taken = {*imu_driver_class(wiring.imu_protocol).identifiers, *foot_identifiers.tolist()}
    for driver, joints in by_driver(wiring):
        for joint in joints[wiring.channel[joints] == channel]:
            taken.update(driver.identifiers(int(wiring.motor_id[joint])))
    return taken
