"""Motors of any maker: on a whole robot, and two on separate buses, with their states and frames."""

from dataclasses import replace
from typing import Any

import numpy as np

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import Report
from footfall.robots.battery import Battery
from footfall.robots.description import Robot

MAKERS: dict[str, dict[str, str]] = {
    "MIT mode": {},
    "Damiao": {"hip": "DM8006", "knee": "DM8009"},
    "RobStride": {"hip": "RS06", "knee": "RS03"},
    "ODrive": {"hip": "ODrive", "knee": "ODrive"},
    "moteus": {"hip": "moteus", "knee": "moteus"},
    "mixed": {"hip": "RS03", "knee": "DM8009"},
}


def with_motors(robot: Robot, first_id: int = 1, battery: Battery | None = None, **protocols: str) -> Robot:
    """The robot with other motors for some of its kinds, watchdogs, ids from `first_id` on, a battery."""
    description = robot.description
    more: dict[str, Any] = {"watchdog_endpoints": (410, 409), "drive_gains": (2000.0, 60.0)}
    motors = {
        name: replace(motor, protocol=protocols.get(name, motor.protocol), **more)
        for name, motor in description.motors.items()
    }
    joints = tuple(replace(joint, id=joint.id + first_id - 1) for joint in description.joints)
    return replace(robot, description=replace(description, motors=motors, joints=joints, battery=battery))


def two_motors(
    hip: str, knee: str, motor_id: int = 3, gear_ratio: tuple[float, float] = (6.0, 9.0)
) -> Wiring:
    """The wiring of two motor models with the same id on two buses, beside an IMU on the first one."""
    return Wiring(
        buses=("can0", "can1"),
        channel=np.array([0, 1]),
        motor_id=np.array([motor_id, motor_id]),
        imu_channel=0,
        imu_protocol="footfall",
        models=(hip, knee),
        gear_ratio=np.array(gear_ratio),
        timeout_s=np.array([0.1, 0.1]),
        watchdog_endpoints=np.zeros((2, 2), int),
        drive_gains=np.full((2, 2), [1000.0, 60.0]),
        drive_limit=("", ""),
        highest=np.full(2, np.nan),
        current_endpoint=np.zeros(2, int),
        joint_names=("hip", "knee"),
        foot_channel=np.zeros(0, np.intp),
    )


def report(
    values: np.ndarray, error: np.ndarray | int = 0, temperature_c: int = 30, on: np.ndarray | bool = True
) -> Report:
    """Motor states as a simulated robot reports them, on and without errors by default.

    `values`: positions rad, velocities rad/s and torques N m of k motors, (3, k).
    """
    k = values.shape[1]
    return Report(values, np.full(k, error, np.uint64), np.full(k, on, bool), temperature_c)


def frame(identifier: int, content: str | bytes, channel: int = 0) -> Frames:
    """One frame with this content, given as bytes or in hexadecimal."""
    content = bytes.fromhex(content) if isinstance(content, str) else content
    data = np.frombuffer(content.ljust(8, b"\0"), np.uint8).reshape(1, 8)
    return Frames(np.array([channel]), np.array([identifier]), data, np.array([len(content)]))


def hexed(frames: Frames) -> list[str]:
    """The content of each frame in hexadecimal."""
    rows = zip(frames.data, frames.length.tolist(), strict=True)
    return [row[:length].tobytes().hex(" ") for row, length in rows]


def read_settings(driver: Any, end: Any) -> int:
    """Query simulated motors until a driver has all settings; returns the number of queries."""
    for count in range(10):
        if not driver.not_ready():
            return count
        answer = end.settings_replies(driver.query_settings())
        assert answer is not None
        assert not driver.replies(answer).values.size  # a reported setting is not a reading
    raise AssertionError(driver.not_ready())
