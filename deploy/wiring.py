"""Which motor sits where on the buses, from `robot.yaml`."""

from dataclasses import dataclass, replace

import numpy as np

from footfall.robots.description import Robot


@dataclass(frozen=True)
class Wiring:
    """A robot's buses and the place of each motor. Arrays are in joint order."""

    buses: tuple[str, ...]
    channel: np.ndarray  # (n,) intp, index into `buses`
    motor_id: np.ndarray  # (n,) intp
    imu_channel: int
    models: tuple[str, ...]  # (n,) motor models, which tell the protocol and its ranges
    gear_ratio: np.ndarray  # (n,) turns of the rotor for one of the joint
    timeout_s: np.ndarray  # (n,) after which a motor that hears nothing shall switch itself off
    watchdog_endpoints: np.ndarray  # (n, 2) ids of enable_watchdog and watchdog_timeout, 0 for none
    joint_names: tuple[str, ...]

    def take(self, joints: np.ndarray) -> "Wiring":
        """The same buses with some joints (indices) alone."""
        return replace(
            self,
            channel=self.channel[joints],
            motor_id=self.motor_id[joints],
            models=tuple(self.models[joint] for joint in joints),
            gear_ratio=self.gear_ratio[joints],
            timeout_s=self.timeout_s[joints],
            watchdog_endpoints=self.watchdog_endpoints[joints],
            joint_names=tuple(self.joint_names[joint] for joint in joints),
        )

    def place(self, joint: int) -> str:
        """Where to look for a joint's motor, for messages."""
        bus, motor = self.buses[self.channel[joint]], self.motor_id[joint]
        return f"{self.joint_names[joint]} ({bus}, id {motor})"


def wire(robot: Robot) -> Wiring:
    """The wiring of a robot."""
    joints = robot.description.joints
    buses = tuple(dict.fromkeys([*(j.bus for j in joints), robot.description.imu_bus]))
    channel = np.array([buses.index(joint.bus) for joint in joints])
    motor_id = np.array([joint.id for joint in joints])
    return Wiring(
        buses=buses,
        channel=channel,
        motor_id=motor_id,
        imu_channel=buses.index(robot.description.imu_bus),
        models=tuple(robot.description.motors[joint.motor].protocol for joint in joints),
        gear_ratio=robot.motor_figures("gear_ratio"),
        timeout_s=robot.motor_figures("timeout_s"),
        watchdog_endpoints=np.array(
            [robot.description.motors[joint.motor].watchdog_endpoints or (0, 0) for joint in joints]
        ),
        joint_names=robot.joint_names,
    )
