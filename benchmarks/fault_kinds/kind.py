"""What a row of the fault table says."""

from typing import NamedTuple

from footfall.plant.injection import Injection

SILENCE_S = 0.055
IMPLAUSIBLE_S = 0.1
QUEUE_S = 0.11  # of a queue that grows by half of what arrives: twice the silence
LATER_S = 0.2  # of what adds up for longer than that, by its reason in the table; likewise:
PAUSING_S = 0.3
SOON_S = 0.6
SLOW_S = 1.5  # of a joint that hardly moves, or a body that hardly turns


class FaultKind(NamedTuple):
    """One row."""

    name: str
    inject: Injection  # called with the run: in the walk, at a moment that is drawn, or before the first tick
    within_s: float | None = IMPLAUSIBLE_S  # from the fault to damping; None if it need not be noticed
    reason: str = ""  # why it cannot be noticed, or not sooner
    main: bool = False  # tried on every robot
    estimating: bool = False  # tried with policies whose base's motion is estimated
    starting: bool = False  # there from the beginning
    observed_s: float = 2.0  # after the fault, until the run ends
    wiring: bool = False  # in a run with a wiring check
    lying: bool = False  # of a robot that lies at first, if it can
    group: str = ""  # heading of the table that it stands under
