"""Which motor sits where on the buses, from `robot.yaml`."""

from dataclasses import dataclass

import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot

MOTOR_IDS = range(1, 0x80)  # below every reply and IMU identifier


@dataclass(frozen=True)
class Wiring:
    """A robot's buses and the place of each motor. Arrays are in joint order."""

    buses: tuple[str, ...]
    channel: np.ndarray  # (n,) intp, index into `buses`
    motor_id: np.ndarray  # (n,) intp
    lookup: np.ndarray  # (buses, 256) intp: joint index of a motor id on a bus, -1 for none
    imu_channel: int
    protocols: tuple[str, ...]  # (n,)
    joint_names: tuple[str, ...]

    def place(self, joint: int) -> str:
        """Where to look for a joint's motor, for messages."""
        bus, motor = self.buses[self.channel[joint]], self.motor_id[joint]
        return f"{self.joint_names[joint]} ({bus}, id {motor})"


def wire(robot: Robot) -> Wiring:
    """The wiring of a robot; raises UserError for a motor id that the protocol cannot carry."""
    joints = robot.description.joints
    for joint in joints:
        if joint.id not in MOTOR_IDS:
            raise UserError(
                f"robot '{robot.name}': joint {joint.name} has motor id {joint.id};"
                f" MIT mode takes {MOTOR_IDS[0]} to {MOTOR_IDS[-1]}"
            )
    buses = tuple(dict.fromkeys([*(j.bus for j in joints), robot.description.imu_bus]))
    channel = np.array([buses.index(joint.bus) for joint in joints])
    motor_id = np.array([joint.id for joint in joints])
    lookup = np.full((len(buses), 256), -1)
    lookup[channel, motor_id] = np.arange(len(joints))
    return Wiring(
        buses=buses,
        channel=channel,
        motor_id=motor_id,
        lookup=lookup,
        imu_channel=buses.index(robot.description.imu_bus),
        protocols=tuple(robot.description.motors[joint.motor].protocol for joint in joints),
        joint_names=robot.joint_names,
    )
