"""Which driver speaks to a robot's motors."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import damiao, mit, robstride
from footfall.deploy.drivers.damiao import DamiaoDriver, DamiaoMotorEnd
from footfall.deploy.drivers.driver import Driver, MotorEnd
from footfall.deploy.drivers.mit_driver import MitDriver, MitMotorEnd
from footfall.deploy.drivers.mixed import MixedDriver, MixedMotorEnd
from footfall.deploy.drivers.robstride import RobstrideDriver, RobstrideMotorEnd
from footfall.deploy.wiring import Wiring


class Ends(NamedTuple):
    """Both ends of a protocol."""

    controller: Callable[[Wiring], Driver]
    motors: Callable[[Wiring], MotorEnd]


PROTOCOLS: dict[str, Ends] = {  # by motor model
    **dict.fromkeys(mit.RANGES, Ends(MitDriver, MitMotorEnd)),
    **dict.fromkeys(damiao.RANGES, Ends(DamiaoDriver, DamiaoMotorEnd)),
    **dict.fromkeys(robstride.RANGES, Ends(RobstrideDriver, RobstrideMotorEnd)),
}


def open_driver(wiring: Wiring) -> Driver:
    """The controller's end; raises UserError for a motor or a motor id that no protocol here knows."""
    parts = _parts(wiring)
    if len(parts) == 1:
        return parts[0][0].controller(wiring)
    return MixedDriver([(ends.controller(wiring.take(joints)), joints) for ends, joints in parts])


def open_motor_end(wiring: Wiring) -> MotorEnd:
    """The motors' end; errors as for `open_driver`."""
    parts = _parts(wiring)
    if len(parts) == 1:
        return parts[0][0].motors(wiring)
    return MixedMotorEnd([(ends.motors(wiring.take(joints)), joints) for ends, joints in parts])


def _parts(wiring: Wiring) -> list[tuple[Ends, np.ndarray]]:
    """The protocols of a robot, each with its joints (indices)."""
    for joint, model in zip(wiring.joint_names, wiring.models, strict=True):
        if model not in PROTOCOLS:
            raise UserError(f"joint {joint}: no driver for motor '{model}': there are {', '.join(PROTOCOLS)}")
    ends = [PROTOCOLS[model] for model in wiring.models]
    return [
        (each, np.array([joint for joint, theirs in enumerate(ends) if theirs is each]))
        for each in dict.fromkeys(ends)
    ]
