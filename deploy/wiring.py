"""Buses and ids of motors and IMU, from `robot.yaml`."""

import math
from dataclasses import dataclass, replace

import numpy as np

from footfall.robots.description import Robot
from footfall.robots.robot_yaml import MotorType


@dataclass(frozen=True)
class Wiring:
    """A robot's buses, and the bus and id of each motor. Arrays are in joint order."""

    buses: tuple[str, ...]
    channel: np.ndarray  # (n,) intp, index into `buses`
    motor_id: np.ndarray  # (n,) intp
    imu_channel: int
    imu_protocol: str  # name or MODULE:NAME of the IMU's driver
    models: tuple[str, ...]  # (n,) motor models, or MODULE:NAME of a custom driver
    gear_ratio: np.ndarray  # (n,) rotor turns per joint turn
    timeout_s: np.ndarray  # (n,) maximum time without a command until a motor disables itself
    watchdog_endpoints: np.ndarray  # (n, 2) ids of enable_watchdog and watchdog_timeout, 0 if not used
    drive_gains: np.ndarray  # (n, 2) of a moteus: kp, N m per turn, kd, N m s per turn; 0 if unused
    drive_limit: tuple[str, ...]  # (n,) quantity of the drive's limit: "torque", "current" or "" for none
    highest: np.ndarray  # (n,) value of that limit: N m at the joint, or A of the motor; NaN for none
    current_endpoint: np.ndarray  # (n,) id of an ODrive's current_soft_max, 0 if not used
    joint_names: tuple[str, ...]
    foot_channel: np.ndarray  # (feet,) intp, bus of each foot's force sensor; (0,) without such sensors

    def take(self, joints: np.ndarray) -> "Wiring":
        """The wiring of some joints (indices) on the same buses."""
        return replace(
            self,
            channel=self.channel[joints],
            motor_id=self.motor_id[joints],
            models=tuple(self.models[joint] for joint in joints),
            gear_ratio=self.gear_ratio[joints],
            timeout_s=self.timeout_s[joints],
            watchdog_endpoints=self.watchdog_endpoints[joints],
            drive_gains=self.drive_gains[joints],
            drive_limit=tuple(self.drive_limit[joint] for joint in joints),
            highest=self.highest[joints],
            current_endpoint=self.current_endpoint[joints],
            joint_names=tuple(self.joint_names[joint] for joint in joints),
        )

    def label(self, joint: int) -> str:
        """Name, bus and id of a joint's motor, for messages."""
        bus, motor = self.buses[self.channel[joint]], self.motor_id[joint]
        return f"{self.joint_names[joint]} ({bus}, id {motor})"


def wiring_of(robot: Robot) -> Wiring:
    """The wiring of a robot, from its description."""
    joints = robot.description.joints
    foot_buses = [foot.force_bus for foot in robot.description.feet if foot.force_bus is not None]
    buses = tuple(dict.fromkeys([*(j.bus for j in joints), robot.description.imu_bus, *foot_buses]))
    motors = [robot.description.motors[joint.motor] for joint in robot.description.joints]
    channel = np.array([buses.index(joint.bus) for joint in joints])
    motor_id = np.array([joint.id for joint in joints])
    return Wiring(
        buses=buses,
        channel=channel,
        motor_id=motor_id,
        imu_channel=buses.index(robot.description.imu_bus),
        imu_protocol=robot.description.imu_protocol,
        models=tuple(motor.protocol for motor in motors),
        gear_ratio=robot.motor_figures("gear_ratio"),
        timeout_s=robot.motor_figures("timeout_s"),
        watchdog_endpoints=np.array([motor.watchdog_endpoints or (0, 0) for motor in motors]),
        drive_gains=np.array([motor.drive_gains or (0.0, 0.0) for motor in motors]),
        drive_limit=tuple(motor.drive_limit or "" for motor in motors),
        highest=np.array([_highest(motor) for motor in motors]),
        current_endpoint=np.array([motor.current_endpoint or 0 for motor in motors]),
        joint_names=robot.joint_names,
        foot_channel=np.array([buses.index(bus) for bus in foot_buses], np.intp),
    )


def _highest(motor: MotorType) -> float:
    """The value of the drive's limit that implements peak_torque_nm: N m at the joint, or A; NaN for none."""
    if motor.drive_limit is None:
        return math.nan
    per_unit = motor.gear_ratio * motor.torque_constant_nm_a if motor.drive_limit == "current" else 1.0
    return motor.peak_torque_nm / per_unit
