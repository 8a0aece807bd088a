"""Settings of the velocity-tracking environment, as written in a preset's YAML."""

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Literal

from footfall.common.config import (
    merged,
    require_between,
    require_not_negative,
    require_ordered,
    require_positive,
    takes_other_keys,
    unstructure,
)
from footfall.common.limits import MAX_COMMAND
from footfall.common.terms import NamedTermConfig, TermConfig
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.policies.contract import MAX_CONTROL_HZ
from footfall.robots.commands import CommandRange
from footfall.robots.self_contact import Contacts
from footfall.terrain.declaration import GroundConfig

CRITIC = ("linear_velocity", "height", "contact", "clearance", "torque")  # default terms of the critic
MIN_SUBSTEPS = 2  # a foot's velocity is the difference of its last two positions in a control step


@dataclass(frozen=True)
class GaitConfig:
    """The gait, its clock, and how high its reference motion lifts the feet (0: no reference)."""

    name: str  # in policies/gaits.yaml
    frequency_hz: float = 2.2
    reference_lift_m: float = 0.0

    def __post_init__(self) -> None:
        require_between(self, 0.05, 50.0, "frequency_hz")
        require_between(self, 0.0, 1.0, "reference_lift_m")


@takes_other_keys("settings")
@dataclass(frozen=True)
class CommandConfig:
    """How velocity commands are drawn: a term of envs/terms/commands.py."""

    ranges: CommandRange
    hold_s: Distribution = Distribution(3.0, 8.0)
    standing_probability: float = 0.1
    single_axis_probability: float = 0.3  # only one of the three components is kept
    standing_command: float = 0.1  # norm below which a command means to stand still; 0: step in place
    term: str = "velocity"
    settings: dict[str, Any] = field(default_factory=dict)  # parameters of a user's own term

    def __post_init__(self) -> None:
        require_not_negative(self, "standing_command")
        require_between(self, 0.0, 1.0, "standing_probability", "single_axis_probability")
        require_ordered(self.ranges, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        require_between(self.ranges, -MAX_COMMAND, MAX_COMMAND, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        require_positive(self.hold_s, "low")


@takes_other_keys("settings")
@dataclass(frozen=True)
class ObservationConfig(TermConfig):
    """An entry of `observation`: a term of policies/observation.py."""

    scale: float = 1.0
    history: int = 1  # control steps

    def __post_init__(self) -> None:
        require_positive(self, "history")


@takes_other_keys("settings")
@dataclass(frozen=True)
class RewardConfig(NamedTermConfig):
    """An entry of `rewards`: a term of envs/terms/rewards.py."""

    weight: float


@takes_other_keys("settings")
@dataclass(frozen=True)
class EventConfig(NamedTermConfig):
    """An entry of `events`: a term of envs/terms/events.py."""

    interval_s: Distribution | None = None  # between two events; None: the term's own, or at each reset

    def __post_init__(self) -> None:
        if self.interval_s is not None:
            require_positive(self.interval_s, "low")


@takes_other_keys("settings")
@dataclass(frozen=True)
class CurriculumConfig(NamedTermConfig):
    """An entry of `curricula`: a term of envs/terms/curricula.py."""

    of: str  # "commands", "randomisation", or the name of an event

    @property
    def label(self) -> str:
        """Its name; by default the name of the event or section that it acts on."""
        return self.name or self.of


@dataclass(frozen=True)
class TerrainConfig:
    """The ground of a training: kinds of ground at rising levels of difficulty (see docs/terrain.md)."""

    grounds: tuple[GroundConfig, ...]  # a parameter given as [easiest, hardest] rises with the level
    levels: int = 10
    start_levels: int = 3  # number of lowest levels at which the first episodes begin
    up_share: float = 0.8  # share of the commanded path from which on the next episode is a level harder
    down_share: float = 0.4  # below this share, or after a fall, it is a level easier
    spread_m: float = 2.0  # half the side of the square in which episodes begin
    seed: int = 0  # of random heights
    exact_friction: bool = False  # feet have the friction cone of the simulated robot

    def __post_init__(self) -> None:
        require_between(self, 2, 100, "levels")
        require_between(self, 1, self.levels, "start_levels")
        require_between(self, 0.0, 1.0, "up_share", "down_share")
        require_between(self, 0.0, 100.0, "spread_m")
        require_between(self, 0, 2**31 - 1, "seed")
        if not self.grounds:
            raise ValueError("grounds: give at least one")
        if len({(ground.size_m, ground.cell_m) for ground in self.grounds}) > 1:
            raise ValueError("grounds must all have the same size_m and cell_m")


@dataclass(frozen=True)
class EnvConfig:
    """All settings of the environment."""

    observation: tuple[ObservationConfig, ...]
    commands: CommandConfig
    rewards: tuple[RewardConfig, ...]
    reward_floor: float = -0.2  # lower limit of the weighted sum of all rewards except `fall`
    terminations: tuple[NamedTermConfig, ...] = (NamedTermConfig("tilted"), NamedTermConfig("sunk"))
    critic: tuple[NamedTermConfig, ...] = tuple(map(NamedTermConfig, CRITIC))
    events: tuple[EventConfig, ...] = (EventConfig("reset_pose"),)
    curriculum_steps: int = 0  # environment steps in which the level rises from 0 to 1; 0: 1 from the start
    curricula: tuple[CurriculumConfig, ...] = ()
    task: str = ""  # MODULE:NAME of a function from robot and configuration to an Environment
    # generated: code for this robot, on GPU or CPU. mjx: wherever JAX runs. c: MuJoCo C, on all cores.
    physics: Literal["generated", "mjx", "c"] = "generated"
    contacts: Contacts = "feet"  # which shapes touch; with any choice except `feet`, joint limits act too
    control_rate_hz: float = 50.0
    substeps: int = 4  # physics steps per control step
    action_scale: float = 1.0  # multiplies the robot's own: how far joints move per unit of action
    episode_s: float = 20.0
    speed_limit: float = 100.0  # generalised velocity above which the simulation counts as diverged
    gait: GaitConfig | None = None
    terrain: TerrainConfig | None = None  # None: level ground
    randomisation: Randomisation = field(default_factory=Randomisation)
    noise: Noise = field(default_factory=Noise)
    height_scan_errors: HeightScanErrors = field(default_factory=HeightScanErrors)

    @property
    def weights(self) -> dict[str, float]:
        """The weight of each reward, by its name."""
        return {entry.label: entry.weight for entry in self.rewards}

    @property
    def whole_body(self) -> bool:
        """Whether all collision shapes can touch the ground, not only the feet."""
        return self.contacts != "feet"

    @property
    def timestep_s(self) -> float:
        """Length of a physics step."""
        return 1.0 / self.control_rate_hz / self.substeps

    def __post_init__(self) -> None:
        require_between(self, 1.0, MAX_CONTROL_HZ, "control_rate_hz")
        require_positive(self, "episode_s", "speed_limit")
        require_between(self, 0.01, 100.0, "action_scale")
        require_not_negative(self, "curriculum_steps")
        require_between(self, -1e6, 0.0, "reward_floor")
        if self.episode_s * self.control_rate_hz < 1.0:
            period_s = 1.0 / self.control_rate_hz
            raise ValueError(f"episode_s {self.episode_s:g} is shorter than a control step, {period_s:g} s")
        if self.whole_body and self.terrain is not None:
            raise ValueError(f"contacts '{self.contacts}' needs level ground: leave out terrain")
        if self.substeps < MIN_SUBSTEPS:
            raise ValueError(f"substeps must be at least {MIN_SUBSTEPS}, not {self.substeps}")


TERM_LISTS = ("rewards", "terminations", "critic", "events", "curricula")


def with_lists(env: Any) -> Any:
    """Settings of an environment, as read from YAML, where a mapping by name becomes a list of terms.

    The mapping replaces settings of the default list (see `footfall.common.config.merged`).
    """
    if not isinstance(env, dict):
        return env
    lists = {
        name: merged(default_terms(name), env[name]) for name in TERM_LISTS if isinstance(env.get(name), dict)
    }
    return env | lists


def default_terms(name: str) -> list[Any]:
    """The default of a list of terms, as plain data."""
    (default,) = (each.default for each in fields(EnvConfig) if each.name == name)
    return [] if default is MISSING else unstructure(default)
