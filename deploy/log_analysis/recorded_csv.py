"""Readings of any robot in a CSV file, whose columns a map names."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_positive
from footfall.common.errors import UserError
from footfall.common.rotations import rotation_matrix
from footfall.robots.description import Robot


@dataclass(frozen=True)
class ColumnMap:
    """Names of a file's columns, and their units. Joints and feet are named as in robot.yaml."""

    time: str
    gyro: tuple[str, str, str]  # x, y, z
    acceleration: tuple[str, str, str]  # proper: it reads gravity at rest
    joint_position: dict[str, str]  # column of each joint
    joint_velocity: dict[str, str] = field(default_factory=dict)  # empty: differences of positions
    joint_torque: dict[str, str] = field(default_factory=dict)  # empty: unknown
    foot_force: dict[str, str] = field(default_factory=dict)  # upward, of each foot; empty: unknown
    quaternion: tuple[str, str, str, str] | None = None  # w, x, y, z, body to world; None: not recorded
    imu_mounting: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # w x y z, IMU's axes to base's
    time_unit_s: float = 1.0
    angle_unit_rad: float = 1.0  # of joints
    rate_unit_rad_s: float = 1.0  # of the gyro
    acceleration_unit_m_s2: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self, "time_unit_s", "angle_unit_rad", "rate_unit_rad_s", "acceleration_unit_m_s2")
        if not np.linalg.norm(self.imu_mounting) > 0.0:
            raise ValueError("imu_mounting must be a quaternion")


class Recorded(NamedTuple):
    """Readings of n joints and f feet at T times."""

    start_s: float  # time of the first row, as the file has it
    time_us: np.ndarray  # (T,) int since then
    gyro: np.ndarray  # (T, 3) rad/s, base axes
    acceleration: np.ndarray  # (T, 3) m/s^2, base axes
    quaternion: np.ndarray | None  # (T, 4) w x y z
    position: np.ndarray  # (T, n) rad
    velocity: np.ndarray  # (T, n) rad/s
    torque: np.ndarray | None  # (T, n) N m
    force: np.ndarray | None  # (T, f) N


def read_csv(path: Path, columns: ColumnMap, robot: Robot) -> Recorded:
    """Read a file whose first line names its columns.

    Raises:
        UserError: the file cannot be read, lacks a column or a joint, holds no number where one is due, or
            its time does not grow.
    """
    table = _table(path)
    n, feet = robot.joint_names, tuple(foot.name for foot in robot.description.feet)
    seconds = columns.time_unit_s * table.take([columns.time])[:, 0]
    if len(seconds) < 2:
        raise UserError(f"{path} has fewer than two rows")
    time_us = np.rint(1e6 * (seconds - seconds[0])).astype(np.int64)
    late = np.flatnonzero(np.diff(time_us) <= 0)
    if len(late):
        raise UserError(f"{path}, line {late[0] + 3}: the time does not grow")
    mounting = np.array(columns.imu_mounting)
    turn = rotation_matrix(mounting / np.linalg.norm(mounting)).T
    position = columns.angle_unit_rad * table.of(columns.joint_position, n, "joint_position")
    if columns.joint_velocity:
        velocity = columns.angle_unit_rad * table.of(columns.joint_velocity, n, "joint_velocity")
    else:
        velocity = np.zeros_like(position)
        velocity[1:] = np.diff(position, axis=0) / (1e-6 * np.diff(time_us))[:, None]
    quaternion = None
    if columns.quaternion is not None:
        quaternion = table.take(list(columns.quaternion))
        length = np.linalg.norm(quaternion, axis=1, keepdims=True)
        if not (length > 0.5).all():
            raise UserError(f"{path}: a quaternion's length is not 1")
        quaternion = quaternion / length
    return Recorded(
        start_s=float(seconds[0]),
        time_us=time_us,
        gyro=columns.rate_unit_rad_s * table.take(list(columns.gyro)) @ turn,
        acceleration=columns.acceleration_unit_m_s2 * table.take(list(columns.acceleration)) @ turn,
        quaternion=quaternion,
        position=position,
        velocity=velocity,
        torque=table.of(columns.joint_torque, n, "joint_torque") if columns.joint_torque else None,
        force=table.of(columns.foot_force, feet, "foot_force") if columns.foot_force else None,
    )


class _Table(NamedTuple):
    path: Path
    names: list[str]
    rows: list[list[str]]

    def take(self, names: list[str]) -> np.ndarray:
        """Numbers of some columns, (T, k)."""
        for name in names:
            if name not in self.names:
                raise UserError(f"{self.path} has no column '{name}': it has {', '.join(self.names)}")
        places = [self.names.index(name) for name in names]
        values = np.empty((len(self.rows), len(places)))
        for line, row in enumerate(self.rows):
            for column, place in enumerate(places):
                values[line, column] = self._number(line, row, place)
        return values

    def of(self, chosen: dict[str, str], names: tuple[str, ...], what: str) -> np.ndarray:
        """Numbers of the columns of joints or feet, (T, n), in the robot's order."""
        lacking = [name for name in names if name not in chosen]
        unknown = [name for name in chosen if name not in names]
        if lacking or unknown:
            wrong = f"lacks {lacking[0]}" if lacking else f"names {unknown[0]}, which the robot has not"
            raise UserError(f"{what} of the map {wrong}: the robot has {', '.join(names)}")
        return self.take([chosen[name] for name in names])

    def _number(self, line: int, row: list[str], place: int) -> float:
        try:
            value = float(row[place])
        except (ValueError, IndexError):
            value = np.nan
        if not np.isfinite(value):
            raise UserError(f"{self.path}, line {line + 2}: no number in column '{self.names[place]}'")
        return value


def _table(path: Path) -> _Table:
    try:
        with path.open(newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    if not rows:
        raise UserError(f"{path} is empty")
    return _Table(path, [name.strip() for name in rows[0]], rows[1:])
