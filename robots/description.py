"""A robot's description: `robot.yaml` and `robot.xml` read into arrays in joint order."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from footfall.common.config import load, require_between, require_ordered, require_positive
from footfall.common.errors import UserError
from footfall.robots.actuator import Motor
from footfall.robots.checks import contradictions, inconsistencies, overreach
from footfall.robots.commands import CommandRange
from footfall.robots.digest import digest
from footfall.robots.stability import instabilities
from footfall.robots.stance import foot_places
from footfall.robots.targets import soft_limits

if TYPE_CHECKING:
    from footfall.robots.kinematics import Legs

ROBOTS = Path(__file__).parent
MOTOR_TIMEOUT_S = 0.01, 0.1  # from a few ticks to what a robot may go on for without a controller


@dataclass(frozen=True)
class Gains:
    """How the gains of learned policies follow from each joint's reflected inertia."""

    natural_frequency_hz: float
    damping_ratio: float
    torque_share: float

    def __post_init__(self) -> None:
        require_positive(self, "natural_frequency_hz", "damping_ratio", "torque_share")


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
    temperature_limit_c: float = 85.0  # windings and magnets suffer from 100 on
    voltage_v: tuple[float, float] | None = None  # least and most at its supply; None if any will do
    watchdog_endpoints: tuple[int, int] | None = None  # ids of an ODrive's enable_watchdog, watchdog_timeout
    timeout_s: float = 0.1  # after which a motor that hears nothing shall switch itself off, at the latest

    def __post_init__(self) -> None:
        require_positive(self, *(name for name in self.__dataclass_fields__ if name != "protocol"))
        require_ordered(self, "voltage_v")
        require_between(self, *MOTOR_TIMEOUT_S, "timeout_s")
        require_between(self, 1, 0xFFFF, "watchdog_endpoints")
        if self.stall_torque_nm < self.peak_torque_nm:
            raise ValueError(
                f"stall_torque_nm {self.stall_torque_nm:g} is below peak_torque_nm {self.peak_torque_nm:g}"
            )


@dataclass(frozen=True)
class JointEntry:
    """One joint: its motor, default position and place on the CAN buses."""

    name: str
    motor: str
    default_rad: float
    bus: str
    id: int
    lying_rad: float | None = None  # with the base on the ground; every joint has one, or none has

    def __post_init__(self) -> None:
        require_between(self, 1, 127, "id")


@dataclass(frozen=True)
class Foot:
    """One foot: the geoms it stands on (a ball, or the corners of a sole), its leg's joints from the base."""

    name: str
    geoms: tuple[str, ...]
    joints: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.geoms:
            raise ValueError("geoms must name at least one")


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
    imu_bus: str
    commands: CommandRange  # that scenarios ask of it
    safety: dict[str, Any] = field(default_factory=dict)  # supervisor's limits (deploy/config.py)

    def __post_init__(self) -> None:
        require_positive(self, "standing_height_m", "soft_limit_factor", "target_rate_rad_s")
        require_ordered(self.commands, "forward_m_s", "leftward_m_s", "yaw_rad_s")
        if self.soft_limit_factor > 1.0:
            raise ValueError(f"soft_limit_factor must be at most 1, not {self.soft_limit_factor}")
        if not self.name.replace("-", "").replace("_", "").isalnum():
            raise ValueError(f"name '{self.name}' must be letters, digits, - and _ only")


@dataclass(frozen=True)
class Robot:
    """A robot, ready for use. Arrays are in joint order, shape (n,), and must not be written to."""

    description: Description
    folder: Path
    lower_rad: np.ndarray
    upper_rad: np.ndarray
    armature: np.ndarray  # reflected inertia, kg m^2
    motor: Motor
    foot_places: np.ndarray  # (feet, 3) m, centre of each foot in the default pose, base frame
    digest: str  # fingerprint of everything that a policy relies on (robots/digest.py)

    @property
    def name(self) -> str:
        return self.description.name

    @property
    def xml_path(self) -> Path:
        return self.folder / self.description.model

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.description.joints)

    @cached_property
    def default_pose(self) -> np.ndarray:
        """Joint positions of the default pose, rad."""
        return np.array([joint.default_rad for joint in self.description.joints])

    @cached_property
    def lying_pose(self) -> np.ndarray | None:
        """Joint positions with the base on the ground, rad; None of a robot that cannot lie down on it."""
        given = [joint.lying_rad for joint in self.description.joints if joint.lying_rad is not None]
        return np.array(given) if given else None

    @cached_property
    def soft_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest position target of each joint, rad."""
        return soft_limits(self.lower_rad, self.upper_rad, self.description.soft_limit_factor)

    @cached_property
    def kp(self) -> np.ndarray:
        """Stiffness of learned policies, N m/rad."""
        return self.armature * self._natural_frequency**2

    @cached_property
    def kd(self) -> np.ndarray:
        """Damping of learned policies, N m s/rad."""
        return 2 * self.description.gains.damping_ratio * self.armature * self._natural_frequency

    @cached_property
    def action_scale(self) -> np.ndarray:
        """Position target per unit of action, rad."""
        return self.description.gains.torque_share * self.motor.peak_torque / self.kp

    @property
    def _natural_frequency(self) -> float:
        return 2 * np.pi * self.description.gains.natural_frequency_hz

    def motor_figures(self, field: str) -> np.ndarray:
        """One datasheet figure (a numeric field of `MotorType`) for each joint."""
        motors = self.description.motors
        return np.array([getattr(motors[j.motor], field) for j in self.description.joints])

    @cached_property
    def voltage_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and most voltage at each joint's motor, V; infinite where any will do."""
        motors = self.description.motors
        given = [motors[j.motor].voltage_v or (-np.inf, np.inf) for j in self.description.joints]
        least, most = np.array(given).T
        return least, most

    def joint_index(self, name: str) -> int:
        return self.joint_names.index(name)

    @cached_property
    def foot_joints(self) -> tuple[np.ndarray, ...]:
        """Indices of each leg's joints from the base outwards."""
        return tuple(np.array([self.joint_index(j) for j in f.joints]) for f in self.description.feet)

    @cached_property
    def legs(self) -> "Legs":
        """Kinematics of the legs, one for all who move or watch this robot."""
        from footfall.robots.kinematics import Legs

        return Legs(self)


def available_robots() -> list[str]:
    """Names of the robots that ship with footfall."""
    return sorted(path.parent.name for path in ROBOTS.glob("*/robot.yaml"))


def load_robot(name_or_folder: str | Path) -> Robot:
    """Load a robot by its name or from a folder that holds `robot.yaml`.

    Raises:
        UserError: there is no such robot, or its files do not fit together.
    """
    folder = ROBOTS / str(name_or_folder)
    if not (folder / "robot.yaml").is_file():
        folder = Path(name_or_folder)
    if not (folder / "robot.yaml").is_file():
        raise UserError(
            f"no robot '{name_or_folder}': give one of {', '.join(available_robots())}"
            " or a folder with robot.yaml"
        )
    description = load(folder / "robot.yaml", Description)
    return _assemble(description, folder.resolve())


def load_spec(path: Path) -> mujoco.MjSpec:
    """Read an MJCF file.

    Raises:
        UserError: the file is missing or is no valid MJCF.
    """
    if not path.is_file():
        raise UserError(f"no MJCF file at {path}")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, UnicodeDecodeError, mujoco.FatalError) as error:
        raise UserError(f"{path} is not valid MJCF: {' '.join(str(error).split())}") from None


def _assemble(description: Description, folder: Path) -> Robot:
    source = folder / "robot.yaml"
    _refuse(source, inconsistencies(description))
    spec = load_spec(folder / description.model)
    try:
        model = spec.compile()
    except ValueError as error:
        raise UserError(
            f"{folder / description.model} does not compile: {' '.join(str(error).split())}"
        ) from None
    _refuse(source, contradictions(description, model))
    ids = [model.joint(joint.name).id for joint in description.joints]
    motors = [description.motors[joint.motor] for joint in description.joints]
    dofs = model.jnt_dofadr[ids]
    motor = Motor(
        peak_torque=np.array([m.peak_torque_nm for m in motors]),
        stall_torque=np.array([m.stall_torque_nm for m in motors]),
        no_load_speed=np.array([m.no_load_speed_rad_s for m in motors]),
        friction=model.dof_frictionloss[dofs].copy(),
        friction_speed=np.array([m.friction_speed_rad_s for m in motors]),
        damping=model.dof_damping[dofs].copy(),
        strength=np.ones(len(ids)),
    )
    robot = Robot(
        description=description,
        folder=folder,
        lower_rad=model.jnt_range[ids, 0].copy(),
        upper_rad=model.jnt_range[ids, 1].copy(),
        armature=model.dof_armature[dofs].copy(),
        motor=motor,
        foot_places=foot_places(description, model),
        digest=digest(description, model),
    )
    _refuse(source, instabilities(robot, model))
    _refuse(source, overreach(robot))
    return robot


def _refuse(source: Path, findings: Iterator[str]) -> None:
    """Raise UserError with the first finding, if there is one."""
    for finding in findings:
        raise UserError(f"{source}: {finding}")
