"""Readings and commands of any robot in a CSV file, with a map of its columns."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_positive
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.common.rotations import projected_gravity, rotation_matrix
from footfall.deploy.log_analysis.csv_table import Column, CsvTable, read_table
from footfall.robots.description import Robot

LATEST_S = 9e9  # beyond any date, and within the times of a log
LEVEL = (1.0, 0.0, 0.0, 0.0)  # w x y z
COMMAND = ("target_position", "target_velocity", "stiffness", "damping", "feed_forward")  # rows of a command


@dataclass(frozen=True)
class ColumnMap:
    """Names of a file's columns, and their units. Joints and feet have the names of robot.yaml.
    For a quaternion and for commands, a number may replace a column with a constant.
    """

    time: str
    joint_position: dict[str, str]  # column for each joint
    gyro: tuple[str, str, str] | None = None  # x, y, z; None: no IMU, the base is at rest
    acceleration: tuple[str, str, str] | None = None  # proper acceleration; requires gyro
    joint_velocity: dict[str, str] = field(default_factory=dict)  # empty: computed from positions
    joint_torque: dict[str, str] = field(default_factory=dict)  # empty: unknown
    foot_force: dict[str, str] = field(default_factory=dict)  # upward, for each foot; empty: unknown
    quaternion: tuple[Column, Column, Column, Column] | None = None  # w x y z, body to world; None: unknown
    target_position: dict[str, Column] = field(default_factory=dict)  # empty: no position control
    target_velocity: dict[str, Column] = field(default_factory=dict)  # empty: zero
    stiffness: dict[str, Column] = field(default_factory=dict)  # N m/rad; empty: zero
    damping: dict[str, Column] = field(default_factory=dict)  # N m s/rad; empty: zero
    feed_forward: dict[str, Column] = field(default_factory=dict)  # N m; empty: zero
    imu_mounting: tuple[float, float, float, float] = LEVEL  # w x y z, from the IMU's axes to the base's
    time_unit_s: float = 1.0
    angle_unit_rad: float = 1.0  # unit of joint positions and velocities, including targets
    rate_unit_rad_s: float = 1.0  # unit of the gyro
    acceleration_unit_m_s2: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self, "time_unit_s", "angle_unit_rad", "rate_unit_rad_s", "acceleration_unit_m_s2")
        if not np.linalg.norm(self.imu_mounting) > 0.0:
            raise ValueError("imu_mounting must be a quaternion")
        if (self.gyro is None) != (self.acceleration is None):
            raise ValueError("gyro and acceleration require each other: give both or neither")
        if bool(self.target_position) != bool(self.stiffness):
            raise ValueError("target_position and stiffness require each other: give both or neither")
        if self.target_velocity and not self.damping:
            raise ValueError("target_velocity needs damping, N m s/rad")

    @property
    def commanded(self) -> bool:
        """Whether the file has commands."""
        return any(getattr(self, name) for name in COMMAND)


class Recorded(NamedTuple):
    """Readings of n joints and f feet at T times."""

    start_s: float  # time of the first row in the file
    time_us: np.ndarray  # (T,) int, time since the first row
    gyro: np.ndarray  # (T, 3) rad/s, base axes
    acceleration: np.ndarray  # (T, 3) m/s^2, base axes
    quaternion: np.ndarray | None  # (T, 4) w x y z
    position: np.ndarray  # (T, n) rad
    velocity: np.ndarray  # (T, n) rad/s
    torque: np.ndarray | None  # (T, n) N m
    force: np.ndarray | None  # (T, f) N
    command: np.ndarray | None  # (T, 5, n) position, velocity, stiffness, damping, torque
    imu: bool  # whether gyro and acceleration were recorded; otherwise they are those of a base at rest


def read_csv(path: Path, columns: ColumnMap, robot: Robot) -> Recorded:
    """Read a file with column names in the first line.

    Raises:
        UserError: the file cannot be read, a column or a joint is missing, a cell is not a number, or the
            time does not increase.
    """
    table = read_table(path)
    joints, feet = robot.joint_names, tuple(foot.name for foot in robot.description.feet)
    seconds = columns.time_unit_s * table.take([columns.time])[:, 0]
    if len(seconds) < 2:
        raise UserError(f"{path} has fewer than two rows")
    if not (np.abs(seconds) < LATEST_S).all():
        raise UserError(f"{path}: {seconds[-1]:g} s is no time: give the unit of its times as time_unit_s")
    time_us = np.rint(1e6 * (seconds - seconds[0])).astype(np.int64)
    not_later = np.flatnonzero(np.diff(time_us) <= 0)
    if len(not_later):
        raise UserError(f"{path}, line {not_later[0] + 3}: the time does not increase")
    position = columns.angle_unit_rad * table.take_named(columns.joint_position, joints, "joint_position")
    if columns.joint_velocity:
        velocity = columns.angle_unit_rad * table.take_named(columns.joint_velocity, joints, "joint_velocity")
    else:
        velocity = np.zeros_like(position)
        velocity[1:] = np.diff(position, axis=0) / (1e-6 * np.diff(time_us))[:, None]
    gyro, acceleration, quaternion = _motion_of_base(table, columns)
    return Recorded(
        start_s=float(seconds[0]),
        time_us=time_us,
        gyro=gyro,
        acceleration=acceleration,
        quaternion=quaternion,
        position=position,
        velocity=velocity,
        torque=table.take_named(columns.joint_torque, joints, "joint_torque")
        if columns.joint_torque
        else None,
        force=table.take_named(columns.foot_force, feet, "foot_force") if columns.foot_force else None,
        command=_commands(table, columns, joints) if columns.commanded else None,
        imu=columns.gyro is not None,
    )


def _motion_of_base(table: CsvTable, columns: ColumnMap) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Gyro, acceleration and orientation, (T, 3), (T, 3), (T, 4); those of a base at rest without an IMU."""
    quaternion = columns.quaternion
    if quaternion is None and columns.gyro is None:
        quaternion = LEVEL
    quaternions = None
    if quaternion is not None:
        quaternions = table.take(quaternion)
        length = np.linalg.norm(quaternions, axis=1, keepdims=True)
        if not (length > 0.5).all():
            raise UserError(f"{table.path}: a quaternion's length is not 1")
        quaternions /= length
    if columns.gyro is None or columns.acceleration is None:
        assert quaternions is not None
        return np.zeros((len(quaternions), 3)), -GRAVITY_M_S2 * projected_gravity(quaternions), quaternions
    mounting = np.array(columns.imu_mounting)
    to_base = rotation_matrix(mounting / np.linalg.norm(mounting)).T
    gyro = columns.rate_unit_rad_s * table.take(columns.gyro) @ to_base
    return gyro, columns.acceleration_unit_m_s2 * table.take(columns.acceleration) @ to_base, quaternions


def _commands(table: CsvTable, columns: ColumnMap, joints: tuple[str, ...]) -> np.ndarray:
    """(T, 5, n) position, velocity, stiffness, damping, torque."""
    angle = columns.angle_unit_rad
    units = (angle, angle, 1.0, 1.0, 1.0)
    command = np.zeros((len(table.rows), len(COMMAND), len(joints)))
    for row, (name, unit) in enumerate(zip(COMMAND, units, strict=True)):
        if chosen := getattr(columns, name):
            command[:, row] = unit * table.take_named(chosen, joints, name)
    for row in (2, 3):
        if (command[:, row] < 0.0).any():
            raise UserError(f"{table.path}: {COMMAND[row]} is negative")
    return command
