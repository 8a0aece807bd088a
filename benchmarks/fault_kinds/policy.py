"""Faults of the policy and of the program."""

from collections.abc import Callable
from typing import Any

import numpy as np

from fault_kinds.kind import FaultKind
from footfall.plant.injection import FaultInjector, Injection
from footfall.robots.actuator import JointCommand


def decides(change: Callable[[FaultInjector, JointCommand], Any]) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.policy.change_decision = lambda decision: change(injector, decision)

    return inject


def filled(field: str, value: float) -> Injection:
    return decides(lambda _, decision: decision._replace(**{field: np.full_like(decision.position, value)}))


def raises(*_: object) -> Any:
    raise RuntimeError("on purpose")


def _stance_raises(injector: FaultInjector) -> None:
    injector.policy.replace_stance = raises


def _command_raises(injector: FaultInjector) -> None:
    injector.command_source.replacement = raises


def _command_nan(injector: FaultInjector) -> None:
    injector.command_source.replacement = lambda: np.full(3, np.nan)


def _bang_bang(injector: FaultInjector, decision: JointCommand) -> JointCommand:
    lower, upper = injector.robot.soft_limits
    at_upper = injector.rng.random() < 0.5
    return decision._replace(position=upper if at_upper else lower, kp=np.full_like(lower, 500.0))


def _random(injector: FaultInjector, decision: JointCommand) -> JointCommand:
    n = len(decision.position)
    return JointCommand(
        injector.rng.uniform(-10, 10, n),
        injector.rng.uniform(-50, 50, n),
        injector.rng.uniform(0, 500, n),
        injector.rng.uniform(0, 5, n),
        injector.rng.uniform(-100, 100, n),
    )


def receive_raises(injector: FaultInjector) -> None:
    injector.bus.incoming = raises


def _send_raises(injector: FaultInjector) -> None:
    injector.bus.outgoing = raises


def refused(injector: FaultInjector) -> None:
    """An interface whose queue is full."""
    send = injector.bus.send
    injector.bus.send = lambda frames, now_us: send(frames, now_us) * 0 + 1  # type: ignore[method-assign]


LIMITED = "a command within the limits is no fault; a fall is noticed by its tilt"
NOTHING_SENT = "no more frames are sent: motors stop by their own timeout"
POLICY = (
    *(
        FaultKind(f"policy: {name} of {value}", filled(name, value), 0.03, main=name == "kp")
        for name, value in (("position", np.nan), ("kp", np.nan), ("torque", np.inf), ("kd", -np.inf))
    ),
    FaultKind("policy raises", decides(raises), 0.03, main=True),
    FaultKind("policy returns nothing", decides(lambda *_: None), 0.03),
    FaultKind(
        "policy's command lacks a joint",
        decides(lambda _, decision: JointCommand(*(part[:-1] for part in decision))),
        0.03,
    ),
    FaultKind("policy: kp of 1e9", filled("kp", 1e9), None, LIMITED),
    FaultKind("policy: kd of 1e300", filled("kd", 1e300), None, LIMITED),
    FaultKind("policy: torque of 1e9", filled("torque", 1e9), None, LIMITED),
    FaultKind("policy: position of 1e9", filled("position", 1e9), None, LIMITED),
    FaultKind("policy alternates between the limits", decides(_bang_bang), None, LIMITED, main=True),
    FaultKind("policy's commands are random", decides(_random), None, LIMITED, main=True),
    FaultKind("the velocity command raises", _command_raises, 0.03),
    FaultKind(
        "the velocity command is not a number",
        _command_nan,
        None,
        "it counts as 0, with a note",
    ),
    FaultKind("the policy's stance raises", _stance_raises, 0.03, needs_estimate=True),
    FaultKind("receiving raises", receive_raises, 0.01),
    FaultKind("sending raises", _send_raises, 0.01, NOTHING_SENT),
    FaultKind("the interface refuses frames", refused, 0.01, NOTHING_SENT),
)
