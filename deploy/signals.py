"""Inputs of the supervisor in each tick. A text is empty if there is nothing to report."""

from typing import NamedTuple

from footfall.deploy.command_source import Stop
from footfall.deploy.modes import Mode


class Implausible(NamedTuple):
    """Contradictory sensor readings."""

    fault: str  # in one line
    leads_to: Mode


class MotorSignals(NamedTuple):
    """Motor that has been silent longest, and the first error that a motor reports."""

    silence_s: float
    silent: str  # motor's name
    error: str = ""


class ImuSignals(NamedTuple):
    """State of the IMU."""

    silence_s: float
    tilt_rad: float
    oldest_part: str = ""  # part of the IMU that has been silent longest


class PolicySignals(NamedTuple):
    """Result of the policy's last step."""

    command_finite: bool = True
    late_steps: int = 0  # consecutive late policy steps
    step_s: float = 0.0  # duration of the last step; infinite if it was interrupted
    error: str = ""


class BusSignals(NamedTuple):
    """State of the buses."""

    frames_refused: int = 0  # total so far
    fault: str = ""  # name of a failed bus, and the reason


class TimeSignals(NamedTuple):
    """Timing of the loop."""

    pause_s: float = 0.0  # time since the previous tick
    skipped_share: float = 0.0  # of the last second's ticks


class StartSignals(NamedTuple):
    """What prevents the motors from being enabled."""

    not_ready: str = ""  # motor that may not be enabled yet, and the reason
    first_pose: str = ""  # reason why the reported initial joint positions are impossible


class EndSignals(NamedTuple):
    """Requests to end the run."""

    finish: bool = False  # end the run
    may_lie: bool = False  # the robot is able and permitted to lie down
    caught: bool = False  # a person takes hold of the robot while it steps in place
    stopped: bool = False  # the policy has had enough time to stop
    skip_lie_down: bool = False  # end the run without lying down


class WiringSignals(NamedTuple):
    """State of the wiring check; defaults in a run without one."""

    due: bool = False  # it must run before the robot stands up or walks
    stood: bool = False  # the robot has stood up before the check
    done: bool = False  # successful
    fault: str = ""  # what is wrong with the wiring


class RecoverySignals(NamedTuple):
    """State of getting up after a fall; defaults in a run without permission for it."""

    allowed: bool = False  # neither a stop nor the end of the run was requested
    ready: bool = False  # the robot lies still, and any required request has been made
    stands: bool = False  # on its legs for long enough
    tries: int = 0  # number of tries since the fall, including the current one
    tried_s: float = 0.0  # duration of the current try


class Signals(NamedTuple):
    """All signals of one tick."""

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
    posture_done: bool = False  # the robot has finished standing up or lying down
    stop: Stop | None = None  # requested from outside
    battery: str = ""  # reason why the battery ends the run
    recovery: RecoverySignals = RecoverySignals()
