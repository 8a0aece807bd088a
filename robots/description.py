"""A robot's description: `robot.yaml` and `robot.xml` read into arrays in joint order."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from footfall.common.config import load
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.robots.actuator import STRIBECK_RAMPS, Motor
from footfall.robots.actuator_net import ActuatorNet, load_net
from footfall.robots.checks import contradictions, inconsistencies, overreach
from footfall.robots.digest import digest
from footfall.robots.kinematics import Legs
from footfall.robots.mjcf import load_spec
from footfall.robots.robot_yaml import Description, MotorType
from footfall.robots.stability import instabilities
from footfall.robots.stance import foot_positions
from footfall.robots.targets import soft_limits
from footfall.robots.winding import AMBIENT_C, Winding

ROBOTS = Path(__file__).parent


@dataclass(frozen=True)
class Robot:
    """A loaded robot. Arrays are in joint order, shape (n,), and must not be written to."""

    description: Description
    folder: Path
    lower_rad: np.ndarray
    upper_rad: np.ndarray
    armature: np.ndarray  # reflected inertia, kg m^2
    motor: Motor
    foot_positions: np.ndarray  # (feet, 3) m, centre of each foot in the default pose, base frame
    digest: str  # fingerprint of everything that a policy relies on (robots/digest.py)
    actuator_net: ActuatorNet | None = None  # the learned part of the joint law

    @property
    def name(self) -> str:
        return self.description.name

    @property
    def xml_path(self) -> Path:
        return self.folder / self.description.model

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.description.joint_names

    @property
    def default_pose(self) -> np.ndarray:
        """Joint positions of the default pose, rad."""
        return self.description.default_pose

    @property
    def lying_pose(self) -> np.ndarray | None:
        """Joint positions with the base on the ground, rad; None if the robot cannot lie down on it."""
        return self.description.lying_pose

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
    def copper_loss(self) -> np.ndarray:
        """Heat in each motor's winding over its squared torque at the joint, W/(N m)^2, (n,)."""
        torque_per_ampere = self.motor_figures("torque_constant_nm_a") * self.motor_figures("gear_ratio")
        loss: np.ndarray = self.motor_figures("winding_resistance_ohm") / torque_per_ampere**2
        return loss

    @cached_property
    def winding(self) -> Winding | None:
        """Thermal parameters of the motors, each (n,); None if no motor declares any."""
        motors = [self.description.motors[joint.motor] for joint in self.description.joints]
        if not any(motor.thermal_resistance_k_w for motor in motors):
            return None
        resistance = np.array([motor.thermal_resistance_k_w or 0.0 for motor in motors])
        capacity = np.array([motor.thermal_capacity_j_k or np.inf for motor in motors])
        derating = np.array([motor.derating_c or (-np.inf, np.inf) for motor in motors])
        begin, end = derating.T
        return Winding(
            ambient=np.full(len(motors), AMBIENT_C),
            start_rise=np.zeros(len(motors)),
            heating=resistance * self.copper_loss,
            cooling=1.0 / np.where(resistance > 0.0, resistance * capacity, np.inf),
            derating_end=end,
            derating_span=np.where(np.isfinite(end), end - begin, 1.0),
        )

    @cached_property
    def voltage_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest voltage of each joint's motor, V; infinite without a limit."""
        motors = self.description.motors
        given = [motors[j.motor].voltage_v or (-np.inf, np.inf) for j in self.description.joints]
        low, high = np.array(given).T
        return low, high

    @cached_property
    def foot_sensors(self) -> int:
        """Number of force sensors: one for each foot, or 0."""
        return sum(foot.force_bus is not None for foot in self.description.feet)

    def joint_index(self, name: str) -> int:
        return self.joint_names.index(name)

    @property
    def foot_joints(self) -> tuple[np.ndarray, ...]:
        """Indices of each leg's joints from the base outwards."""
        return self.description.foot_joints

    @cached_property
    def legs(self) -> Legs:
        """Kinematics of the legs, shared by all users of this robot."""
        return Legs(self.description, self.xml_path)


def available_robots() -> list[str]:
    """Names of the robots included in footfall."""
    return sorted(path.parent.name for path in ROBOTS.glob("*/robot.yaml"))


def load_robot(name_or_folder: str | Path) -> Robot:
    """Load a robot by its name or from a folder that holds `robot.yaml`.

    Raises:
        UserError: there is no such robot, or its files contradict each other.
    """
    folder = ROBOTS / str(name_or_folder)
    if not (folder / "robot.yaml").is_file():
        folder = Path(name_or_folder)
    if not (folder / "robot.yaml").is_file():
        raise UserError(
            f"no robot '{name_or_folder}': give one of {', '.join(available_robots())}"
            f" or a folder with robot.yaml{did_you_mean(str(name_or_folder), available_robots())}"
        )
    description = load(folder / "robot.yaml", Description)
    return _assemble(description, folder.resolve())


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
    optional = _optional_effects(motors)
    net_file = description.actuator_net
    net = None if net_file is None else load_net(folder / net_file, description.joint_names)
    motor = Motor(
        peak_torque=np.array([m.peak_torque_nm for m in motors]),
        stall_torque=np.array([m.stall_torque_nm for m in motors]),
        no_load_speed=np.array([m.no_load_speed_rad_s for m in motors]),
        friction=model.dof_frictionloss[dofs].copy(),
        friction_speed=np.array([m.friction_speed_rad_s for m in motors]),
        damping=model.dof_damping[dofs].copy(),
        strength=np.ones(len(ids)),
        **optional,
    )
    robot = Robot(
        description=description,
        folder=folder,
        lower_rad=model.jnt_range[ids, 0].copy(),
        upper_rad=model.jnt_range[ids, 1].copy(),
        armature=model.dof_armature[dofs].copy(),
        motor=motor,
        foot_positions=foot_positions(description, model),
        digest=digest(description, model, net),
        actuator_net=net,
    )
    _refuse(source, instabilities(description, model, robot.kp, robot.kd, motor))
    _refuse(source, overreach(description, robot.action_scale, robot.upper_rad - robot.lower_rad))
    return robot


def _optional_effects(motors: list[MotorType]) -> dict[str, np.ndarray]:
    """Optional fields of `Motor` that at least one joint's motor has, each (n,)."""
    bandwidth_hz = np.array([m.torque_bandwidth_hz or np.inf for m in motors])
    found = {
        "lag_s": 1.0 / (2.0 * np.pi * bandwidth_hz),
        "stribeck": np.array([m.stribeck_friction_nm for m in motors]),
        "load_friction": np.array([m.load_friction for m in motors]),
        "backlash": np.array([m.backlash_rad for m in motors]),
        "compliance": np.array([1.0 / (m.gear_stiffness_nm_rad or np.inf) for m in motors]),
        "voltage_gain": np.array([float(m.voltage_driven) for m in motors]),
        "duty_resistance": np.array([m.duty_resistance for m in motors]),
    }
    found = {name: values for name, values in found.items() if values.any()}
    if any(m.stribeck_speed_rad_s is not None for m in motors):
        default_speeds = [STRIBECK_RAMPS * m.friction_speed_rad_s for m in motors]
        given = [m.stribeck_speed_rad_s for m in motors]
        found["stribeck_speed"] = np.array([s or r for s, r in zip(given, default_speeds, strict=True)])
    return found


def _refuse(source: Path, findings: Iterator[str]) -> None:
    """Raise UserError with the first finding, if there is one."""
    for finding in findings:
        raise UserError(f"{source}: {finding}")
