"""Opens the simulated motors of a robot: each driver class names the simulated motors of its protocol."""

from footfall.common.errors import UserError
from footfall.common.outside import find
from footfall.deploy.drivers.choice import by_driver
from footfall.deploy.drivers.driver import MotorDriver
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.mixed import MixedMotorEnd
from footfall.plant.motor_ends.motor_end import MotorEnd


def open_motor_end(wiring: Wiring) -> MotorEnd:
    """Simulated motors for the drivers that `open_driver` opens.

    Raises:
        UserError: as `open_driver`, or for a user's own driver without simulated motors.
    """
    parts = [(_simulated_motors(driver, wiring.take(joints)), joints) for driver, joints in by_driver(wiring)]
    return parts[0][0] if len(parts) == 1 else MixedMotorEnd(parts)


def _simulated_motors(driver: type[MotorDriver], wiring: Wiring) -> MotorEnd:
    if not driver.motor_end:
        raise UserError(f"motor '{wiring.models[0]}' cannot be simulated: its driver names no motor_end")
    end: MotorEnd = find(driver.motor_end, "simulated motor")(wiring)
    return end
