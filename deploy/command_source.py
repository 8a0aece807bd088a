"""The one way into a run: a command source is asked for a request at each policy step.

A fixed command, a scenario, a mission, a keyboard and a page are all command sources. To write one:

- `poll(status)` returns the newest request at once. It is called from the loop's thread. A source that waits
  for keys or a network does so in a thread of its own and keeps the newest request (`operate/inbox.py` does).
- `status` is the run as it is now. It may be kept or handed to another thread. `status.offer` says what this
  run takes: names of policies, gaits and live settings with their ranges. It changes with the policy
  that decides.
- `stopped` is read at each tick. A source that sets it stops the robot, whatever mode the run is in, and
  cannot take that back.
- What cannot be done is refused with a line in `status.notes`; what goes beyond a range is clipped, with a
  line there, too. The run goes on in both cases.
- A function of the walking time, in s, that returns a velocity command (3,) is a source, too: `source_of`.

In lockstep a source has to depend on nothing but the statuses that it was given; then a run repeats to the
bit. One that is operated by a person runs by the wall clock.
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

VelocityFunction = Callable[[float], np.ndarray]  # time since walking began, s, to (3,) m/s, m/s, rad/s
NO_SETTINGS: Mapping[str, float] = {}


class Wish(StrEnum):
    """What the operator or program wants the robot to do."""

    WALK = "walk"  # follow the velocity
    STAND = "stand"  # at zero velocity
    LIE_DOWN = "lie_down"  # stop, lie down, end the run
    GET_UP = "get_up"  # after a fall, in a run that may; stand at zero velocity otherwise


class Request(NamedTuple):
    """The newest request of a source. Empty fields change nothing."""

    velocity: np.ndarray  # (3,) forward m/s, leftward m/s, yaw rad/s, body frame
    wish: Wish = Wish.WALK
    policy: str = ""  # name of the policy that shall decide; empty for no change
    gait: str = ""  # name of a gait of that policy; empty for no change
    settings: Mapping[str, float] = NO_SETTINGS  # live settings to change, by name
    note: str = ""  # why, in one line, for the run's notes and its log; empty for nothing to tell
    autonomous: bool = False  # whether a program steers, not a person
    owner: str = ""  # who steers; empty for nobody, or the run itself
    settings_by: str = ""  # who asked for the newest setting, if not the owner


class Stop(NamedTuple):
    """A request to bring the robot to rest at once, whatever it does. It is latched."""

    reason: str  # in one line, with who asked
    damp: bool = False  # damp the joints at once; otherwise the robot lies down first, where it can
    by: str = ""  # who asked: an operator, a device


class Offer(NamedTuple):
    """What a run takes."""

    policies: Sequence[str] = ()  # names of those that may decide
    gaits: Sequence[str] = ()  # of the present policy
    settings: Mapping[str, Span] = {}  # of the present policy: see `policies.live_settings.DECLARED`
    commands: CommandRange | None = None  # that the present policy was trained for; None without limits
    get_up: str = ""  # name of the policy that gets the robot up after a fall; empty if it may not


class Pose(NamedTuple):
    """Where the base is, by odometry. Frame: origin and heading (x) of the base when walking began."""

    x_m: float
    y_m: float
    yaw_rad: float


UNKNOWN_POSE = Pose(math.nan, math.nan, math.nan)


class Status(NamedTuple):
    """A run as it is now. Nothing in it is written to afterwards."""

    now_s: float  # of the loop's clock
    walking_s: float  # since walking began; 0 before
    mode: Mode
    policy: str  # name of the policy that decides
    command: np.ndarray  # (3,) that the policy was given in its last step
    velocity: np.ndarray  # (3,) m/s of the base, body frame, estimated; NaN without an estimate
    height_m: float  # of the base above its mean standing foot, estimated; NaN without an estimate
    pose: Pose  # NaN without odometry (`DeployConfig.odometry`)
    faults: Sequence[str]
    notes: Sequence[str]  # all so far: what was refused, clipped or changed, one line each; it only grows
    offer: Offer
    battery: BatteryState = NO_BATTERY
    autonomous: bool = True  # whether a program steers, not a person
    applied: Applied = NOTHING_APPLIED  # gait and live settings that act now

    @property
    def charge(self) -> float:
        """Of the battery, share from 0 to 1; NaN if unknown."""
        return self.battery.charge

    @property
    def field_mode(self) -> FieldMode:
        """What the run is doing, in an operator's terms."""
        return field_mode(self.mode, bool(self.faults), self.autonomous)


class CommandSource(Protocol):
    """Gives the requests that a run follows."""

    @property
    def stopped(self) -> Stop | None:
        """A stop that was asked for; None if none was. Read at each tick, so it has to be cheap."""

    def poll(self, status: Status) -> Request:
        """The newest request, at once. What is asked for while the robot does not walk waits until it does,
        but for lying down."""


class StopSource(Protocol):
    """Something outside that can stop the robot: a device, a topic. Every command source is one."""

    @property
    def stopped(self) -> Stop | None:
        """A stop that was asked for, latched; None if none was. Read at each tick."""


class Scheduled:
    """Velocity commands as a function of the walking time."""

    stopped = None

    def __init__(self, velocity: VelocityFunction) -> None:
        """`velocity`: time since walking began, s, to (3,)."""
        self.velocity = velocity

    def poll(self, status: Status) -> Request:
        return Request(self.velocity(status.walking_s), autonomous=True)


def source_of(given: CommandSource | VelocityFunction) -> CommandSource:
    """A command source: itself, or one that follows a function of the walking time."""
    return given if hasattr(given, "poll") else Scheduled(given)  # type: ignore[return-value]
