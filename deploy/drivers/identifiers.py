"""Refuses two senders on one bus that share an identifier."""

from collections.abc import Callable, Sequence

from footfall.common.errors import UserError
from footfall.deploy.drivers import foot_force
from footfall.deploy.wiring import Wiring

Identifiers = Callable[[int], tuple[int, ...]]  # from a motor id to all 11-bit identifiers of that motor


def check_identifiers(wiring: Wiring, identifiers: Sequence[Identifiers], of_imu: tuple[int, ...]) -> None:
    """Raise UserError for a motor that shares an identifier with another motor or with a sensor.

    Args:
        wiring: places of the motors.
        identifiers: (n,) identifiers that the motors of each joint's protocol send and receive.
        of_imu: identifiers that the IMU sends.
    """
    taken: dict[tuple[int, int], str] = {
        (channel, identifier): "the IMU" for channel in range(len(wiring.buses)) for identifier in of_imu
    }
    of_feet = foot_force.identifiers(len(wiring.foot_channel)).tolist()
    for channel, identifier in zip(wiring.foot_channel.tolist(), of_feet, strict=True):
        if identifier in of_imu:
            raise UserError(f"the IMU and a foot's force sensor would both use identifier {identifier:#05x}")
        taken[channel, identifier] = "a foot's force sensor"
    for joint, of_motor in enumerate(identifiers):
        channel, place = int(wiring.channel[joint]), wiring.place(joint)
        own = of_motor(int(wiring.motor_id[joint]))
        for identifier in own:
            if (channel, identifier) in taken:
                other = taken[channel, identifier]
                raise UserError(
                    f"{place} and {other} would both use identifier {identifier:#05x}: change its id"
                )
        taken.update(dict.fromkeys(((channel, identifier) for identifier in own), place))
