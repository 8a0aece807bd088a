"""Settings of the MPC controller, one dataclass for each part."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_ordered, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.slope import SlopeConfig
from footfall.policies.policy import RATES_HZ

Triple = tuple[float, float, float]
Range = tuple[float, float]

STEPS_S = (0.001, 1.0)  # shortest and longest step: in a second any robot falls over
MAX_HORIZON_STEPS = 200  # the quadratic program grows with the square of the steps


@dataclass(frozen=True)
class Horizon:
    """Length of the prediction horizon, and how often the quadratic program is solved."""

    steps: int
    step_s: float  # duration of a step
    solve_hz: float  # solutions per second

    def __post_init__(self) -> None:
        require_positive(self, "solve_hz")
        require_between(self, *STEPS_S, "step_s")
        require_between(self, 1, MAX_HORIZON_STEPS, "steps")


@dataclass(frozen=True)
class Weights:
    """Cost of squared deviations from the reference at each step, of squared forces and of their changes."""

    attitude: Triple  # roll, pitch, yaw, per rad^2
    position: Triple  # per m^2
    angular_rate: Triple  # per (rad/s)^2
    velocity: Triple  # per (m/s)^2
    force: float  # per N^2, deviation from an equal share of the weight; > 0, so that the optimum is unique
    force_change: float = 0.0  # per N^2, change between steps, and from the force applied before
    moment: float = 1.0e-3  # per (N m)^2, moments on soles

    def __post_init__(self) -> None:
        require_positive(self, "force", "moment")
        require_not_negative(self, "attitude", "position", "angular_rate", "velocity", "force_change")


@dataclass(frozen=True)
class Contact:
    """Limits of a foot's force and moment."""

    friction: float  # friction coefficient that planned forces may use
    max_force_n: float  # largest upward force
    slipping_friction: float = 0.12  # replaces `friction` while feet slip
    slip_m_s: float = 0.08  # velocity of a stance foot relative to the others, above which it slips
    careful_s: float = 4.0  # how long `slipping_friction` applies after a slip
    # Share of a sole in which its centre of pressure may be; 0: point feet. Only `mpc-wbc` controls it.
    sole_share: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "friction", "max_force_n", "slipping_friction", "slip_m_s")
        require_not_negative(self, "careful_s")
        require_between(self, 0.0, 1.0, "sole_share")


@dataclass(frozen=True)
class StanceConfig:
    """Height of the base, positions of the feet and damping in stance."""

    height_m: float  # height of the base above the ground
    outward_m: float  # shift of each foot from its position in the default pose, outward
    shift_m: float  # shift of all feet, forward
    kd: float  # N m s/rad, relative to the joint velocities of the commanded motion
    max_position_lead_m: float  # largest distance of the position reference ahead of the body
    max_yaw_lead_rad: float

    def __post_init__(self) -> None:
        require_positive(self, "height_m")
        require_not_negative(self, "kd", "max_position_lead_m", "max_yaw_lead_rad")


@dataclass(frozen=True)
class SwingConfig:
    """Swing trajectories and their impedance."""

    height_m: float  # height of a foot at mid-swing
    depth_m: float  # depth below the ground at which a swing ends, for a firm touch-down
    kp: float  # N m/rad, impedance of the joints around the trajectory
    kd: float  # N m s/rad

    def __post_init__(self) -> None:
        require_not_negative(self, "height_m", "depth_m", "kp", "kd")


@dataclass(frozen=True)
class CatchConfig:
    """Landing position of a biped's foot, relative to the middle of the other foot."""

    apart_m: float  # lateral distance of the feet in a steady gait
    ahead_m: Range  # minimum and maximum
    sideways_m: Range  # minimum and maximum, towards the foot's own side

    def __post_init__(self) -> None:
        require_positive(self, "apart_m")
        require_ordered(self, "ahead_m", "sideways_m")


@dataclass(frozen=True)
class FootholdConfig:
    """Footholds (see `policies/controllers/mpc/footholds.py`)."""

    capture_gain_s: float  # feedback on the velocity error, `k` in `foothold`
    max_step_m: float  # largest distance of a foothold from the nominal position under the body
    catch: CatchConfig | None = None  # for two feet; replaces both settings above

    def __post_init__(self) -> None:
        require_not_negative(self, "capture_gain_s", "max_step_m")


@dataclass(frozen=True)
class Restart:
    """Conditions for stepping although the command is zero."""

    start_speed_m_s: float  # speed of the base above which the robot starts to step
    stop_speed_m_s: float  # speed of the base below which the robot stands again
    start_tilt_rad: float  # tilt of the base above which the robot steps
    calm_s: float  # time without disturbance before the robot stands again
    max_offset_m: float = 1.0  # largest distance of the capture point from the middle of the standing feet

    def __post_init__(self) -> None:
        require_not_negative(self, "start_speed_m_s", "stop_speed_m_s", "start_tilt_rad", "calm_s")
        require_not_negative(self, "max_offset_m")


@dataclass(frozen=True)
class MpcConfig:
    """Settings of `Mpc` that depend on the robot."""

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
    friction_compensation: float  # share of the gearbox friction that is compensated by feed-forward
    settle_s: float  # duration of the move from the height at reset to the stance, before any step
    gaits: tuple[str, ...] = ()  # gaits to which the robot can change while it walks, including `gait`
    max_attitude_rad: float = 0.1  # largest roll and pitch of the live settings
    slope: SlopeConfig | None = None  # None: the ground is assumed to be level
    legs_turn_base: bool = False  # swinging legs turn the base: relevant in gaits with a flight phase

    def __post_init__(self) -> None:
        require_between(self, *RATES_HZ, "rate_hz")
        require_positive(self, "settle_s")
        require_not_negative(self, "friction_compensation", "max_attitude_rad")
