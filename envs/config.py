"""Settings of the velocity-tracking environment, as they stand in a preset's YAML."""

from dataclasses import dataclass, field, fields
from typing import Literal

from footfall.common.config import (
    require_between,
    require_not_negative,
    require_ordered,
    require_positive,
)
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.policies.contract import Term
from footfall.robots.commands import CommandRange

FASTEST_CONTROL_HZ = 1000.0  # no learned policy is run faster
FASTEST = 100.0  # m/s or rad/s: no legged robot is; more is a unit mistaken
LEAST_SUBSTEPS = 2  # a foot's velocity is the difference of its last two positions in a control step


@dataclass(frozen=True)
class GaitConfig:
    """The gait, its clock, and how high its reference motion lifts the feet (0: no reference)."""

    name: str  # in policies/gaits.yaml
    frequency_hz: float = 2.2
    reference_lift_m: float = 0.0

    def __post_init__(self) -> None:
        require_between(self, 0.05, 50.0, "frequency_hz")
        require_between(self, 0.0, 1.0, "reference_lift_m")


@dataclass(frozen=True)
class CommandConfig:
    """How velocity commands are drawn."""

    ranges: CommandRange
    hold_s: Distribution = Distribution(3.0, 8.0)
    standing_probability: float = 0.1
    single_axis_probability: float = 0.3  # only one of the three components is kept
    standing_command: float = 0.1  # commands of a smaller norm mean: stand still; 0: step in place

    def __post_init__(self) -> None:
        require_not_negative(self, "standing_command")
        require_between(self, 0.0, 1.0, "standing_probability", "single_axis_probability")
        require_ordered(self.ranges, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        require_between(self.ranges, -FASTEST, FASTEST, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        require_positive(self.hold_s, "low")


@dataclass(frozen=True)
class InitialState:
    """Half-widths of uniform offsets from the default pose, standing still."""

    joint_rad: float = 0.1
    tilt_rad: float = 0.1
    velocity_m_s: float = 0.3
    yaw_rate_rad_s: float = 0.3
    joint_velocity_rad_s: float = 0.5

    def __post_init__(self) -> None:
        require_between(self, 0.0, FASTEST, *(field.name for field in fields(self)))


@dataclass(frozen=True)
class PushConfig:
    """Pushes: a sudden change of the base's velocity."""

    interval_s: Distribution = Distribution(2.0, 6.0)
    horizontal_m_s: float = 0.0  # largest, in a random direction
    vertical_m_s: float = 0.0
    angular_rad_s: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self.interval_s, "low")
        require_between(self, 0.0, FASTEST, "horizontal_m_s", "vertical_m_s", "angular_rad_s")


@dataclass(frozen=True)
class Curriculum:
    """The task's level rises linearly from 0 to 1 over `steps` environment steps (0: full from the start).

    At level 0 the shares below apply; at level 1 everything does.
    """

    steps: int = 0
    commands: float = 1.0  # share of the command ranges at level 0
    pushes: float = 1.0  # share of the pushes' strength at level 0
    randomisation: float = 1.0  # share of robots' distance from the nominal one at level 0

    def __post_init__(self) -> None:
        require_not_negative(self, "steps")
        require_between(self, 0.0, 1.0, "commands", "pushes", "randomisation")


@dataclass(frozen=True)
class RewardScales:
    """Shapes of the rewards, apart from their weights."""

    linear_sigma_m2_s2: float = 0.25
    yaw_sigma_rad2_s2: float = 0.25
    swing_height_m: float = 0.08
    foot_distance_m: float = 0.12  # between two feet, from which on `crowded_feet` is 0
    least: float = -0.2  # the weighted sum of all but `fall` is clipped below here
    # How much joints count in `pose`, by pattern of their names (*, ?, [...]): the first that fits, else 1.
    pose_shares: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_between(self, 1e-6, 1e6, "linear_sigma_m2_s2", "yaw_sigma_rad2_s2")
        require_between(self, 0.001, 1.0, "swing_height_m", "foot_distance_m")


@dataclass(frozen=True)
class EnvConfig:
    """All settings of the environment."""

    observation: tuple[Term, ...]
    commands: CommandConfig
    rewards: dict[str, float]  # weight of each term of envs/rewards.py
    # Generated for the robot, for GPUs and processors; MJX, for all that JAX runs on; MuJoCo C, on all cores.
    physics: Literal["generated", "mjx", "c"] = "generated"
    control_rate_hz: float = 50.0
    substeps: int = 4  # physics steps per control step
    episode_s: float = 20.0
    tilt_limit_rad: float = 1.1
    least_height_share: float = 0.55  # of the standing height, before the episode ends
    speed_limit: float = 100.0  # generalised velocity above which the simulation counts as diverged
    gait: GaitConfig | None = None
    reward_scales: RewardScales = RewardScales()
    initial: InitialState = InitialState()
    pushes: PushConfig = PushConfig()
    curriculum: Curriculum = Curriculum()
    randomisation: Randomisation = field(default_factory=Randomisation)
    noise: Noise = field(default_factory=Noise)

    @property
    def timestep_s(self) -> float:
        """Length of a physics step."""
        return 1.0 / self.control_rate_hz / self.substeps

    def __post_init__(self) -> None:
        require_between(self, 1.0, FASTEST_CONTROL_HZ, "control_rate_hz")
        require_positive(self, "episode_s", "tilt_limit_rad", "speed_limit")
        require_between(self, 0.0, 1.0, "least_height_share")
        if self.episode_s * self.control_rate_hz < 1.0:
            period_s = 1.0 / self.control_rate_hz
            raise ValueError(f"episode_s {self.episode_s:g} is shorter than a control step, {period_s:g} s")
        if self.substeps < LEAST_SUBSTEPS:
            raise ValueError(f"substeps must be at least {LEAST_SUBSTEPS}, not {self.substeps}")
