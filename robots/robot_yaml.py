"""The content of `robot.yaml`."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from footfall.common.config import (
    require_between,
    require_not_negative,
    require_ordered,
    require_positive,
)
from footfall.robots.battery import Battery
from footfall.robots.commands import CommandRange
from footfall.robots.stop_inputs import StopInputs

SERIAL = "serial:"  # prefix of a bus that is a serial port: serial:/dev/ttyUSB0@921600
MOTOR_TIMEOUT_S = 0.01, 0.1  # from a few ticks to the longest time without a controller


def _require_name(config: Any, *names: str) -> None:
    """Raise ValueError if one of these fields is blank; None passes."""
    for name in names:
        value = getattr(config, name)
        if value is not None and not value.strip():
            raise ValueError(f"{name} must not be empty")


@dataclass(frozen=True)
class Gains:
    """Parameters from which the gains of learned policies follow, with each joint's reflected inertia."""

    natural_frequency_hz: float
    damping_ratio: float
    torque_share: float

    def __post_init__(self) -> None:
        require_between(self, 1e-12, 1e12, "natural_frequency_hz", "damping_ratio", "torque_share")


@dataclass(frozen=True)
class MotorType:
    """Datasheet of one motor and its gearbox, seen at the joint unless said otherwise."""

    peak_torque_nm: float
    stall_torque_nm: float
    no_load_speed_rad_s: float
    friction_speed_rad_s: float
    gear_ratio: float
    torque_constant_nm_a: float  # at the rotor
    winding_resistance_ohm: float
    protocol: str
    temperature_limit_c: float = 85.0  # windings and magnets are damaged above 100
    voltage_v: tuple[float, float] | None = None  # lowest and highest supply voltage; None: no limit
    watchdog_endpoints: tuple[int, int] | None = None  # ids of an ODrive's enable_watchdog, watchdog_timeout
    drive_gains: tuple[float, float] | None = None  # kp, kd that a moteus scales: N m, N m s per turn
    # The limit of the drive that is set to peak_torque_nm, as a torque or as a current; None: neither.
    drive_limit: Literal["torque", "current"] | None = None
    current_endpoint: int | None = None  # id of an ODrive's current_soft_max
    torque_bandwidth_hz: float | None = None  # of the torque, a first-order lag; None: no lag
    stribeck_friction_nm: float = 0.0  # friction at rest beyond Coulomb friction
    stribeck_speed_rad_s: float | None = None  # at which half of it remains; None: 5 friction_speed_rad_s
    load_friction: float = 0.0  # share of the motor torque that friction takes
    backlash_rad: float = 0.0  # whole play of the gearbox
    gear_stiffness_nm_rad: float | None = None  # of the gearbox; None: rigid
    voltage_driven: bool = False  # the command sets a voltage, as with hobby servos, not a current
    # If voltage-driven: share by which the resistance at full duty exceeds that at rest.
    duty_resistance: float = 0.0
    thermal_resistance_k_w: float | None = None  # from the winding to the air; None: no thermal model
    thermal_capacity_j_k: float | None = None  # of the winding with the iron around it
    # Temperatures between which the current limit falls from its full value to 0.
    derating_c: tuple[float, float] | None = None
    timeout_s: float = 0.1  # longest time without a command after which the motor disables itself

    def __post_init__(self) -> None:
        may_be_zero = "stribeck_friction_nm", "load_friction", "backlash_rad", "duty_resistance"
        rest = (
            name
            for name in self.__dataclass_fields__
            if name not in ("protocol", "voltage_driven", "drive_limit", *may_be_zero)
        )
        require_positive(self, *rest)
        require_not_negative(self, *may_be_zero)
        require_ordered(self, "voltage_v")
        require_between(self, *MOTOR_TIMEOUT_S, "timeout_s")
        require_between(self, 0.0, 0.9, "load_friction")
        require_between(self, 1, 0xFFFF, "watchdog_endpoints", "current_endpoint")
        if (self.thermal_resistance_k_w is None) != (self.thermal_capacity_j_k is None):
            raise ValueError("thermal_resistance_k_w and thermal_capacity_j_k must be given together")
        if self.derating_c is not None:
            require_ordered(self, "derating_c")
            if self.thermal_resistance_k_w is None or self.derating_c[0] == self.derating_c[1]:
                raise ValueError("derating_c needs thermal_resistance_k_w, and two different temperatures")
        if self.stall_torque_nm < self.peak_torque_nm:
            raise ValueError(
                f"stall_torque_nm {self.stall_torque_nm:g} is below peak_torque_nm {self.peak_torque_nm:g}"
            )


@dataclass(frozen=True)
class JointEntry:
    """One joint: its motor, default position, bus and id."""

    name: str
    motor: str
    default_rad: float
    bus: str
    id: int
    lying_rad: float | None = None  # with the base on the ground; given for all joints or for none

    def __post_init__(self) -> None:
        require_between(self, 1, 127, "id")
        _require_name(self, "name", "bus")


@dataclass(frozen=True)
class Foot:
    """One foot: its contact geoms (a sphere, or the corners of a sole), its leg's joints from the base."""

    name: str
    geoms: tuple[str, ...]
    joints: tuple[str, ...]
    force_bus: str | None = None  # bus of its force sensor; given for all feet or for none

    def __post_init__(self) -> None:
        if not self.geoms:
            raise ValueError("geoms must name at least one geom")
        _require_name(self, "name", "force_bus")


@dataclass(frozen=True)
class Description:
    """The content of `robot.yaml`."""

    name: str
    model: str
    base: str
    imu: str
    standing_height_m: float
    gains: Gains
    soft_limit_factor: float
    target_rate_rad_s: float
    motors: dict[str, MotorType]
    joints: tuple[JointEntry, ...]
    feet: tuple[Foot, ...]
    imu_bus: str  # a CAN bus, or SERIAL and a port
    commands: CommandRange  # of the scenarios
    imu_protocol: str = "footfall"  # or MODULE:NAME of a user's own driver (deploy/drivers/imu_driver.py)
    safety: dict[str, Any] = field(default_factory=dict)  # supervisor's limits (deploy/config.py)
    actuator_net: str | None = None  # NPZ beside this file, of `footfall identify net`; None for none
    battery: Battery | None = None  # None: its charge is unknown
    stop_inputs: StopInputs = field(default_factory=StopInputs)
    held_start: bool = False  # whether it must be held up until it steps in place (point feet)

    def __post_init__(self) -> None:
        require_positive(self, "standing_height_m", "soft_limit_factor", "target_rate_rad_s")
        _require_name(self, "imu_bus")
        require_ordered(self.commands, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        if self.soft_limit_factor > 1.0:
            raise ValueError(f"soft_limit_factor must be at most 1, not {self.soft_limit_factor}")
        if not self.name.replace("-", "").replace("_", "").isalnum():
            raise ValueError(f"name '{self.name}' must be letters, digits, - and _ only")

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def default_pose(self) -> np.ndarray:
        """Joint positions of the default pose, rad, (n,)."""
        return np.array([joint.default_rad for joint in self.joints])

    @cached_property
    def lying_pose(self) -> np.ndarray | None:
        """Joint positions with the base on the ground, rad, (n,); None if the robot cannot lie down on it."""
        given = [joint.lying_rad for joint in self.joints if joint.lying_rad is not None]
        return np.array(given) if given else None

    @cached_property
    def foot_joints(self) -> tuple[np.ndarray, ...]:
        """Indices of each leg's joints from the base outwards."""
        return tuple(np.array([self.joint_names.index(j) for j in foot.joints]) for foot in self.feet)
