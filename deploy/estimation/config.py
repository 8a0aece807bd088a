"""Settings of the base estimator: noise figures are standard deviations."""

from dataclasses import dataclass, field

from footfall.common.config import require_not_negative, require_ordered, require_positive


@dataclass(frozen=True)
class ContactConfig:
    """When a foot stands. Forces are shares of that on each foot of a robot that stands on all of them."""

    force_share: tuple[float, float] = (0.2, 0.8)  # no contact below the first, certain above the second
    force_filter_s: float = 0.006  # time constant of the force estimate
    rise_s: float = 0.03  # time constant with which trust grows: a foot that lands bounces and slips first
    level_m: float = 0.0015  # corners of a sole that differ less in height share its load

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        if self.force_share[0] == self.force_share[1]:
            raise ValueError("force_share must rise from its first number to its second")
        require_positive(self, "force_filter_s", "rise_s", "level_m")


@dataclass(frozen=True)
class GyroConfig:
    """How fast the gyro's bias is learnt."""

    bias_filter_s: float = 10.0  # over which it is averaged in the long run
    bias_half_s: float = 0.2  # after which half of it is believed: the orientation's noise by the usual bias

    def __post_init__(self) -> None:
        require_positive(self, "bias_filter_s", "bias_half_s")


@dataclass(frozen=True)
class FilterConfig:
    """How far accelerometer and legs are believed."""

    acceleration_noise: float = 0.5  # m/s^2, of one reading
    acceleration_change: float = 0.3  # m/s^2 per m/s^2 by which a reading differs from the one before
    acceleration_bias: float = 0.2  # m/s^2, of a tilted or badly calibrated IMU
    acceleration_bias_drift: float = 0.01  # m/s^2 per root of a second
    leg_velocity_noise: float = 0.03  # m/s, of what a standing leg says; by its contact squared of another
    swing_noise: float = 1000.0  # factor on that, at most
    outlier_freedom: float = 4.0  # degrees of freedom of Student's distribution: fewer forgive more
    push_m_s: float = 0.17  # all standing legs differ by more from the filter: the robot was pushed
    push_filter_s: float = 0.01  # for about so long

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
    """What the pose is uncertain by, beyond the filter's own noise."""

    level_ground: bool = True  # the way up is the height above the standing feet; else integrated velocity
    height_noise: float = 0.004  # m, of the height above the standing feet: soft feet and soles
    height_filter_s: float = 0.02  # time constant
    orientation_noise: float = 0.005  # rad, of one reading of the IMU's orientation
    yaw_drift: float = 0.001  # rad per root of a second, of the same
    scale_error: float = 0.01  # share of the way: limbs not as long as the description says, feet that creep
    climb_error: float = 0.03  # share of the way, of an integrated way up: feet sink in as they land
    slip: float = 0.01  # m per root of a metre walked
    creep_m_s: float = 0.005  # horizontal velocity of a foot that is thought to stand
    sink_m_s: float = 0.03  # vertical velocity of the same
    latency_s: float = 0.009  # that readings are late, root mean square: up to 10 ms, and a tick or two
    latency_filter_s: float = 0.1  # time constant over which changes of the velocity within that are averaged

    def __post_init__(self) -> None:
        require_positive(self, "height_noise", "height_filter_s", "latency_filter_s")
        require_not_negative(self, "orientation_noise", "yaw_drift", "scale_error", "climb_error", "slip")
        require_not_negative(self, "creep_m_s", "sink_m_s", "latency_s")


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of `BaseEstimator`."""

    contact: ContactConfig = field(default_factory=ContactConfig)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    filter: FilterConfig = field(default_factory=FilterConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
