"""Which driver speaks to a robot's motors."""

from collections.abc import Callable
from typing import NamedTuple

from footfall.common.errors import UserError
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import Driver, MotorEnd
from footfall.deploy.drivers.mit_driver import MitDriver, MitMotorEnd
from footfall.deploy.wiring import Wiring


class Ends(NamedTuple):
    """Both ends of a protocol."""

    controller: Callable[[Wiring], Driver]
    motors: Callable[[Wiring], MotorEnd]


PROTOCOLS: dict[str, Ends] = dict.fromkeys(mit.RANGES, Ends(MitDriver, MitMotorEnd))  # by motor model


def open_driver(wiring: Wiring) -> Driver:
    """The controller's end; raises UserError for a motor or a motor id that no protocol here knows."""
    return _ends(wiring).controller(wiring)


def open_motor_end(wiring: Wiring) -> MotorEnd:
    """The motors' end; errors as for `open_driver`."""
    return _ends(wiring).motors(wiring)


def _ends(wiring: Wiring) -> Ends:
    for joint, model in zip(wiring.joint_names, wiring.models, strict=True):
        if model not in PROTOCOLS:
            raise UserError(f"joint {joint}: no driver for motor '{model}': there are {', '.join(PROTOCOLS)}")
    return PROTOCOLS[wiring.models[0]]
