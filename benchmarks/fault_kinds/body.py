"""Faults of motors and body."""

import numpy as np

from fault_kinds.kind import IMPLAUSIBLE_S, FaultKind
from fault_kinds.replies import EXPLAINED
from footfall.plant.injection import FaultInjector, Injection


def _reboot(all_of_them: bool) -> Injection:
    def inject(injector: FaultInjector) -> None:
        joints = np.arange(len(injector.robot.joint_names)) if all_of_them else np.array([injector.joint])
        injector.body.reboot(joints)

    return inject


def strength(of_one: float | None = None, of_all: float = 1.0) -> Injection:
    def inject(injector: FaultInjector) -> None:
        shares = np.full(len(injector.robot.joint_names), of_all)
        if of_one is not None:
            shares[injector.joint] = of_one
        injector.body.weaken(shares)

    return inject


def _sagging(share: float) -> Injection:
    return lambda injector: injector.body.sag(share)


def _pushed(speed_m_s: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        angle = injector.rng.uniform(0.0, 2 * np.pi)
        injector.body.push((speed_m_s * np.cos(angle), speed_m_s * np.sin(angle), 0.5 * speed_m_s))

    return inject


def turned_over(quaternion: tuple[float, float, float, float]) -> Injection:
    return lambda injector: injector.turn_over(quaternion, 0.5)


TILT = "noticed by its tilt"
WEAK = "less torque than reported looks like a heavier robot to all sensors; a fall is noticed by its tilt"
SAG = "motors that do not report their voltage are slower and weaker, as if the robot were heavier"
REBOOTED = (
    "a motor may report no torque for `no_torque_s`, because it may be late; checked in windows of 40 ms"
)
OTHER_WAY = "the torque of a delayed motor has the wrong sign for moments: only the average counts"
BODY = (
    FaultKind(
        "one motor rebooted: replies without torque",
        _reboot(False),
        None,
        EXPLAINED,
        main=True,
    ),
    FaultKind("all motors rebooted", _reboot(True), 0.2, REBOOTED, main=True),
    FaultKind("motor's torque reversed", strength(-1.0), 0.6, OTHER_WAY, main=True),
    FaultKind("motor has a third of its torque", strength(0.33), None, WEAK),
    FaultKind("all motors have half their torque", strength(of_all=0.5), None, WEAK),
    *(
        FaultKind(
            f"supply sags to {percent} % of its voltage",
            _sagging(percent / 100),
            None,
            SAG,
        )
        for percent in (70, 40)
    ),
    FaultKind(
        "joint blocked",
        lambda injector: injector.brake(injector.joint, 1e3),
        None,
        "its readings are correct",
    ),
    FaultKind("pushed over", _pushed(5.0), None, TILT),
    FaultKind(
        "turned upside down",
        turned_over((0.0, 1.0, 0.0, 0.0)),
        IMPLAUSIBLE_S,
    ),
)
