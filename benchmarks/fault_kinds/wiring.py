"""Wrong wiring, found by the wiring check before the first step."""

from dataclasses import replace

import numpy as np

from fault_kinds.imu import changed
from fault_kinds.kind import FaultKind
from footfall.plant.frame_changes import mounted
from footfall.plant.injection import FaultInjector, Injection

FOUND_S = 30.0  # longest duration of the lying and the standing check of a robot with 18 joints
ENDING = (
    "noticed once every joint has moved; an IMU on its side or a joint out of its range is noticed at once"
)
CORRECT = "no fault: nothing may be reported"


def _exchanged(injector: FaultInjector, first: np.ndarray, second: np.ndarray) -> None:
    """Exchange the bus addresses of two groups of motors, for commands and replies."""
    wiring, order = injector.wiring, np.arange(len(injector.robot.joint_names))
    order[first], order[second] = second, first
    injector.body.rewire(replace(wiring, channel=wiring.channel[order], motor_id=wiring.motor_id[order]))


def two_buses(injector: FaultInjector) -> None:
    """Exchange two buses that have equally many motors."""
    channel = injector.wiring.channel
    used, counts = np.unique(channel, return_counts=True)
    first = int(
        injector.rng.choice([c for c, k in zip(used, counts, strict=True) if (counts == k).sum() > 1])
    )
    alike = [c for c, k in zip(used, counts, strict=True) if c != first and k == (channel == first).sum()]
    second = int(injector.rng.choice(alike))
    _exchanged(injector, np.flatnonzero(channel == first), np.flatnonzero(channel == second))


def two_legs(injector: FaultInjector) -> None:
    """Exchange the plugs of all motors of two legs."""
    first, second = injector.rng.choice(len(injector.robot.foot_joints), 2, replace=False)
    _exchanged(injector, injector.robot.foot_joints[first], injector.robot.foot_joints[second])


def two_motors(of_one_leg: bool) -> Injection:
    """Exchange the plugs or ids of two motors: of one leg, or the same joint of two legs."""

    def inject(injector: FaultInjector) -> None:
        legs, rng = injector.robot.foot_joints, injector.rng
        if of_one_leg:
            pair = rng.choice(legs[int(rng.integers(len(legs)))], 2, replace=False)
        else:
            place = int(rng.integers(min(len(leg) for leg in legs)))
            pair = np.array([leg[place] for leg in legs])[rng.choice(len(legs), 2, replace=False)]
        _exchanged(injector, pair[:1], pair[1:])

    return inject


def geared(ratio: float) -> Injection:
    """A motor whose real gear ratio is `ratio` times the one in its firmware; negative if it is reversed."""

    def inject(injector: FaultInjector) -> None:
        ratios = np.ones(len(injector.robot.joint_names))
        ratios[injector.joint] = ratio
        injector.body.regear(ratios, injector.robot.default_pose)

    return inject


def imu_turned(axis: int, degrees: float) -> Injection:
    return changed(lambda reading: mounted(reading, axis, np.deg2rad(degrees)))


def _rows(lying: bool) -> tuple[FaultKind, ...]:
    posture = "lying" if lying else "standing"

    def row(
        name: str, inject: Injection, within_s: float | None = FOUND_S, reason: str = ENDING
    ) -> FaultKind:
        title = f"{name}, {posture}"
        return FaultKind(title, inject, within_s, reason, main=True, starting=True, wiring=True, lying=lying)

    return (
        row("correct wiring", lambda _: None, None, CORRECT),
        row("plugs of two buses exchanged", two_buses),
        row("plugs of two legs exchanged", two_legs),
        row("two motors of a leg exchanged", two_motors(True)),
        row("the same motor of two legs exchanged", two_motors(False)),
        row("a motor reversed, encoder and torque", geared(-1.0)),
        *(row(f"gear ratio times {ratio:g}", geared(ratio)) for ratio in (0.6, 1.25, 1.5)),
        *(
            row(f"IMU turned by {degrees} degrees about {'xyz'[axis]}", imu_turned(axis, degrees))
            for axis, degrees in ((0, 90), (0, 180), (1, 90), (1, 180), (2, 90), (2, -90), (2, 180))
        ),
    )


WIRING = (*_rows(False), *_rows(True))
