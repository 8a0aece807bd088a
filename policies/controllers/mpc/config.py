"""Settings of the MPC controller, one dataclass per part."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_ordered, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.slope import SlopeConfig

Triple = tuple[float, float, float]
Range = tuple[float, float]


@dataclass(frozen=True)
class Horizon:
    """How far ahead the quadratic programme looks, and how often it is solved."""

    steps: int
    step_s: float
    solve_hz: float

    def __post_init__(self) -> None:
        require_positive(self, "steps", "step_s", "solve_hz")


@dataclass(frozen=True)
class Weights:
    """Cost of squared deviations from the reference at each step, of squared forces and of their changes."""

    attitude: Triple  # roll, pitch, yaw, per rad^2
    position: Triple  # per m^2
    angular_rate: Triple  # per (rad/s)^2
    velocity: Triple  # per (m/s)^2
    force: float  # per N^2, about an even share of the weight; above 0, so that there is one best plan
    force_change: float = 0.0  # per N^2, from step to step, and from what the foot pressed with before
    moment: float = 1.0e-3  # per (N m)^2, of soles

    def __post_init__(self) -> None:
        require_positive(self, "force", "moment")
        require_not_negative(self, "attitude", "position", "angular_rate", "velocity", "force_change")


@dataclass(frozen=True)
class Contact:
    """What a foot may press with."""

    friction: float  # coefficient that the controller counts on
    most_force_n: float  # upward
    slipping_friction: float = 0.12  # counted on while feet slip
    slip_m_s: float = 0.08  # of a standing foot against the others, from which on it slips
    careful_s: float = 4.0  # how long after that
    # Of a sole, in which its centre of pressure may be; 0: feet are points. Only `mpc-wbc` controls it.
    sole_share: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "friction", "most_force_n", "slipping_friction", "slip_m_s")
        require_not_negative(self, "careful_s")
        require_between(self, 0.0, 1.0, "sole_share")


@dataclass(frozen=True)
class StanceConfig:
    """Where the base is held, and the legs that hold it."""

    height_m: float  # base above the ground
    outward_m: float  # of each foot, from its place in the default pose away from the middle
    shift_m: float  # of all feet, forward
    kd: float  # N m s/rad, about the joint velocities of the commanded motion
    most_position_lead_m: float  # farthest that the position reference runs ahead of the body
    most_yaw_lead_rad: float

    def __post_init__(self) -> None:
        require_positive(self, "height_m")
        require_not_negative(self, "kd", "most_position_lead_m", "most_yaw_lead_rad")


@dataclass(frozen=True)
class SwingConfig:
    """How feet fly."""

    height_m: float
    depth_m: float  # how far below the ground a swing aims, to touch down firmly
    kp: float  # N m/rad, of the joints' impedance around the trajectory
    kd: float  # N m s/rad

    def __post_init__(self) -> None:
        require_not_negative(self, "height_m", "depth_m", "kp", "kd")


@dataclass(frozen=True)
class CatchConfig:
    """Where a biped's foot lands, from the middle of the other one."""

    apart_m: float  # sideways, of a steady gait
    ahead_m: Range  # least and most
    sideways_m: Range  # the same, to the foot's own side

    def __post_init__(self) -> None:
        require_positive(self, "apart_m")
        require_ordered(self, "ahead_m", "sideways_m")


@dataclass(frozen=True)
class FootholdConfig:
    """Where feet land (see `policies/controllers/mpc/footholds.py`)."""

    capture_gain_s: float
    most_step_m: float
    catch: CatchConfig | None = None  # for two feet, instead of what is above

    def __post_init__(self) -> None:
        require_not_negative(self, "capture_gain_s", "most_step_m")


@dataclass(frozen=True)
class Restart:
    """When a robot takes steps although the command is to stand."""

    start_speed_m_s: float  # of the base, above which it begins to step
    stop_speed_m_s: float  # below which it stands again
    start_tilt_rad: float
    calm_s: float  # how long it must have been calm
    most_off_m: float = 1.0  # of the capture point from the middle of the feet that stand, before it steps

    def __post_init__(self) -> None:
        require_not_negative(self, "start_speed_m_s", "stop_speed_m_s", "start_tilt_rad", "calm_s")
        require_not_negative(self, "most_off_m")


@dataclass(frozen=True)
class MpcConfig:
    """Everything about `Mpc` that depends on the robot."""

    rate_hz: float
    gait: GaitConfig
    command: CommandShaping
    horizon: Horizon
    weights: Weights
    contact: Contact
    stance: StanceConfig
    swing: SwingConfig
    foothold: FootholdConfig
    restart: Restart
    friction_compensation: float  # share of the gearbox friction that is fed forward
    settle_s: float  # time to move from the height found at reset to the stance, before any step
    gaits: tuple[str, ...] = ()  # that it can change to while it walks, its own among them
    most_attitude_rad: float = 0.1  # largest roll and pitch that can be asked for
    slope: SlopeConfig | None = None  # None: ground counts as level
    legs_turn_base: bool = False  # swinging legs turn the base the other way: matters where no foot stands

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "settle_s")
        require_not_negative(self, "friction_compensation", "most_attitude_rad")
