"""A row of the fault table, and the detection times that rows share."""

from typing import NamedTuple

from footfall.plant.injection import Injection

# Longest times from a fault to damping.
SILENCE_S = 0.055
IMPLAUSIBLE_S = 0.1
QUEUE_S = 0.11  # a queue that grows by half of the arriving frames: twice the silence
LATER_S = 0.2  # faults that build up for longer; each row gives its reason. Likewise:
PAUSING_S = 0.3
SOON_S = 0.6
SLOW_S = 1.5  # a joint that hardly moves, or a body that hardly turns


class FaultKind(NamedTuple):
    """One row."""

    name: str
    inject: Injection  # called with the run: in the walk, at a moment that is drawn, or before the first tick
    within_s: float | None = IMPLAUSIBLE_S  # from the fault to damping; None if it need not be noticed
    reason: str = ""  # why it cannot be noticed, or not sooner
    main: bool = False  # tried on every robot
    estimating: bool = False  # tried with policies that need a base estimate
    starting: bool = False  # present before the first tick
    observed_s: float = 2.0  # after the fault, until the run ends
    wiring: bool = False  # in a run with a wiring check
    lying: bool = False  # the robot lies at first, if it can
    getting_up: bool = False  # while the robot gets up after a fall
    powered: bool = False  # on a robot with a battery, whose motors report its voltage
    group: str = ""  # heading above the row
