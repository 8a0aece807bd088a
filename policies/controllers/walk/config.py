"""Settings of `Walk`, one dataclass per part."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_ordered, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.slope import SlopeConfig


@dataclass(frozen=True)
class StrideConfig:
    """Size of a step. Every field can be changed while the robot walks."""

    height_m: float  # of the foot at mid-swing
    length_m: float  # longest way of a foot backwards in one stance, which bounds the speed
    body_height_m: float  # base above the ground

    def __post_init__(self) -> None:
        require_positive(self, "length_m", "body_height_m")
        require_not_negative(self, "height_m")


@dataclass(frozen=True)
class StanceConfig:
    """Places of the feet at mid-stance."""

    outward_m: float = 0.0  # offset of each foot from its place in the default pose, away from the middle
    shift_m: float = 0.0  # forward offset of all feet
    sway: float = 0.0  # how far the body presses towards the middle of the feet that stand, as a share

    def __post_init__(self) -> None:
        require_not_negative(self, "sway")


@dataclass(frozen=True)
class LevellingConfig:
    """How the legs turn a tilted base back."""

    gain: float  # share of the measured tilt that the legs counter
    rate_gain_s: float
    filter_s: float  # time constant: the feet's velocity must not carry the gyro's noise
    most_rad: float  # largest correction
    body_rate_m_s: float  # how fast the body's height changes
    most_attitude_rad: float = 0.15  # largest roll and pitch that can be asked for
    attitude_rate_rad_s: float = 0.3  # how fast they are approached

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "rate_gain_s", "most_rad", "most_attitude_rad")
        require_positive(self, "filter_s", "body_rate_m_s", "attitude_rate_rad_s")


@dataclass(frozen=True)
class HeadingConfig:
    """How the walk keeps to the heading that the commanded yaw rate leads to, by the IMU."""

    gain: float  # 1/s, of the heading error; 0 disables the correction
    most_rad: float  # clamp of the heading error: a turn by a push beyond it is not corrected

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "most_rad")


@dataclass(frozen=True)
class TouchDownConfig:
    """When a foot counts as on the ground before or after its time."""

    # Two thresholds of a foot's force by the motors' torques, as shares of the weight per leg. A stance foot
    # below the first has found no ground. A swing foot above the second has touched down.
    force_share: tuple[float, float]
    filter_s: float  # time constant of that force
    inertia_doubt: float  # share by which the joints' inertia may exceed the description's
    from_progress: float  # progress of the swing from which forces count
    probe_m: float  # how far a foot that finds no ground at its time is lowered
    probe_m_s: float  # speed of that lowering

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        require_positive(self, "filter_s", "probe_m_s")
        require_between(self, 0.0, 1.0, "from_progress")
        require_not_negative(self, "inertia_doubt", "probe_m")


@dataclass(frozen=True)
class LimitsConfig:
    """Limits of the walk, which slows down to keep them."""

    rate_share: float  # of the robot's joint rate limit that the gait may use
    margin_m: float | None = None  # least static stability margin; None: every gait is dynamic
    dynamic_swing_s: float = 0.0  # a gait with swings up to this long is dynamic: it needs no margin

    def __post_init__(self) -> None:
        require_between(self, 0.05, 1.0, "rate_share")
        require_not_negative(self, "margin_m", "dynamic_swing_s")


@dataclass(frozen=True)
class WalkConfig:
    """Everything about `Walk` that depends on the robot."""

    rate_hz: float
    gait: GaitConfig
    command: CommandShaping
    step: StrideConfig
    levelling: LevellingConfig
    heading: HeadingConfig
    limits: LimitsConfig
    kp: float  # N m/rad
    kd: float  # N m s/rad
    weight_n: float  # carried by the legs in stance, as feed-forward torque
    settle_s: float  # time to move from the pose found at reset to the stance
    stance: StanceConfig = StanceConfig()
    touch_down: TouchDownConfig | None = None  # None: the gait clock alone decides
    gaits: tuple[str, ...] | None = None  # beside its own, that it can change to; None: all of the robot
    slope: SlopeConfig | None = None  # None: ground counts as level

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "kp", "settle_s")
        require_not_negative(self, "kd", "weight_n")
