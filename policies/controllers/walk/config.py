"""Settings of `Walk`, one dataclass for each part."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_ordered, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.slope import SlopeConfig
from footfall.policies.policy import RATES_HZ


@dataclass(frozen=True)
class StrideConfig:
    """Dimensions of a step. Every field can be changed while the robot walks."""

    height_m: float  # height of the foot at mid-swing
    length_m: float  # longest travel of a foot relative to the body in one stance, which limits the speed
    body_height_m: float  # height of the base above the ground

    def __post_init__(self) -> None:
        require_positive(self, "length_m", "body_height_m")
        require_not_negative(self, "height_m")


@dataclass(frozen=True)
class StanceConfig:
    """Positions of the feet at mid-stance."""

    outward_m: float = 0.0  # shift of each foot from its position in the default pose, outward
    shift_m: float = 0.0  # forward shift of all feet
    sway: float = 0.0  # sway of the centre of pressure towards the middle of the stance feet, as a share

    def __post_init__(self) -> None:
        require_not_negative(self, "sway")


@dataclass(frozen=True)
class LevellingConfig:
    """How the legs correct a tilted base."""

    gain: float  # share of the measured tilt that the legs correct
    rate_gain_s: float  # s, correction per tilt rate
    filter_s: float  # time constant that keeps the gyro's noise out of the feet's velocity
    max_rad: float  # largest correction
    body_rate_m_s: float  # rate of change of the body's height
    max_attitude_rad: float = 0.15  # largest roll and pitch of the live settings
    attitude_rate_rad_s: float = 0.3  # rate of change of roll and pitch

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "rate_gain_s", "max_rad", "max_attitude_rad")
        require_positive(self, "filter_s", "body_rate_m_s", "attitude_rate_rad_s")


@dataclass(frozen=True)
class HeadingConfig:
    """Correction of the heading by the IMU. The desired heading is the integral of the commanded yaw rate."""

    gain: float  # 1/s, correction per heading error; 0 disables it
    max_rad: float  # clamp of the heading error: a larger turn, by a push, is not corrected

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "max_rad")


@dataclass(frozen=True)
class TouchDownConfig:
    """Detection of a touch-down earlier or later than planned."""

    # Two thresholds of a foot's force, estimated from motor torques, as shares of the weight per leg. Below
    # the first, a stance foot has no contact. Above the second, a swing foot has touched down.
    force_share: tuple[float, float]
    filter_s: float  # time constant of the force
    inertia_uncertainty: float  # share by which the joints' inertia may exceed the description's
    from_progress: float  # progress of the swing from which forces are checked
    probe_m: float  # largest lowering of a stance foot without contact
    probe_m_s: float  # speed of that lowering

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        require_positive(self, "filter_s", "probe_m_s")
        require_between(self, 0.0, 1.0, "from_progress")
        require_not_negative(self, "inertia_uncertainty", "probe_m")


@dataclass(frozen=True)
class LimitsConfig:
    """Limits of the walk. The walk slows down to satisfy them."""

    rate_share: float  # usable share of the robot's joint rate limit
    margin_m: float | None = None  # smallest static stability margin; None: every gait is dynamic
    dynamic_swing_s: float = 0.0  # a gait with swings up to this long is dynamic: the margin does not apply

    def __post_init__(self) -> None:
        require_between(self, 0.05, 1.0, "rate_share")
        require_not_negative(self, "margin_m", "dynamic_swing_s")


@dataclass(frozen=True)
class WalkConfig:
    """Settings of `Walk` that depend on the robot."""

    rate_hz: float
    gait: GaitConfig
    command: CommandShaping
    step: StrideConfig
    levelling: LevellingConfig
    heading: HeadingConfig
    limits: LimitsConfig
    kp: float  # N m/rad
    kd: float  # N m s/rad
    weight_n: float  # weight carried by the stance legs, as feed-forward torque
    settle_s: float  # duration of the move from the pose at reset to the stance
    stance: StanceConfig = StanceConfig()
    touch_down: TouchDownConfig | None = None  # None: only the gait clock decides
    gaits: tuple[str, ...] | None = None  # gaits to change to, besides its own; None: all of the robot
    slope: SlopeConfig | None = None  # None: the ground is assumed to be level

    def __post_init__(self) -> None:
        require_between(self, *RATES_HZ, "rate_hz")
        require_positive(self, "kp", "settle_s")
        require_not_negative(self, "kd", "weight_n")
