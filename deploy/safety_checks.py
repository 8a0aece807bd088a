"""Faults detected by the supervisor: one row for each reason to stop."""

import math
from collections.abc import Callable
from typing import NamedTuple

from footfall.deploy.modes import HELD, MOVING, UPRIGHT, Mode
from footfall.deploy.safety_config import SafetyConfig
from footfall.deploy.signals import Signals

DECIDED = (*MOVING, Mode.RECOVERING)  # a policy decides, or is about to
ENDED = (Mode.IDLE, Mode.CHECKING, *DECIDED)  # modes that a stop or an empty battery ends


class Check(NamedTuple):
    """One reason to stop: modes in which it applies, detected fault, resulting mode.

    After a check that leads to LOWERING, joints, buses and IMU still work: the robot lies down if it can.
    """

    quantity: str
    modes: tuple[Mode, ...]
    find: Callable[[Signals, SafetyConfig], str]  # fault in one line; empty if none
    leads_to: Mode
    limits: tuple[str, ...] = ()  # fields of `SafetyConfig`; empty if any occurrence is a fault


def _own_silence(silence_s: float, s: Signals, c: SafetyConfig) -> str:
    """Reason of a silence if the loop itself sent nothing for most of it; otherwise empty.

    Motors reply to frames, and none is sent while the policy computes or the loop pauses.
    """
    if silence_s - s.time.pause_s > c.silence_timeout_s or s.time.pause_s < 0.5 * silence_s:
        return ""
    if s.policy.step_s >= 0.5 * s.time.pause_s:
        took_ms = s.policy.step_s * 1e3
        return f"the policy ran late: one step took {took_ms:.0f} ms, without a frame to the motors"
    return f"the loop paused for {s.time.pause_s * 1e3:.0f} ms, without a frame to the motors"


def _motor_silent(s: Signals, c: SafetyConfig) -> str:
    if s.motors.silence_s <= c.silence_timeout_s:
        return ""
    missing = f"no reply from {s.motors.silent} for {c.silence_timeout_s * 1e3:.0f} ms"
    return _own_silence(s.motors.silence_s, s, c) or missing


def _imu_silent(s: Signals, c: SafetyConfig) -> str:
    if s.imu.silence_s <= c.silence_timeout_s:
        return ""
    missing = f"no new IMU reading ({s.imu.oldest_part}) for {c.silence_timeout_s * 1e3:.0f} ms"
    return _own_silence(s.imu.silence_s, s, c) or missing


def _never_started(s: Signals, c: SafetyConfig) -> str:
    if s.now_s < c.start_timeout_s:
        return ""
    if s.start.not_ready:
        return s.start.not_ready
    silent = s.motors.silent if s.motors.silence_s > c.silence_timeout_s else f"the IMU ({s.imu.oldest_part})"
    return f"no answer from {silent} within {c.start_timeout_s:g} s of switching on"


def _tilted(s: Signals, c: SafetyConfig) -> str:
    if s.imu.tilt_rad <= c.tilt_limit_rad:
        return ""
    return f"tilt of {s.imu.tilt_rad:.2f} rad exceeds the limit of {c.tilt_limit_rad:.2f} rad, by the IMU"


def _overdue(s: Signals, c: SafetyConfig) -> str:
    """A step that is too long: motors get no command meanwhile, and finally disable themselves."""
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
            f"the loop ran late: {s.time.skipped_share:.0%} of the last second's ticks were skipped"
            f" (skipped_share allows {c.skipped_share:.0%})"
        )
    return ""


def _stopped(damp: bool) -> Callable[[Signals, SafetyConfig], str]:
    def find(s: Signals, _: SafetyConfig) -> str:
        return s.stop.reason if s.stop is not None and s.stop.damp is damp else ""

    return find


def _overflow(s: Signals, _: SafetyConfig) -> str:
    return f"bus overflow: {s.bus.frames_refused} frames refused" if s.bus.frames_refused else ""


def _not_up(s: Signals, c: SafetyConfig) -> str:
    if s.recovery.tried_s < c.recovery.try_s:
        return ""
    done, tries = s.recovery.tries, c.recovery.tries
    following = ": the robot stays down" if done >= tries else ""
    return f"not standing {c.recovery.try_s:g} s after it started to get up, try {done} of {tries}{following}"


SIGNAL_CHECKS = (
    Check(
        "time until every motor and the IMU reply and the robot is at rest",
        (Mode.IDLE,),
        _never_started,
        Mode.ESTOP,
        ("start_timeout_s", "still_s"),
    ),
    Check(
        "initial position of a joint beyond its range",
        (Mode.IDLE,),
        lambda s, _: s.start.first_pose,
        Mode.ESTOP,
        ("first_pose_rad",),
    ),
    Check(
        "age of each motor's reading: silence",
        HELD,
        _motor_silent,
        Mode.ESTOP,
        ("silence_timeout_s",),
    ),
    Check(
        "age of each part of the IMU's reading: silence",
        HELD,
        _imu_silent,
        Mode.ESTOP,
        ("silence_timeout_s",),
    ),
    Check("an error that a motor reports", HELD, lambda s, _: s.motors.error, Mode.ESTOP),
    Check("a tick's lateness", HELD, _paused, Mode.ESTOP, ("pause_limit_s", "skipped_share")),
    Check("the age of the policy's command", DECIDED, _overdue, Mode.ESTOP, ("late_limit_s",)),
    Check("a bus that does not work", (Mode.IDLE, *HELD), lambda s, _: s.bus.fault, Mode.ESTOP),
    Check("frames that a bus refuses", (Mode.IDLE, *HELD), _overflow, Mode.ESTOP),
    Check("the base's tilt", UPRIGHT, _tilted, Mode.FALLING, ("tilt_limit_rad",)),
    Check(
        "responses of joints to small motions, compared with the model: wrong wiring",
        (Mode.CHECKING,),
        lambda s, _: s.wiring.fault,
        Mode.ESTOP,
    ),
    Check("external stop with damping at once", (Mode.IDLE, *HELD), _stopped(damp=True), Mode.ESTOP),
    Check(
        "external stop",
        (*ENDED, Mode.LOWERING),  # in LOWERING it changes how the run ends: it is latched
        _stopped(damp=False),
        Mode.LOWERING,
    ),
    Check(
        "the battery's charge, and its voltage under load, if motors report it",
        ENDED,
        lambda s, _: s.battery,
        Mode.LOWERING,
        ("battery.empty_charge", "battery.max_cell_deviation_v"),
    ),
    Check("an exception in the policy", DECIDED, lambda s, _: s.policy.error, Mode.LOWERING),
    Check(
        "a command that is not finite",
        DECIDED,
        lambda s, _: "" if s.policy.command_finite else "the policy's command is not finite",
        Mode.LOWERING,
    ),
    Check("policy steps in a row that outlast their period", DECIDED, _late, Mode.LOWERING, ("late_steps",)),
    Check(
        "duration of getting up",
        (Mode.RECOVERING,),
        _not_up,
        Mode.FALLING,
        ("recovery.try_s",),
    ),
)


def _implausible(leads_to: Mode) -> Callable[[Signals, SafetyConfig], str]:
    def find(s: Signals, _: SafetyConfig) -> str:
        return s.implausible.fault if s.implausible is not None and s.implausible.leads_to is leads_to else ""

    return find


# Result of the sensor checks, whose rows are in `sensor_checks/table.py`.
READING_CHECKS = tuple(
    Check("readings that contradict each other", modes, _implausible(leads_to), leads_to)
    for modes, leads_to in ((HELD, Mode.ESTOP), (UPRIGHT, Mode.FALLING), (DECIDED, Mode.LOWERING))
)
CHECKS = (*SIGNAL_CHECKS, *READING_CHECKS)
