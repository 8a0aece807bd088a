"""Settings of `Walk`, one dataclass per part."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_ordered, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.gait import GaitConfig


@dataclass(frozen=True)
class StrideConfig:
    """What a step is like. All of it may be changed while the robot walks."""

    height_m: float  # of the foot at mid-swing
    length_m: float  # that a foot is carried back in one stance at most; it bounds the speed
    body_height_m: float  # base above the ground

    def __post_init__(self) -> None:
        require_positive(self, "length_m", "body_height_m")
        require_not_negative(self, "height_m")


@dataclass(frozen=True)
class StanceConfig:
    """Where feet stand in the middle of their stance."""

    outward_m: float = 0.0  # of each foot, from its place in the default pose away from the middle
    shift_m: float = 0.0  # of all feet, forward
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

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "rate_gain_s", "most_rad")
        require_positive(self, "filter_s", "body_rate_m_s")


@dataclass(frozen=True)
class HeadingConfig:
    """How the walk keeps to the heading that the commanded yaw rate leads to, by the IMU."""

    gain: float  # 1/s, of the heading's error; 0: it keeps to none
    most_rad: float  # largest error that counts: what a shove turns beyond that is forgotten

    def __post_init__(self) -> None:
        require_not_negative(self, "gain", "most_rad")


@dataclass(frozen=True)
class TouchDownConfig:
    """When a foot counts as on the ground before or after its time."""

    # Of an even share of the weight, by the motors' torques: a foot that should stand and bears less than the
    # first has found no ground, one in the air that bears more than the second has.
    force_share: tuple[float, float]
    filter_s: float  # time constant of that force
    inertia_doubt: float  # share by which the joints' inertia may exceed the description's
    from_progress: float  # of the swing, before which no force counts
    probe_m: float  # how far a foot that finds no ground at its time is lowered
    probe_m_s: float  # and how fast

    def __post_init__(self) -> None:
        require_ordered(self, "force_share")
        require_positive(self, "filter_s", "probe_m_s")
        require_between(self, 0.0, 1.0, "from_progress")
        require_not_negative(self, "inertia_doubt", "probe_m")


@dataclass(frozen=True)
class LimitsConfig:
    """What the walk must keep to; it slows down rather than break it."""

    rate_share: float  # of the robot's joint rate limit that the gait may use
    margin_m: float | None = None  # least static stability margin; none: all gaits are dynamic ones
    dynamic_swing_s: float = 0.0  # a gait whose swings are no longer than this is one: it needs no margin

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
    touch_down: TouchDownConfig | None = None  # none: feet stand by the clock alone

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "kp", "settle_s")
        require_not_negative(self, "kd", "weight_n")
