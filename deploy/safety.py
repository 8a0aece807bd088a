"""The safety supervisor: a pure state machine. The robot stands, walks, lies down or is damped.

Its rules are rows of tables. A fault is latched: FALLING and ESTOP end a run, and only a new run clears them.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from footfall.deploy.modes import DAMPED, HELD, MOVING, Mode
from footfall.deploy.safety_config import SafetyConfig
from footfall.deploy.signals import Signals


class State(NamedTuple):
    """State of the supervisor."""

    mode: Mode = Mode.IDLE
    since_s: float = 0.0
    faults: tuple[str, ...] = ()
    over: bool = False  # the run has ended and the motors may be switched off


class Check(NamedTuple):
    """One reason to stop: the modes in which it counts, the fault that it finds, the mode that it leads to.

    A check that leads to LOWERING leaves joints, buses and IMU trustworthy: the robot lies down if it can.
    """

    looks_at: str
    modes: tuple[Mode, ...]
    find: Callable[[Signals, SafetyConfig], str]  # the fault in one line; empty if none
    leads_to: Mode
    limits: tuple[str, ...] = ()  # fields of `SafetyConfig`; empty if any occurrence is a fault


def _own_silence(silence_s: float, s: Signals, c: SafetyConfig) -> str:
    """Why nothing was heard, where the loop itself was silent for most of that time; else empty.

    Motors answer frames, and none goes out while the policy decides or the loop pauses.
    """
    if silence_s - s.time.pause_s > c.silence_timeout_s or s.time.pause_s < 0.5 * silence_s:
        return ""
    if s.policy.step_s >= 0.5 * s.time.pause_s:
        took_ms = s.policy.step_s * 1e3
        return f"the policy ran late: one step took {took_ms:.0f} ms, without a frame to the motors"
    return f"the loop paused for {s.time.pause_s * 1e3:.0f} ms, without a frame to the motors"


def _silent_motor(s: Signals, c: SafetyConfig) -> str:
    if s.motors.silence_s <= c.silence_timeout_s:
        return ""
    if own := _own_silence(s.motors.silence_s, s, c):
        return own
    return f"no reply from {s.motors.silent} for {c.silence_timeout_s * 1e3:.0f} ms"


def _silent_imu(s: Signals, c: SafetyConfig) -> str:
    if s.imu.silence_s <= c.silence_timeout_s:
        return ""
    if own := _own_silence(s.imu.silence_s, s, c):
        return own
    return f"no new IMU reading ({s.imu.oldest_part}) for {c.silence_timeout_s * 1e3:.0f} ms"


def _never_started(s: Signals, c: SafetyConfig) -> str:
    if s.now_s < c.start_timeout_s:
        return ""
    if s.start.not_ready:
        return s.start.not_ready
    who = s.motors.silent if s.motors.silence_s > c.silence_timeout_s else f"the IMU ({s.imu.oldest_part})"
    return f"no answer from {who} within {c.start_timeout_s:g} s of switching on"


def _tilted(s: Signals, c: SafetyConfig) -> str:
    if s.imu.tilt_rad <= c.tilt_limit_rad:
        return ""
    return f"tilt of {s.imu.tilt_rad:.2f} rad is past the limit of {c.tilt_limit_rad:.2f} rad, by the IMU"


def _overdue(s: Signals, c: SafetyConfig) -> str:
    """Motors get no command while a step lasts, and disable themselves in the end."""
    if s.policy.step_s <= c.late_limit_s:
        return ""
    if s.policy.step_s == math.inf:
        return f"the policy ran late: no decision within {c.late_limit_s * 1e3:.0f} ms"
    return f"the policy ran late: one step took {s.policy.step_s * 1e3:.0f} ms"


def _late(s: Signals, c: SafetyConfig) -> str:
    if s.policy.late_steps >= c.late_steps:
        return f"the policy ran late: {s.policy.late_steps} steps in a row took longer than their period"
    return ""


def _paused(s: Signals, c: SafetyConfig) -> str:
    if s.time.pause_s > c.pause_limit_s:
        return f"the loop paused for {s.time.pause_s * 1e3:.0f} ms"
    if s.time.skipped_share > c.skipped_share:
        return (
            f"the loop ran late: {s.time.skipped_share:.0%} of the last second's ticks were left out"
            f" (skipped_share allows {c.skipped_share:.0%})"
        )
    return ""


def _stopped(damp: bool) -> Callable[[Signals, SafetyConfig], str]:
    def find(s: Signals, _: SafetyConfig) -> str:
        return s.stop.reason if s.stop is not None and s.stop.damp is damp else ""

    return find


def _overflow(s: Signals, _: SafetyConfig) -> str:
    return f"bus overflow: {s.bus.frames_refused} frames refused" if s.bus.frames_refused else ""


SIGNAL_CHECKS = (
    Check(
        "the time until every motor and the IMU have answered, and the robot has kept still",
        (Mode.IDLE,),
        _never_started,
        Mode.ESTOP,
        ("start_timeout_s", "still_s"),
    ),
    Check(
        "a joint's first position beyond its range",
        (Mode.IDLE,),
        lambda s, _: s.start.first_pose,
        Mode.ESTOP,
        ("first_pose_rad",),
    ),
    Check(
        "the age of each motor's reading: silence",
        HELD,
        _silent_motor,
        Mode.ESTOP,
        ("silence_timeout_s",),
    ),
    Check(
        "the age of each part of the IMU's reading: silence",
        HELD,
        _silent_imu,
        Mode.ESTOP,
        ("silence_timeout_s",),
    ),
    Check("an error that a motor reports", HELD, lambda s, _: s.motors.error, Mode.ESTOP),
    Check("a tick's lateness", HELD, _paused, Mode.ESTOP, ("pause_limit_s", "skipped_share")),
    Check("the age of the policy's command", MOVING, _overdue, Mode.ESTOP, ("late_limit_s",)),
    Check("a bus that does not work", (Mode.IDLE, *HELD), lambda s, _: s.bus.fault, Mode.ESTOP),
    Check("frames that a bus refuses", (Mode.IDLE, *HELD), _overflow, Mode.ESTOP),
    Check("the base's tilt", HELD, _tilted, Mode.FALLING, ("tilt_limit_rad",)),
    Check(
        "the responses of joints to small motions against the robot's model: wrong wiring",
        (Mode.CHECKING,),
        lambda s, _: s.wiring.fault,
        Mode.ESTOP,
    ),
    Check("a stop from outside that damps at once", (Mode.IDLE, *HELD), _stopped(damp=True), Mode.ESTOP),
    Check(
        "a stop from outside",
        (Mode.IDLE, Mode.CHECKING, *MOVING),
        _stopped(damp=False),
        Mode.LOWERING,
    ),
    Check(
        "the battery's charge, and its voltage under load, where motors report it",
        (Mode.IDLE, Mode.CHECKING, *MOVING),
        lambda s, _: s.battery,
        Mode.LOWERING,
        ("battery.empty_charge", "battery.off_cell_v"),
    ),
    Check("an exception in the policy", MOVING, lambda s, _: s.policy.error, Mode.LOWERING),
    Check(
        "a command that is not finite",
        MOVING,
        lambda s, _: "" if s.policy.command_finite else "the policy's command is not finite",
        Mode.LOWERING,
    ),
    Check("policy steps in a row that outlast their period", MOVING, _late, Mode.LOWERING, ("late_steps",)),
)


def _implausible(leads_to: Mode) -> Callable[[Signals, SafetyConfig], str]:
    def find(s: Signals, _: SafetyConfig) -> str:
        return s.implausible.fault if s.implausible is not None and s.implausible.leads_to is leads_to else ""

    return find


# The result of the sensor checks, whose own rows are in `sensor_checks/table.py`.
READING_CHECKS = tuple(
    Check("readings that contradict each other", modes, _implausible(leads_to), leads_to)
    for modes, leads_to in ((HELD, Mode.ESTOP), (HELD, Mode.FALLING), (MOVING, Mode.LOWERING))
)
CHECKS = (*SIGNAL_CHECKS, *READING_CHECKS)
CHECKS_IN = {mode: tuple(check for check in CHECKS if mode in check.modes) for mode in Mode}


def _ready_to_stand(s: Signals, c: SafetyConfig) -> bool:
    return not s.start.not_ready and max(s.motors.silence_s, s.imu.silence_s) <= c.silence_timeout_s


PROGRESS: dict[Mode, tuple[Callable[[Signals, SafetyConfig], bool], Mode]] = {
    Mode.IDLE: (_ready_to_stand, Mode.STANDING),
    Mode.CHECKING: (lambda s, _: s.wiring.done, Mode.STANDING),
    Mode.STANDING: (lambda s, _: s.posture_done, Mode.WALKING),
    Mode.STOPPING: (lambda s, _: s.end.stopped, Mode.LOWERING),
}
CHECKED_FIRST = {Mode.IDLE: Mode.STANDING, Mode.STANDING: Mode.WALKING}  # a wiring check may come between


def advance(state: State, signals: Signals, config: SafetyConfig) -> State:
    """The state after one tick. Faults come first, then a request to end, then progress."""
    if state.over:
        return state
    now = signals.now_s
    if (failed := _failure(state, state.mode, signals, config)) is not None:
        return failed
    if state.mode in DAMPED:
        return damped(state, now, config)
    if state.mode is Mode.LOWERING:
        done = signals.posture_done or signals.end.skip_lie_down
        return State(Mode.ESTOP if state.faults else Mode.RELEASING, now, state.faults) if done else state
    end = signals.end
    if end.finish and (state.mode is not Mode.STOPPING or end.skip_lie_down):
        ending = _lowered_or(Mode.RELEASING, state.mode, signals)
        may_stop = ending is Mode.LOWERING or (end.caught and not end.skip_lie_down)
        stops = may_stop and state.mode is Mode.WALKING
        return State(Mode.STOPPING if stops else ending, now, state.faults)
    ready, following = PROGRESS.get(state.mode, (None, state.mode))
    if ready is None or not ready(signals, config):
        return state
    if signals.wiring.due and CHECKED_FIRST.get(state.mode) is following:
        following = Mode.CHECKING
    elif state.mode is Mode.CHECKING and signals.wiring.stood:
        following = Mode.WALKING
    if following is Mode.LOWERING:
        following = _lowered_or(Mode.RELEASING, state.mode, signals)
    return _failure(state, following, signals, config) or State(following, now, state.faults)


def damped(state: State, now_s: float, config: SafetyConfig) -> State:
    """The state one tick later, of a robot that is damped."""
    if now_s - state.since_s < config.damping_s:
        return state
    final = Mode.IDLE if state.mode is Mode.RELEASING else state.mode
    return State(final, now_s, state.faults, over=True)


def _failure(state: State, mode: Mode, signals: Signals, config: SafetyConfig) -> State | None:
    """The state after the first fault that counts in a mode; None without one."""
    for check in CHECKS_IN[mode]:
        fault = check.find(signals, config)
        if fault:
            leads_to = check.leads_to
            if leads_to is Mode.LOWERING:
                leads_to = _lowered_or(Mode.ESTOP, state.mode, signals)
            return State(leads_to, signals.now_s, (*state.faults, fault))
    return None


def _lowered_or(otherwise: Mode, mode: Mode, signals: Signals) -> Mode:
    """LOWERING for a robot that can lie down and whose joints have stiffness, else another mode."""
    stands = mode in MOVING or (mode is Mode.CHECKING and signals.wiring.stood)
    can_lie = signals.end.may_lie and not signals.end.skip_lie_down and stands
    return Mode.LOWERING if can_lie else otherwise
