"""Command sources: the only way to steer a run. A source is polled for a request at each policy step.

Fixed commands, scenarios, missions, keyboards and web pages are command sources. To write one:

- `poll(status)` returns the newest request without waiting. It runs in the loop's thread. A source that waits
  for keys or a network uses its own thread and stores the newest request (see `operate/inbox.py`).
- `status` is a snapshot of the run. It may be stored or given to another thread. `status.offer` lists the
  policies, gaits and live settings of this run, with their ranges. It changes with the policy.
- `stopped` is read at each tick. If a source sets it, the robot stops in any mode, and this cannot be undone.
- An impossible request is refused, and a value out of range is clipped, each with a line in `status.notes`.
  The run continues in both cases.
- A function of the walking time, in s, that returns a velocity command (3,) is a source, too: see
  `source_of`.

In lockstep, a source may depend only on the statuses it received; then a run is reproducible to the bit. A
source operated by a person needs a run in real time.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np

from footfall.deploy.battery import NO_BATTERY, BatteryState
from footfall.deploy.field_mode import FieldMode, field_mode
from footfall.deploy.modes import Mode
from footfall.policies.live_settings import NOTHING_APPLIED, Applied, Span
from footfall.robots.commands import CommandRange

VelocityFunction = Callable[[float], np.ndarray]  # walking time, s, to (3,) m/s, m/s, rad/s
NO_SETTINGS: Mapping[str, float] = {}


class Behaviour(StrEnum):
    """Behaviour requested by an operator or a program."""

    WALK = "walk"  # follow the velocity
    STAND = "stand"  # at zero velocity
    LIE_DOWN = "lie_down"  # stop, lie down, end the run
    GET_UP = "get_up"  # after a fall, if permitted; otherwise stand at zero velocity


class Request(NamedTuple):
    """Newest request of a source. Empty fields change nothing."""

    velocity: np.ndarray  # (3,) forward m/s, leftward m/s, yaw rad/s, body frame
    behaviour: Behaviour = Behaviour.WALK
    policy: str = ""  # name of the requested policy; empty for no change
    gait: str = ""  # name of a gait of that policy; empty for no change
    settings: Mapping[str, float] = NO_SETTINGS  # live settings to change, by name
    note: str = ""  # reason, in one line, for the run's notes and its log; empty for none
    autonomous: bool = False  # whether a program steers, instead of a person
    owner: str = ""  # name of the operator; empty for none, or the run itself
    settings_by: str = ""  # operator who set the newest setting, if not the owner


class Stop(NamedTuple):
    """Request to stop the robot at once, in any state. It is latched."""

    reason: str  # reason in one line, including the origin
    damp: bool = False  # damp the joints at once; otherwise the robot lies down first, if possible
    by: str = ""  # origin: an operator, a device


class Offer(NamedTuple):
    """Options of a run."""

    policies: Sequence[str] = ()  # names of the selectable policies
    gaits: Sequence[str] = ()  # gaits of the current policy
    settings: Mapping[str, Span] = {}  # live settings of the current policy: see `DECLARED`
    commands: CommandRange | None = None  # command ranges of the current policy; None without limits
    get_up: str = ""  # name of the get-up policy; empty if getting up is not permitted


class Pose(NamedTuple):
    """Pose of the base, by odometry. Frame: origin and heading (x) of the base at the start of walking."""

    x_m: float
    y_m: float
    yaw_rad: float


ZERO_COMMAND = np.zeros(3)
UNKNOWN_POSE = Pose(math.nan, math.nan, math.nan)


class Status(NamedTuple):
    """Snapshot of a run, read-only."""

    now_s: float  # time of the loop's clock
    walking_s: float  # since the start of walking; 0 before
    mode: Mode
    policy: str  # name of the current policy
    command: np.ndarray  # (3,) command of the last policy step
    velocity: np.ndarray  # (3,) m/s, estimated velocity of the base, body frame; NaN without an estimate
    height_m: float  # estimated height of the base above its mean stance foot; NaN without an estimate
    pose: Pose  # NaN without odometry (`DeployConfig.odometry`)
    faults: Sequence[str]
    notes: Sequence[str]  # all so far: refused, clipped or changed requests; the list only grows
    offer: Offer
    battery: BatteryState = NO_BATTERY
    autonomous: bool = True  # whether a program steers, instead of a person
    applied: Applied = NOTHING_APPLIED  # gait and live settings that act now

    @property
    def charge(self) -> float:
        """Charge of the battery, 0 to 1; NaN if unknown."""
        return self.battery.charge

    @property
    def field_mode(self) -> FieldMode:
        """State of the run in an operator's terms."""
        return field_mode(self.mode, bool(self.faults), self.autonomous)


class CommandSource(Protocol):
    """Source of the requests for a run."""

    @property
    def stopped(self) -> Stop | None:
        """Requested stop; None if none. Read at each tick, so it must be cheap."""

    def poll(self, status: Status) -> Request:
        """Newest request, without waiting.

        A request before the robot walks takes effect once it walks; lying down takes effect at once.
        """


class StopSource(Protocol):
    """An external source of stops: a device or a topic. Every command source is one, too."""

    @property
    def stopped(self) -> Stop | None:
        """Requested stop, latched; None if none. Read at each tick."""


class Scheduled:
    """Velocity commands as a function of the walking time."""

    stopped = None

    def __init__(self, velocity: VelocityFunction) -> None:
        """`velocity`: walking time, s, to (3,)."""
        self.velocity = velocity

    def poll(self, status: Status) -> Request:
        return Request(self.velocity(status.walking_s), autonomous=True)


def source_of(given: CommandSource | VelocityFunction) -> CommandSource:
    """A command source: `given` itself, or one that follows a function of the walking time."""
    return given if hasattr(given, "poll") else Scheduled(given)  # type: ignore[return-value]
