"""Choice of the drivers for a robot's motors and its IMU.

A motor protocol is a class in `DRIVERS`, or an external class that robot.yaml names as MODULE:NAME.
"""

import numpy as np

from footfall.common.errors import UserError, naming
from footfall.common.outside import is_import_path
from footfall.deploy.drivers import foot_force
from footfall.deploy.drivers.checks import imu_driver_at, motor_driver_at, open_external
from footfall.deploy.drivers.damiao import DamiaoDriver
from footfall.deploy.drivers.driver import CanFilter, Driver, MotorDriver
from footfall.deploy.drivers.identifiers import check_identifiers
from footfall.deploy.drivers.imu import ImuReader, InertialReader
from footfall.deploy.drivers.imu_driver import ImuDriver
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.drivers.mixed import MixedDriver
from footfall.deploy.drivers.moteus_driver import MoteusDriver
from footfall.deploy.drivers.odrive_driver import OdriveDriver
from footfall.deploy.drivers.oriented_imu import OrientedImu
from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.drivers.vectornav import VectorNavImu
from footfall.deploy.drivers.xbus import XbusImu
from footfall.deploy.drivers.xsens_can import XsensCanImu
from footfall.deploy.estimation.config import AttitudeConfig
from footfall.deploy.wiring import Wiring
from footfall.robots.robot_yaml import SERIAL

DRIVERS: tuple[type[MotorDriver], ...] = (
    MitDriver,
    DamiaoDriver,
    RobstrideDriver,
    OdriveDriver,
    MoteusDriver,
)
IMU_DRIVERS: dict[str, type[ImuDriver]] = {  # by imu_protocol of robot.yaml
    "footfall": ImuReader,
    "footfall-inertial": InertialReader,
    "vectornav": VectorNavImu,
    "xsens": XbusImu,
    "xsens-can": XsensCanImu,
}

_BY_MODEL = {model: driver for driver in DRIVERS for model in driver.models}


def driver_class(protocol: str) -> type[MotorDriver]:
    """Driver class of a motor model or of MODULE:NAME.

    Raises:
        UserError: there is none, or it is not a motor driver.
    """
    if protocol in _BY_MODEL:
        return _BY_MODEL[protocol]
    if is_import_path(protocol):
        return motor_driver_at(protocol)
    known = ", ".join(_BY_MODEL)
    raise UserError(f"no driver for motor '{protocol}': there are {known}, or MODULE:NAME")


def imu_driver_class(protocol: str) -> type[ImuDriver]:
    """Driver class of an `imu_protocol`.

    Raises:
        UserError: there is none, or it is not an IMU driver.
    """
    if protocol in IMU_DRIVERS:
        return IMU_DRIVERS[protocol]
    if is_import_path(protocol):
        return imu_driver_at(protocol)
    known = ", ".join(IMU_DRIVERS)
    raise UserError(f"no imu_protocol '{protocol}': there are {known}, or MODULE:NAME")


def open_driver(wiring: Wiring) -> Driver:
    """Driver of all motors of a robot.

    Raises:
        UserError: a motor or a motor id without a driver, conflicting identifiers on a bus, or an external
            driver that does not fit.
    """
    parts = [(_open(driver, wiring.take(joints)), joints) for driver, joints in by_driver(wiring)]
    return parts[0][0] if len(parts) == 1 else MixedDriver(parts)


def _open(driver: type[MotorDriver], wiring: Wiring) -> Driver:
    return driver(wiring) if driver in DRIVERS else open_external(driver, wiring)


def _check_drive_limit(wiring: Wiring, joint: int, driver: type[MotorDriver]) -> None:
    """Raises UserError if a driver cannot set the drive limit that robot.yaml has for a joint."""
    limit, supported = wiring.drive_limit[joint], getattr(driver, "drive_limits", ())
    if limit and limit not in supported:
        advice = f"drive_limit: {' or '.join(supported)}" if supported else "no drive_limit"
        raise UserError(
            f"joint {wiring.joint_names[joint]}: {driver.maker} motors have no {limit} limit that a frame"
            f" sets: use {advice}"
        )


def by_driver(wiring: Wiring) -> list[tuple[type[MotorDriver], np.ndarray]]:
    """Driver classes of a robot's motors, each with its joints (indices); errors as for `open_driver`."""
    drivers = []
    for joint, protocol in zip(wiring.joint_names, wiring.models, strict=True):
        with naming(f"joint {joint}: protocol"):
            drivers.append(driver_class(protocol))
        _check_drive_limit(wiring, len(drivers) - 1, drivers[-1])
    imu_identifiers = imu_driver_class(wiring.imu_protocol).identifiers
    check_identifiers(wiring, [driver.identifiers for driver in drivers], imu_identifiers)
    return [
        (each, np.array([joint for joint, driver in enumerate(drivers) if driver is each]))
        for each in dict.fromkeys(drivers)
    ]


def open_imu(wiring: Wiring, attitude: AttitudeConfig | None = None) -> ImuDriver:
    """Driver of a robot's IMU, with an attitude filter for an IMU without orientation.

    Args:
        wiring: has the IMU's bus and driver.
        attitude: settings of the filter; None for the defaults.

    Raises:
        UserError: as for `imu_driver_class`, or the IMU is on the wrong kind of bus.
    """
    driver = imu_driver_class(wiring.imu_protocol)(wiring.imu_channel)
    bus = wiring.buses[wiring.imu_channel]
    if getattr(driver, "serial", False) != bus.startswith(SERIAL):
        kind = "a CAN bus" if bus.startswith(SERIAL) else f"a serial port, such as {SERIAL}/dev/ttyUSB0"
        raise UserError(f"imu_protocol '{wiring.imu_protocol}' needs {kind} as imu_bus, not '{bus}'")
    if getattr(driver, "orientation", True):
        return driver
    return OrientedImu(driver, attitude or AttitudeConfig())


def filters_of(wiring: Wiring) -> tuple[CanFilter, ...]:
    """Filters for the frames of a robot's motors and sensors; errors as for `open_driver`."""
    foot_filters = foot_force.FILTERS if len(wiring.foot_channel) else ()
    return (*open_driver(wiring).filters, *imu_driver_class(wiring.imu_protocol).filters, *foot_filters)
