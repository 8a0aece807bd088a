"""Safety supervisor: a pure state machine. The robot stands, walks, lies down or is damped.

Its rules are rows of tables (`safety_checks.py`). A fault is latched: FALLING and ESTOP end a run, and only a
new run clears them. With an operator's consent a fallen robot may get up, which clears that fall.
"""

from collections.abc import Callable
from typing import NamedTuple

from footfall.deploy.modes import DAMPED, DECIDING, MOVING, Mode
from footfall.deploy.safety_checks import CHECKS
from footfall.deploy.safety_config import SafetyConfig
from footfall.deploy.signals import Signals


class State(NamedTuple):
    """State of the supervisor."""

    mode: Mode = Mode.IDLE
    since_s: float = 0.0
    faults: tuple[str, ...] = ()
    over: bool = False  # the run has ended and the motors may be disabled
    tries: int = 0  # number of tries to get up since the fall


CHECKS_IN = {mode: tuple(check for check in CHECKS if mode in check.modes) for mode in Mode}


def _ready_to_stand(s: Signals, c: SafetyConfig) -> bool:
    return not s.start.not_ready and max(s.motors.silence_s, s.imu.silence_s) <= c.silence_timeout_s


PROGRESS: dict[Mode, tuple[Callable[[Signals, SafetyConfig], bool], Mode]] = {
    Mode.IDLE: (_ready_to_stand, Mode.STANDING),
    Mode.CHECKING: (lambda s, _: s.wiring.done, Mode.STANDING),
    Mode.STANDING: (lambda s, _: s.posture_done, Mode.WALKING),
    Mode.STOPPING: (lambda s, _: s.end.stopped, Mode.LOWERING),
    Mode.RECOVERING: (lambda s, _: s.recovery.stands, Mode.STANDING),
}
CHECKED_FIRST = {Mode.IDLE: Mode.STANDING, Mode.STANDING: Mode.WALKING}  # delayed by a due wiring check


def advance(state: State, signals: Signals, config: SafetyConfig) -> State:
    """State after one tick. Faults have priority, then a request to end, then progress."""
    if state.over:
        return state
    now = signals.now_s
    if (fault_state := _failure(state, state.mode, signals, config)) is not None:
        return fault_state
    if state.mode is Mode.FALLING and signals.recovery.allowed:
        return _fallen(state, signals, config)
    if state.mode in DAMPED:
        return damped(state, now, config)
    if state.mode is Mode.LOWERING:
        done = signals.posture_done or signals.end.skip_lie_down
        return State(Mode.ESTOP if state.faults else Mode.RELEASING, now, state.faults) if done else state
    end = signals.end
    if end.finish and state.mode is Mode.RECOVERING:
        return State(Mode.FALLING, now, state.faults, tries=state.tries)
    if end.finish and (state.mode is not Mode.STOPPING or end.skip_lie_down):
        ending = _lowering_or(Mode.RELEASING, state.mode, signals)
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
        following = _lowering_or(Mode.RELEASING, state.mode, signals)
    faults = () if state.mode is Mode.RECOVERING else state.faults  # the robot stands: faults end
    fault_state = _failure(state, following, signals, config)
    return fault_state or State(following, now, faults, tries=state.tries)


def _fallen(state: State, signals: Signals, config: SafetyConfig) -> State:
    """Next state of a damped robot that may get up: it waits until the robot is at rest."""
    now, limits = signals.now_s, config.recovery
    waited_s = now - state.since_s
    if state.tries >= limits.tries:
        return damped(state, now, config)
    if waited_s >= max(limits.wait_s, config.damping_s):
        reason = f"the robot stays down: no rest or no request to get up within {limits.wait_s:g} s"
        return State(state.mode, now, (*state.faults, reason), over=True)
    if waited_s < config.damping_s or not signals.recovery.ready:
        return state
    following = Mode.RECOVERING
    fault_state = _failure(state, following, signals, config)
    return fault_state or State(following, now, state.faults, tries=state.tries + 1)


def damped(state: State, now_s: float, config: SafetyConfig) -> State:
    """Next state of a damped robot."""
    if now_s - state.since_s < config.damping_s:
        return state
    final = Mode.IDLE if state.mode is Mode.RELEASING else state.mode
    return State(final, now_s, state.faults, over=True)


def _failure(state: State, mode: Mode, signals: Signals, config: SafetyConfig) -> State | None:
    """State after the first fault that applies in a mode; None without one."""
    for check in CHECKS_IN[mode]:
        fault = check.find(signals, config)
        if fault:
            leads_to = check.leads_to
            if leads_to is Mode.LOWERING and state.mode is Mode.LOWERING:  # the robot already lies down
                if fault in state.faults:
                    continue
                return state._replace(faults=(*state.faults, fault))
            if leads_to is Mode.LOWERING:
                leads_to = _lowering_or(Mode.ESTOP, state.mode, signals)
            tries = 0 if _walked_well(state, signals, config) else state.tries
            return State(leads_to, signals.now_s, (*state.faults, fault), tries=tries)
    return None


def _walked_well(state: State, signals: Signals, config: SafetyConfig) -> bool:
    """Whether the robot has walked long enough that a new fault is unrelated to the fall."""
    return state.mode in DECIDING and signals.now_s - state.since_s >= config.recovery.same_fall_s


def _lowering_or(alternative: Mode, mode: Mode, signals: Signals) -> Mode:
    """LOWERING for a robot that can lie down and whose joints have stiffness, otherwise `alternative`."""
    stands = mode in MOVING or (mode is Mode.CHECKING and signals.wiring.stood)
    can_lie = signals.end.may_lie and not signals.end.skip_lie_down and stands
    return Mode.LOWERING if can_lie else alternative
