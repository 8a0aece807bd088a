"""Faults of the motors' replies."""

from collections.abc import Callable

import numpy as np

from fault_kinds.frames import (
    all_dead,
    all_late,
    bits_flipped,
    bus_dead,
    commands_lost,
    commands_lost_to_one,
    corrupted,
    delivered_twice,
    foreign,
    frames_lost,
    queueing,
    silent,
    stuck,
    wrong_sender,
)
from fault_kinds.imu import GROWS
from fault_kinds.kind import IMPLAUSIBLE_S, QUEUE_S, SILENCE_S, FaultKind
from footfall.deploy.frames import Frames
from footfall.plant.frame_changes import cut_short, emptied
from footfall.plant.injection import FaultInjector, Injection


def _values(
    change: Callable[[FaultInjector, np.ndarray, np.ndarray], None],
) -> Injection:
    return lambda injector: injector.on_values(
        lambda values, temperature: change(injector, values, temperature)
    )


def _row_frozen(row: int) -> Injection:
    """Position (0), velocity (1) or torque (2) of one motor keeps its value."""

    def inject(injector: FaultInjector) -> None:
        kept: list[float] = []

        def freeze(values: np.ndarray, _: np.ndarray) -> None:
            if not values[:, injector.joint].any():
                return
            kept.append(float(values[row, injector.joint])) if not kept else None
            values[row, injector.joint] = kept[0]

        injector.on_values(freeze)

    return inject


def encoder_jumps(by: Callable[[FaultInjector], float]) -> Injection:
    """A motor's encoder jumps: the motor reports the offset position, and controls on it."""

    def inject(injector: FaultInjector) -> None:
        injector.body.encoder_bias[injector.joint] += injector.rng.choice([-1.0, 1.0]) * by(injector)

    return inject


def all_encoders_jump(by: float) -> Injection:
    """All encoders jump by an angle, rad."""

    def inject(injector: FaultInjector) -> None:
        injector.body.encoder_bias[:] += by

    return inject


def rotor_turn(injector: FaultInjector) -> float:
    """One turn of the rotor as an angle of the joint, rad."""
    return float(2 * np.pi / injector.robot.motor_figures("gear_ratio")[injector.joint])


def _drifting(rate_rad_s: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        offset = [0.0]

        def drift(values: np.ndarray, _: np.ndarray) -> None:
            offset[0] += rate_rad_s * 0.002
            values[0, injector.joint] += offset[0]

        injector.on_values(drift)

    return inject


def _negative(*rows: int) -> Injection:
    def change(injector: FaultInjector, values: np.ndarray, _: np.ndarray) -> None:
        values[list(rows), injector.joint] *= -1.0

    return _values(change)


def _zeroed(row: int) -> Injection:
    def change(injector: FaultInjector, values: np.ndarray, _: np.ndarray) -> None:
        values[row, injector.joint] = 0.0

    return _values(change)


def _doubled_speed(injector: FaultInjector, values: np.ndarray, _: np.ndarray) -> None:
    values[1, injector.joint] *= 2.0


def temperature(celsius: int) -> Injection:
    def change(injector: FaultInjector, _: np.ndarray, temperature: np.ndarray) -> None:
        temperature[injector.joint] = celsius

    return _values(change)


def _heating(injector: FaultInjector) -> None:
    celsius = [60.0]

    def heat(_: np.ndarray, temperature: np.ndarray) -> None:
        celsius[0] += 0.1  # a tick of 2 ms: 85 degrees after half a second
        temperature[injector.joint] = min(int(celsius[0]), 120)

    injector.on_values(heat)


def ids_swapped(injector: FaultInjector) -> None:
    """Two motors of one bus answer under each other's id."""
    mates = np.flatnonzero(injector.wiring.channel == injector.channel)
    one, other = injector.rng.choice(mates, 2, replace=False)

    def swap(values: np.ndarray, _: np.ndarray) -> None:
        values[:, [one, other]] = values[:, [other, one]]

    injector.on_values(swap)


def buses_swapped(injector: FaultInjector) -> None:
    """Two exchanged plugs: the replies of two similar legs arrive on each other's bus."""
    channels = np.unique(injector.wiring.channel)
    counts = np.bincount(injector.wiring.channel)
    first, second = channels[:2]
    assert counts[first] == counts[second]
    one, other = (np.flatnonzero(injector.wiring.channel == channel) for channel in (first, second))

    def swap(values: np.ndarray, _: np.ndarray) -> None:
        values[:, one], values[:, other] = values[:, other].copy(), values[:, one].copy()

    injector.on_values(swap)


def error(code: int) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.body.faults.motors.error[injector.joint] = code

    return inject


def _error_once(injector: FaultInjector) -> None:
    pending = [True]

    def corrupt(frames: Frames, joint: np.ndarray) -> Frames:
        rows = np.flatnonzero(joint == injector.joint)
        if not pending[0] or not len(rows):
            return frames
        pending[0] = False
        data = frames.data.copy()
        data[rows, 7] = 2
        return frames._replace(data=data)

    injector.on_replies(corrupt)


WAY = "a joint has to move for a while before its readings contradict each other"
NEAR_ZERO = "near zero a position is almost the same with either sign; noticed once the joint moves"
BARELY = "a swing of 0.01 rad is close to the resolution of the readings; noticed once the joint moves more"
EXPLAINED = "a torque error that readings 30 ms late would explain does not count"
ALIKE = "two joints at similar positions have similar readings until they move differently"
STEADY = "a motor under a constant command may report constant values; noticed once the command changes"
DRIFTS = "at this rate the error is `wander_rad` after 50 ms; the limit is wider for a joint that swings fast"
HEATS = "the temperature reaches the limit after 500 ms"
NEXT = "the next valid reading arrives 2 ms later"
HARMLESS = "most bits of a reading are smaller than its noise; noticed once a higher bit is flipped"
CONSTANT_LAG = (
    "late readings agree with each other; a walk tolerates some delay, and a fall is noticed by its tilt"
)
REPLIES = (
    FaultKind("one motor silent", silent(False), SILENCE_S, main=True),
    FaultKind("all motors silent", silent(True), SILENCE_S),
    FaultKind("a bus dead", bus_dead, SILENCE_S, main=True),
    FaultKind("all buses dead", all_dead, SILENCE_S),
    FaultKind("commands to one motor lost", commands_lost_to_one, SILENCE_S),
    FaultKind("all commands lost", commands_lost, SILENCE_S),
    *(FaultKind(f"motor reports error {code}", error(code), 0.01, main=code == 2) for code in range(1, 7)),
    FaultKind("motor reports an unknown error", error(99), 0.01),
    FaultKind("motor reports an error in one reply", _error_once, 0.01),
    FaultKind("one reply repeated", stuck, 1.5, WAY, main=True),
    FaultKind("position frozen", _row_frozen(0), None, BARELY, main=True),
    FaultKind("velocity frozen", _row_frozen(1), None, BARELY),
    FaultKind("velocity zero", _zeroed(1), None, BARELY),
    FaultKind("velocity's sign reversed", _negative(1), 1.5, WAY),
    FaultKind("velocity doubled", _values(_doubled_speed), None, BARELY),
    FaultKind("position's sign reversed", _negative(0), 1.5, NEAR_ZERO),
    FaultKind("torque zero", _zeroed(2), None, EXPLAINED),
    FaultKind("torque frozen", _row_frozen(2), None, STEADY),
    FaultKind("torque's sign reversed", _negative(2), None, EXPLAINED),
    FaultKind("encoder jumps by 0.3 rad", encoder_jumps(lambda _: 0.3), main=True),
    FaultKind("encoder jumps by 1 rad", encoder_jumps(lambda _: 1.0)),
    FaultKind("encoder jumps by a turn", encoder_jumps(lambda _: 2 * np.pi), main=True),
    FaultKind("encoder jumps by a turn of the rotor", encoder_jumps(rotor_turn)),
    FaultKind("encoder drifts by 1 rad/s", _drifting(1.0), 0.2, DRIFTS),
    FaultKind("ids of two motors swapped", ids_swapped, 0.6, ALIKE, main=True),
    FaultKind("two buses swapped", buses_swapped),
    FaultKind("motor at 90 degrees Celsius", temperature(90), main=True),
    FaultKind("temperature sensor reads 255", temperature(255)),
    FaultKind("motor heats up past 85 degrees", _heating, 0.6, HEATS),
    FaultKind("replies under an unknown id", wrong_sender, SILENCE_S),
    FaultKind("replies cut to 2 bytes", corrupted(lambda _: cut_short), SILENCE_S),
    FaultKind("replies of zeros", corrupted(lambda _: emptied), SILENCE_S),
    FaultKind("all frames twice", delivered_twice, None, "harmless, and looks like a second host"),
    FaultKind("foreign frames on the bus", foreign, None, "harmless"),
    *(
        FaultKind(f"{what} of the frames lost", frames_lost(share), None, reason)
        for what, share, reason in (
            ("1 %", 0.01, NEXT),
            ("2 %", 0.02, NEXT),
            ("5 %", 0.05, NEXT),
            ("a tenth", 0.1, NEXT),
            ("half", 0.5, "the next reading arrives a few ticks later; only the share of losses counts"),
        )
    ),
    *(
        FaultKind(
            f"bits flipped in {percent} % of the frames",
            bits_flipped(percent / 100),
            within_s,
            HARMLESS,
        )
        for percent, within_s in ((1, 0.6), (5, 0.2), (20, IMPLAUSIBLE_S))
    ),
    *(FaultKind(f"all frames late by {late} ms", all_late(late), None, CONSTANT_LAG) for late in (10, 20)),
    FaultKind("all frames late by 50 ms", all_late(50), SILENCE_S),
    FaultKind("all frames late by 100 ms", all_late(100), SILENCE_S),
    FaultKind("replies queue up", queueing, QUEUE_S, GROWS),
)
