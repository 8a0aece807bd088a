"""Faults while a robot gets up after a fall: it ends damped or lying, never stiff."""

from typing import Any

from fault_kinds.frames import bus_dead, silent
from fault_kinds.imu import imu_silent
from fault_kinds.kind import SILENCE_S, FaultKind
from fault_kinds.policy import decides, filled, raises
from fault_kinds.replies import error, temperature
from footfall.deploy.deadline import OverdueError
from footfall.plant.injection import Injection

STUCK = "the readings are right: the robot stands up anyway, or all tries fail"
TRIES_S = 40.0  # longest duration of three tries


def _late(*_: object) -> Any:
    """The policy is interrupted at its deadline, as by a wall clock."""
    raise OverdueError


def _row(name: str, inject: Injection, within_s: float | None, reason: str = "", **rest: Any) -> FaultKind:
    return FaultKind(f"{name}, getting up", inject, within_s, reason, main=True, getting_up=True, **rest)


GETTING_UP = (
    _row("one motor silent", silent(False), SILENCE_S),
    _row("IMU silent", imu_silent, SILENCE_S),
    _row("a bus dead", bus_dead, SILENCE_S),
    _row("motor reports error 2", error(2), 0.01),
    _row("motor at 90 degrees Celsius", temperature(90), 0.1),
    _row("policy: kp of nan", filled("kp", float("nan")), 0.03),
    _row("policy raises", decides(raises), 0.03),
    _row("policy interrupted at its deadline", decides(_late), 0.03),
    _row(
        "joint blocked",
        lambda injector: injector.brake(injector.joint, 1e3),
        None,
        STUCK,
        observed_s=TRIES_S,
    ),
)
