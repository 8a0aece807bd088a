"""Which identifiers of a bus belong to whom: two that share one would be taken for one another."""

from collections.abc import Callable, Sequence

from footfall.common.errors import UserError
from footfall.deploy.drivers import imu
from footfall.deploy.wiring import Wiring

Identifiers = Callable[[int], tuple[int, ...]]  # of a motor id: all 11-bit identifiers that it sends or hears


def check_identifiers(wiring: Wiring, identifiers: Sequence[Identifiers]) -> None:
    """Raise UserError for a motor whose frames would be taken for those of another or of the IMU.

    Args:
        wiring: which motor sits where.
        identifiers: (n,) what the motors of each joint's maker send and hear.
    """
    taken: dict[tuple[int, int], str] = {
        (channel, identifier): "the IMU" for channel in range(len(wiring.buses)) for identifier in imu.IDS
    }
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
