"""The bus to a robot on a stand, for `footfall identify`."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from footfall.options import SIMULATED, VIRTUAL
from footfall.robot_bus import interface_bus

if TYPE_CHECKING:
    from footfall.deploy.bus import Bus
    from footfall.robots.description import Robot

SAFE = "IDLE"
ON_STAND = "Is the robot bolted to a stand, with its feet in the air and nobody within its reach"


def open_bus(robot: "Robot", kind: str, plant: Path | None, seed: int, resources: ExitStack) -> "Bus":
    """Open the bus of this kind, which `resources` closes; `plant` is the MJCF of a simulated robot."""
    if kind == SIMULATED:
        from footfall.identify.simulated import simulated_bus

        return simulated_bus(robot, plant=plant, seed=seed)
    from footfall.deploy.stop_inputs.open import filters_of
    from footfall.deploy.wiring import wiring_of

    plant_config = None
    if kind == VIRTUAL:
        from footfall.identify.simulated import on_a_stand

        plant_config = on_a_stand()
    wiring = wiring_of(robot)
    return resources.enter_context(
        interface_bus(robot, wiring, kind, filters_of(robot, wiring), plant_config, seed)
    )
