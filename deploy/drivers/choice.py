"""Which driver speaks to a robot's motors."""

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import damiao, mit, odrive, robstride
from footfall.deploy.drivers.damiao import DamiaoDriver
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.drivers.identifiers import check_identifiers
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.drivers.mixed import MixedDriver
from footfall.deploy.drivers.odrive import OdriveDriver
from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.wiring import Wiring

Maker = type[MitDriver] | type[DamiaoDriver] | type[RobstrideDriver] | type[OdriveDriver]

DRIVERS: dict[str, Maker] = {  # by motor model
    **dict.fromkeys(mit.RANGES, MitDriver),
    **dict.fromkeys(damiao.RANGES, DamiaoDriver),
    **dict.fromkeys(robstride.RANGES, RobstrideDriver),
    odrive.MODEL: OdriveDriver,
}


def open_driver(wiring: Wiring) -> Driver:
    """Raises UserError for a motor or a motor id that no driver here knows, or ids that collide on a bus."""
    parts = by_maker(wiring)
    if len(parts) == 1:
        return parts[0][0](wiring)
    return MixedDriver([(maker(wiring.take(joints)), joints) for maker, joints in parts])


def by_maker(wiring: Wiring) -> list[tuple[Maker, np.ndarray]]:
    """The drivers of a robot's motors, each with its joints (indices); errors as for `open_driver`."""
    for joint, model in zip(wiring.joint_names, wiring.models, strict=True):
        if model not in DRIVERS:
            raise UserError(f"joint {joint}: no driver for motor '{model}': there are {', '.join(DRIVERS)}")
    makers = [DRIVERS[model] for model in wiring.models]
    check_identifiers(wiring, [maker.identifiers for maker in makers])
    return [
        (each, np.array([joint for joint, theirs in enumerate(makers) if theirs is each]))
        for each in dict.fromkeys(makers)
    ]
