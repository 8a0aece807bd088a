"""What the supervisor looks at in each tick. A text is empty where there is nothing to report."""

from typing import NamedTuple

from footfall.deploy.command_source import Stop
from footfall.deploy.modes import Mode


class Implausible(NamedTuple):
    """Readings that contradict each other."""

    fault: str  # in one line
    leads_to: Mode


class MotorSignals(NamedTuple):
    """The motor that has been silent longest, and the first error that a motor reports."""

    silence_s: float
    silent: str  # its place
    error: str = ""


class ImuSignals(NamedTuple):
    """The IMU's reading."""

    silence_s: float
    tilt_rad: float
    oldest_part: str = ""  # that has been silent longest


class PolicySignals(NamedTuple):
    """The policy's last step."""

    command_finite: bool = True
    late_steps: int = 0  # policy steps in a row that were late
    step_s: float = 0.0  # duration of the last step; infinite if it was interrupted
    error: str = ""


class BusSignals(NamedTuple):
    """The buses."""

    frames_refused: int = 0  # so far
    fault: str = ""  # which bus does not work, and why


class TimeSignals(NamedTuple):
    """How the loop keeps time."""

    pause_s: float = 0.0  # between this tick and the one before
    skipped_share: float = 0.0  # of the ticks of the last second


class StartSignals(NamedTuple):
    """What keeps motors from being given stiffness."""

    not_ready: str = ""  # which motor may not be enabled yet, and why
    first_pose: str = ""  # why the joints cannot be where they say that they begin


class EndSignals(NamedTuple):
    """The end of the run."""

    finish: bool = False  # the run shall end
    may_lie: bool = False  # the robot can lie down, and may
    caught: bool = False  # somebody takes hold of the robot while it steps in place
    stopped: bool = False  # the policy was given the time to stand still
    skip_lie_down: bool = False  # the run shall end without lying down


class WiringSignals(NamedTuple):
    """The wiring check; nothing in a run without one."""

    due: bool = False  # before the robot stands up, or walks
    stood: bool = False  # the robot has stood up before it
    done: bool = False  # the wiring is right
    fault: str = ""  # the wiring is wrong


class RecoverySignals(NamedTuple):
    """Getting up after a fall; nothing in a run without consent."""

    allowed: bool = False  # the robot may get up: nobody has asked for a stop, or for the end
    ready: bool = False  # it lies still, and whoever has to ask for it has asked
    stands: bool = False  # on its legs, for long enough
    tries: int = 0  # since the fall, the present one included
    tried_s: float = 0.0  # duration of the present one


class Signals(NamedTuple):
    """All of it."""

    now_s: float
    motors: MotorSignals
    imu: ImuSignals
    policy: PolicySignals = PolicySignals()
    bus: BusSignals = BusSignals()
    time: TimeSignals = TimeSignals()
    start: StartSignals = StartSignals()
    end: EndSignals = EndSignals()
    implausible: Implausible | None = None
    wiring: WiringSignals = WiringSignals()
    posture_done: bool = False  # the robot has stood up, or has lain down
    stop: Stop | None = None  # that was asked for from outside
    battery: str = ""  # why it ends the run
    recovery: RecoverySignals = RecoverySignals()
