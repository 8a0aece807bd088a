"""A row of the fault table, and the detection times that rows share."""

from typing import NamedTuple

from footfall.plant.injection import Injection

# Upper limits of the time from a fault to damping, s.
SILENCE_S = 0.055
IMPLAUSIBLE_S = 0.1
QUEUE_S = 0.11  # a queue that grows by half of the arriving frames: twice the silence


class FaultKind(NamedTuple):
    """One row of the fault table."""

    name: str
    inject: Injection  # called at a random time of the walk, or before the first tick
    within_s: float | None = IMPLAUSIBLE_S  # limit from the fault to damping; None: no detection is required
    reason: str = ""  # why the fault cannot be detected, or not earlier
    main: bool = False  # tried with every policy; other rows only with some, see `SUBJECTS`
    needs_estimate: bool = False  # tried only with policies that need a base estimate
    starting: bool = False  # present before the first tick
    observed_s: float = 2.0  # from the fault to the end of the run
    wiring: bool = False  # the run has a wiring check
    lying: bool = False  # the robot lies at the start, if it can stand up
    getting_up: bool = False  # the fault comes while the robot gets up after a fall
    powered: bool = False  # the robot has a battery, and motors that report its voltage
    group: str = ""  # heading above the row
