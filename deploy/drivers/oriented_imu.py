"""An IMU without orientation, with an attitude filter on gyro and accelerometer."""

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.imu_driver import ImuDriver
from footfall.deploy.estimation.attitude import AttitudeEstimator
from footfall.deploy.estimation.config import AttitudeConfig
from footfall.deploy.frames import Frames


class OrientedImu:
    """An `ImuDriver` whose quaternion comes from a filter. Its reading is valid once the filter has
    started."""

    orientation = True

    def __init__(self, driver: ImuDriver, config: AttitudeConfig) -> None:
        """`driver` gives gyro and acceleration."""
        self._driver, self._estimator = driver, AttitudeEstimator(config)
        self.filters, self.identifiers, self.imu_end = driver.filters, driver.identifiers, driver.imu_end
        self._updated_us: int | None = None
        self.reading = driver.reading

    @property
    def arrived_us(self) -> int | None:
        """Arrival time of the latest reading, us; None until the robot has been at rest long enough."""
        return None if self._estimator.attitude is None else self._driver.arrived_us

    @property
    def oldest(self) -> str:
        """Name of the oldest part of the reading; until the filter has started, with the reason."""
        if self._estimator.attitude is None and self._driver.arrived_us is not None:
            return "quaternion: the robot must be at rest at first"
        return self._driver.oldest

    @property
    def older(self) -> int:
        """Number of samples so far that were older than the latest one."""
        return getattr(self._driver, "older", 0)

    @property
    def damaged(self) -> int:
        """Number of messages so far with a wrong checksum."""
        return getattr(self._driver, "damaged", 0)

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames; a new sample advances the attitude by the time since the previous one."""
        self._driver.absorb(frames, now_us)
        arrived_us, previous_us = self._driver.arrived_us, self._updated_us
        if arrived_us is None or arrived_us == previous_us:
            return
        self._updated_us = arrived_us
        gyro, acceleration, quaternion = self._driver.reading
        elapsed_s = 0.0 if previous_us is None else 1e-6 * (arrived_us - previous_us)
        attitude = self._estimator.update(gyro, acceleration, elapsed_s)
        self.reading = Inertial(gyro, acceleration, quaternion if attitude is None else attitude.quaternion)
