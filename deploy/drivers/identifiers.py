"""Check for two senders with the same identifier on one bus."""

from collections.abc import Callable, Sequence

from footfall.common.errors import UserError
from footfall.deploy.drivers import foot_force
from footfall.deploy.wiring import Wiring

Identifiers = Callable[[int], tuple[int, ...]]  # from a motor id to all its 11-bit identifiers


def check_identifiers(
    wiring: Wiring, identifiers: Sequence[Identifiers], imu_identifiers: tuple[int, ...]
) -> None:
    """Raise UserError if a motor shares an identifier with another motor or with a sensor.

    Args:
        wiring: buses and ids of the motors.
        identifiers: (n,) identifiers in the protocol of each joint's motor.
        imu_identifiers: identifiers of the IMU.
    """
    taken: dict[tuple[int, int], str] = {
        (channel, identifier): "the IMU"
        for channel in range(len(wiring.buses))
        for identifier in imu_identifiers
    }
    foot_identifiers = foot_force.identifiers(len(wiring.foot_channel)).tolist()
    for channel, identifier in zip(wiring.foot_channel.tolist(), foot_identifiers, strict=True):
        if identifier in imu_identifiers:
            raise UserError(f"the IMU and a foot's force sensor would both use identifier {identifier:#05x}")
        taken[channel, identifier] = "a foot's force sensor"
    for joint, identifiers_of in enumerate(identifiers):
        channel, label = int(wiring.channel[joint]), wiring.label(joint)
        own = identifiers_of(int(wiring.motor_id[joint]))
        for identifier in own:
            if (channel, identifier) in taken:
                other = taken[channel, identifier]
                raise UserError(
                    f"{label} and {other} would both use identifier {identifier:#05x}: change a motor's id"
                )
        taken.update(dict.fromkeys(((channel, identifier) for identifier in own), label))
