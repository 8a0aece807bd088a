"""Settings of the base estimator: noise figures are standard deviations."""

from dataclasses import dataclass, field

from footfall.common.config import require_not_negative, require_ordered, require_positive


@dataclass(frozen=True)
class ContactConfig:
    """Contact detection. Forces are shares of the force on each foot while all feet stand."""

    force_share: tuple[float, float] = (0.2, 0.8)  # no contact below the first, certain above the second
    force_filter_s: float = 0.006  # time constant of the force estimate
    rise_s: float = 0.03  # time constant with which trust grows: a foot that lands bounces and slips first
    carried_share: float = 0.3  # of gravity, upwards: the accelerometer of a robot on its feet reads more
    level_m: float = 0.0015  # corners of a sole that differ less in height share its load
    sensor_error_share: float = 0.5  # mean error by the motors' torques from which a force sensor is ignored
    sensor_filter_s: float = 0.5  # averaging time of that error
    sensor_trial_s: float = 1.0  # time from rest until a sensor that is not believed is noted

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        if self.force_share[0] == self.force_share[1]:
            raise ValueError("force_share must rise from its first number to its second")
        require_positive(self, "force_filter_s", "rise_s", "carried_share", "level_m")
        require_positive(self, "sensor_error_share", "sensor_filter_s")
        require_not_negative(self, "sensor_trial_s")


@dataclass(frozen=True)
class AttitudeConfig:
    """Trust in gyro and accelerometer of an IMU that gives no orientation."""

    rest_s: float = 0.5  # at rest, over which the first readings are averaged
    rest_rad_s: float = 0.15  # largest reading of the gyro at rest: its bias and its noise
    start_tilt: float = 0.01  # rad, of the first attitude: a badly calibrated accelerometer
    start_bias: float = 0.0015  # rad/s, of the gyro's bias after the first rest
    gyro_noise: float = 0.005  # rad per root of a second
    bias_drift: float = 0.001  # rad/s per root of a second
    acceleration_noise: float = 0.5  # m/s^2 times root of a second: the base's own acceleration
    legs_bias_hz: float = 0.7  # rate at which tilt that standing legs correct counts as the gyro's bias

    def __post_init__(self) -> None:
        require_positive(self, *self.__dataclass_fields__)


@dataclass(frozen=True)
class GyroConfig:
    """Speed of learning the gyro's bias."""

    bias_filter_s: float = 10.0  # averaging time in the long run
    bias_half_s: float = 0.2  # time of 50 % trust: noise of the orientation over the usual bias

    def __post_init__(self) -> None:
        require_positive(self, "bias_filter_s", "bias_half_s")


@dataclass(frozen=True)
class FilterConfig:
    """Trust in accelerometer and legs."""

    acceleration_noise: float = 0.5  # m/s^2, of one reading
    acceleration_change: float = 0.3  # m/s^2 per m/s^2 by which a reading differs from the one before
    acceleration_bias: float = 0.2  # m/s^2, of a tilted or badly calibrated IMU
    acceleration_bias_drift: float = 0.01  # m/s^2 per root of a second
    leg_velocity_noise: float = 0.03  # m/s, of a standing leg; for others divided by contact squared
    swing_noise: float = 1000.0  # largest factor on it
    outlier_freedom: float = 4.0  # degrees of freedom of Student's distribution: fewer forgive more
    push_m_s: float = 0.17  # larger difference between standing legs and filter: the robot was pushed
    push_filter_s: float = 0.01  # time constant of that difference

    def __post_init__(self) -> None:
        require_positive(
            self,
            "acceleration_noise",
            "leg_velocity_noise",
            "swing_noise",
            "outlier_freedom",
            "push_m_s",
            "push_filter_s",
        )
        require_not_negative(self, "acceleration_change", "acceleration_bias", "acceleration_bias_drift")


@dataclass(frozen=True)
class OdometryConfig:
    """Uncertainty of the pose beyond the filter's own noise."""

    level_ground: bool = True  # z is the height above the standing feet; otherwise integrated velocity
    height_noise: float = 0.004  # m, of the height above the standing feet: soft feet and soles
    height_filter_s: float = 0.02  # time constant
    orientation_noise: float = 0.005  # rad, of one reading of the IMU's orientation
    yaw_drift: float = 0.001  # rad per root of a second, of the same orientation
    scale_error: float = 0.01  # share of the distance: limbs longer than described, feet that creep
    climb_error: float = 0.03  # share of the distance, of integrated z: feet sink in as they land
    slip: float = 0.01  # m per root of a metre walked
    fall_m: float = 0.3  # horizontal displacement in a fall, until the robot stands again
    creep_m_s: float = 0.005  # horizontal velocity of a foot in estimated contact
    sink_m_s: float = 0.03  # its vertical velocity
    latency_s: float = 0.009  # delay of readings, root mean square: up to 10 ms, and a tick or two
    latency_filter_s: float = 0.1  # averaging time of velocity changes within that delay

    def __post_init__(self) -> None:
        require_positive(self, "height_noise", "height_filter_s", "latency_filter_s")
        require_not_negative(
            self, "orientation_noise", "yaw_drift", "scale_error", "climb_error", "slip", "fall_m"
        )
        require_not_negative(self, "creep_m_s", "sink_m_s", "latency_s")


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of `BaseEstimator`."""

    attitude: AttitudeConfig = field(default_factory=AttitudeConfig)
    own_attitude: bool = False  # gyro, accelerometer and legs give the orientation, which began as the IMU's
    contact: ContactConfig = field(default_factory=ContactConfig)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    filter: FilterConfig = field(default_factory=FilterConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
