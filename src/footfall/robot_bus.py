"""Buses that verbs open: a robot's interfaces, with a simulated robot on the virtual one."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from footfall.options import VIRTUAL

if TYPE_CHECKING:
    from footfall.deploy.bus import Bus
    from footfall.deploy.drivers.driver import CanFilter
    from footfall.deploy.wiring import Wiring
    from footfall.plant.robot import PlantConfig
    from footfall.robots.description import Robot


@contextmanager
def virtual_robot(
    robot: "Robot", kind: str, plant: "PlantConfig | None" = None, seed: int = 0
) -> Iterator[None]:
    """Simulate a robot on the virtual bus, which does not leave this process; on other buses do nothing."""
    if kind != VIRTUAL:
        yield
        return
    from footfall.plant.serve import serving

    with serving(robot, VIRTUAL, plant, seed):
        yield


@contextmanager
def interface_bus(
    robot: "Robot",
    wiring: "Wiring",
    kind: str,
    filters: "tuple[CanFilter, ...]",
    plant: "PlantConfig | None" = None,
    seed: int = 0,
) -> "Iterator[Bus]":
    """A robot's buses on python-can interfaces, for one process.

    Args:
        robot: the robot.
        wiring: wiring of its motors.
        kind: python-can interface; `virtual` includes a simulated robot.
        filters: filters for received frames.
        plant: the simulated robot; None for its defaults.
        seed: seed of the simulated robot.

    Raises:
        UserError: a bus cannot be opened, or another process commands a robot on it.
    """
    from footfall.deploy.interfaces import locked_interfaces

    with (
        virtual_robot(robot, kind, plant, seed),
        locked_interfaces(kind, wiring.buses, filters) as bus,
    ):
        yield bus
