"""Which end of a protocol the motors of a simulated robot are."""

from collections.abc import Callable
from typing import Any

from footfall.deploy.drivers.choice import by_maker
from footfall.deploy.drivers.damiao import DamiaoDriver
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.drivers.odrive import OdriveDriver
from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.damiao import DamiaoMotorEnd
from footfall.plant.motor_ends.mit import MitMotorEnd
from footfall.plant.motor_ends.mixed import MixedMotorEnd
from footfall.plant.motor_ends.motor_end import MotorEnd
from footfall.plant.motor_ends.odrive import OdriveMotorEnd
from footfall.plant.motor_ends.robstride import RobstrideMotorEnd

MOTOR_ENDS: dict[Any, Callable[[Wiring], MotorEnd]] = {  # by the class of the driver
    MitDriver: MitMotorEnd,
    DamiaoDriver: DamiaoMotorEnd,
    RobstrideDriver: RobstrideMotorEnd,
    OdriveDriver: OdriveMotorEnd,
}


def open_motor_end(wiring: Wiring) -> MotorEnd:
    """The motors' end of what `open_driver` opens; errors as there."""
    parts = by_maker(wiring)
    if len(parts) == 1:
        return MOTOR_ENDS[parts[0][0]](wiring)
    return MixedMotorEnd([(MOTOR_ENDS[maker](wiring.take(joints)), joints) for maker, joints in parts])
