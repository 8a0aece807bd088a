"""Settings of the base estimator: noise figures are standard deviations."""

from dataclasses import dataclass, field
from typing import Any

from footfall.common.config import require_between, require_ordered

# Squares of numbers in this range, and products of such squares, are finite and above 0.
SMALLEST, LARGEST = 1e-12, 1e12


def _require_positive(config: Any, *names: str) -> None:
    require_between(config, SMALLEST, LARGEST, *names)


def _require_not_negative(config: Any, *names: str) -> None:
    require_between(config, 0.0, LARGEST, *names)


@dataclass(frozen=True)
class ContactConfig:
    """Contact detection. Forces are shares of the force on each foot while all feet stand."""

    force_share: tuple[float, float] = (0.2, 0.8)  # no contact below the first, certain above the second
    force_filter_s: float = 0.006  # time constant of the force estimate
    rise_s: float = 0.03  # time constant of rising trust: a landing foot bounces and slips first
    carried_share: float = 0.3  # of gravity, read by the accelerometer if the feet carry the robot
    level_m: float = 0.0015  # corners of a sole within this height share its load
    sensor_error_share: float = 0.5  # mean deviation from torques above which a force sensor is ignored
    sensor_filter_s: float = 0.5  # averaging time of this deviation
    sensor_trial_s: float = 1.0  # time from rest until an ignored sensor is noted

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        if self.force_share[0] == self.force_share[1]:
            raise ValueError("force_share must rise from its first number to its second")
        _require_positive(self, "force_filter_s", "rise_s", "carried_share", "level_m")
        _require_positive(self, "sensor_error_share", "sensor_filter_s")
        _require_not_negative(self, "sensor_trial_s")


@dataclass(frozen=True)
class AttitudeConfig:
    """Noise of gyro and accelerometer for an IMU without orientation."""

    rest_s: float = 0.5  # time at rest over which the first readings are averaged
    rest_rad_s: float = 0.15  # largest gyro reading at rest: bias plus noise
    start_tilt: float = 0.01  # rad, error of the initial attitude, by a badly calibrated accelerometer
    start_bias: float = 0.0015  # rad/s, error of the gyro bias after the first rest
    gyro_noise: float = 0.005  # rad per root of a second
    bias_drift: float = 0.001  # rad/s per root of a second
    acceleration_noise: float = 0.5  # m/s^2 times root of a second: base's own acceleration
    legs_bias_hz: float = 0.7  # rate at which a tilt correction by stance legs changes the gyro bias

    def __post_init__(self) -> None:
        _require_positive(self, *self.__dataclass_fields__)


@dataclass(frozen=True)
class GyroConfig:
    """Estimation of the gyro bias."""

    bias_filter_s: float = 10.0  # averaging time in the long run
    bias_half_s: float = 0.2  # averaging time with weight 50 %: noise of the orientation over the usual bias

    def __post_init__(self) -> None:
        _require_positive(self, "bias_filter_s", "bias_half_s")


@dataclass(frozen=True)
class FilterConfig:
    """Noise of accelerometer and legs."""

    acceleration_noise: float = 0.5  # m/s^2, for one reading
    acceleration_change: float = 0.3  # m/s^2 per m/s^2 of difference from the previous reading
    acceleration_bias: float = 0.2  # m/s^2, by a tilted or badly calibrated IMU
    acceleration_bias_drift: float = 0.01  # m/s^2 per root of a second
    leg_velocity_noise: float = 0.03  # m/s, for a stance leg; for others divided by contact squared
    swing_noise: float = 1000.0  # largest factor of this noise
    outlier_freedom: float = 4.0  # degrees of freedom of Student's t: fewer weaken outliers
    push_m_s: float = 0.17  # difference between stance legs and filter that shows a push
    push_filter_s: float = 0.01  # time constant of that difference

    def __post_init__(self) -> None:
        _require_positive(
            self,
            "acceleration_noise",
            "leg_velocity_noise",
            "swing_noise",
            "outlier_freedom",
            "push_m_s",
            "push_filter_s",
        )
        _require_not_negative(self, "acceleration_change", "acceleration_bias", "acceleration_bias_drift")


@dataclass(frozen=True)
class OdometryConfig:
    """Uncertainty of the pose in addition to the filter's noise."""

    level_ground: bool = True  # z is the height above the stance feet; otherwise the integrated velocity
    height_noise: float = 0.004  # m, error of the height above the stance feet, by soft feet and soles
    height_filter_s: float = 0.02  # time constant
    orientation_noise: float = 0.005  # rad, for one orientation reading of the IMU
    yaw_drift: float = 0.001  # rad per root of a second, drift of this orientation
    scale_error: float = 0.01  # share of the distance, by wrong limb lengths and creeping feet
    climb_error: float = 0.03  # share of the distance, error of the integrated z: feet sink in at touch-down
    slip: float = 0.01  # m per root of a metre walked
    fall_m: float = 0.3  # horizontal displacement in a fall, until the robot stands again
    creep_m_s: float = 0.005  # horizontal velocity of a foot in contact
    sink_m_s: float = 0.03  # vertical velocity of a foot in contact
    latency_s: float = 0.009  # rms delay of readings: up to 10 ms, and one or two ticks
    latency_filter_s: float = 0.1  # averaging time of velocity changes during this delay

    def __post_init__(self) -> None:
        _require_positive(self, "height_noise", "height_filter_s", "latency_filter_s")
        _require_not_negative(
            self, "orientation_noise", "yaw_drift", "scale_error", "climb_error", "slip", "fall_m"
        )
        _require_not_negative(self, "creep_m_s", "sink_m_s", "latency_s")


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of `BaseEstimator`."""

    attitude: AttitudeConfig = field(default_factory=AttitudeConfig)
    own_attitude: bool = False  # orientation from gyro, accelerometer and legs, starting with the IMU's
    contact: ContactConfig = field(default_factory=ContactConfig)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    filter: FilterConfig = field(default_factory=FilterConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
