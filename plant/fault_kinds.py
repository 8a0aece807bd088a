"""The kinds of faults that a robot is put through: one row each, with what is expected of it.

A row's `inject` is called with the run: in the walk, at a moment that is drawn, or before the first tick.
"""

from collections.abc import Callable
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.drivers.imu import ACCELERATION_ID, GYRO_ID, QUATERNION_ID, Inertial
from footfall.deploy.frames import Frames
from footfall.plant.injection import (
    Batches,
    FaultInjector,
    Injection,
    cut_short,
    dropped,
    each_imu_frame,
    emptied,
    flipped,
    from_imu,
    mounted,
    nothing,
    turned,
)
from footfall.plant.robot import IMU_PERIOD_S
from footfall.robots.actuator import JointCommand

SILENCE_S = 0.055
IMPLAUSIBLE_S = 0.1
QUEUE_S = 0.11  # of a queue that grows by half of what arrives: twice the silence
LATER_S = 0.2  # of what adds up for longer than that, by its reason in the table; likewise:
PAUSING_S = 0.3
SOON_S = 0.6
SLOW_S = 1.5  # of a joint that hardly moves, or a body that hardly turns


class FaultKind(NamedTuple):
    """One row."""

    name: str
    group: str
    inject: Injection
    within_s: float | None = IMPLAUSIBLE_S  # from the fault to damping; None if it need not be noticed
    reason: str = ""  # why it cannot be noticed, or not sooner
    main: bool = False  # tried on every robot
    estimating: bool = False  # tried with policies whose base's motion is estimated
    starting: bool = False  # there from the beginning


# -- the IMU -----------------------------------------------------------------------------------------------


def _imu_frame(identifier: int, change: Callable[[Frames], Frames]) -> Injection:
    return lambda injector: injector.on_imu_frames(each_imu_frame(identifier, change))


def _imu(change: Callable[[Inertial], Inertial]) -> Injection:
    return lambda injector: injector.on_imu(change)


def _frozen(*parts: str) -> Injection:
    def inject(injector: FaultInjector) -> None:
        kept: list[Inertial] = []

        def freeze(reading: Inertial) -> Inertial:
            kept.append(reading) if not kept else None
            return reading._replace(**{part: getattr(kept[0], part) for part in parts})

        injector.on_imu(freeze)

    return inject


def _scaled(part: str, *factors: float) -> Injection:
    """A part of the reading times factors, one for each axis."""

    def change(reading: Inertial) -> Inertial:
        values = getattr(reading, part)
        return reading._replace(**{part: tuple(v * f for v, f in zip(values, factors, strict=True))})

    return _imu(change)


def _permuted(part: str, *order: int) -> Injection:
    return _imu(lambda r: r._replace(**{part: tuple(getattr(r, part)[k] for k in order)}))


def _gyro_bias(size: float) -> Injection:
    return _imu(lambda r: r._replace(gyro=tuple(rate + size for rate in r.gyro)))


def _leaning(degrees: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        axis, sign = int(injector.rng.integers(2)), float(injector.rng.choice([-1.0, 1.0]))
        injector.on_imu(lambda reading: turned(reading, axis, sign * degrees))

    return inject


def _loose(degrees: float = 0.0, rate_rad_s: float = 0.0) -> Injection:
    """An IMU that is not where it was in the body, and turns on: what it reads is true of where it is."""

    def inject(injector: FaultInjector) -> None:
        axis, sign = int(injector.rng.integers(2)), float(injector.rng.choice([-1.0, 1.0]))
        angle, rate = sign * np.deg2rad(degrees), sign * rate_rad_s
        readings = count()
        injector.on_imu(lambda r: mounted(r, axis, angle + rate * IMU_PERIOD_S * next(readings), rate))

    return inject


def _short_quaternion(frames: Frames) -> Frames:
    """Nine tenths of the quaternion: no rotation."""
    words = frames.data.copy().view(">i2")
    return frames._replace(data=(words * 0.9).astype(">i2").view(np.uint8).reshape(frames.data.shape))


def _imu_silent(injector: FaultInjector) -> None:
    injector.body.faults.imu_silent = True


def _imu_stuck(injector: FaultInjector) -> None:
    injector.body.faults.imu_stuck = True


def _imu_late(milliseconds: int) -> Injection:
    return lambda injector: injector.late(1000 * milliseconds, from_imu)


def _imu_queues(injector: FaultInjector) -> None:
    injector.falls_behind(0.5, from_imu)


TWICE = "it differs by twice the body's turn, which takes a part of a step to be 0.04 rad"
GROWS = "what reads a half as fast as it comes is late by `silence_timeout_s` after twice that time"
CALM = "a calm walk turns by little more than noise does; noticed once the body turns by more"
LEVEL = "of a level body that has not turned since the start, it is nearly the same"
PAUSING = "it may repeat itself while joints rest, which they do between slow steps"
LOOSE = "its parts agree with each other; legs say how the base leans where they stand still"
MEAN = "steps shake an accelerometer: only its mean over a second is compared"
IMU = (
    FaultKind("gyro frames lost", "IMU", _imu_frame(GYRO_ID, nothing), SILENCE_S),
    FaultKind("acceleration frames lost", "IMU", _imu_frame(ACCELERATION_ID, nothing), SILENCE_S),
    FaultKind("quaternion frames lost", "IMU", _imu_frame(QUATERNION_ID, nothing), SILENCE_S, main=True),
    FaultKind("gyro frames cut to 2 bytes", "IMU", _imu_frame(GYRO_ID, cut_short), SILENCE_S),
    FaultKind("acceleration frames cut to 2 bytes", "IMU", _imu_frame(ACCELERATION_ID, cut_short), SILENCE_S),
    FaultKind("quaternion frames cut to 2 bytes", "IMU", _imu_frame(QUATERNION_ID, cut_short), SILENCE_S),
    FaultKind("gyro frames of zeros", "IMU", _imu_frame(GYRO_ID, emptied), SILENCE_S),
    FaultKind("acceleration frames of zeros", "IMU", _imu_frame(ACCELERATION_ID, emptied), SILENCE_S),
    FaultKind("quaternion frames of zeros", "IMU", _imu_frame(QUATERNION_ID, emptied), SILENCE_S),
    FaultKind("quaternion of length 0.9", "IMU", _imu_frame(QUATERNION_ID, _short_quaternion), SILENCE_S),
    FaultKind("IMU silent", "IMU", _imu_silent, SILENCE_S, main=True),
    FaultKind("IMU repeats one sample", "IMU", _imu_stuck, SILENCE_S),
    FaultKind(
        "IMU frozen, its counters go on",
        "IMU",
        _frozen(*Inertial._fields),
        PAUSING_S,
        PAUSING,
        main=True,
    ),
    FaultKind("gyro frozen", "IMU", _frozen("gyro")),
    FaultKind("acceleration frozen", "IMU", _frozen("acceleration")),
    FaultKind("quaternion frozen", "IMU", _frozen("quaternion")),
    FaultKind("gyro reads nothing but zero", "IMU", _scaled("gyro", 0.0, 0.0, 0.0)),
    FaultKind("gyro's signs turned round", "IMU", _scaled("gyro", -1.0, -1.0, -1.0), PAUSING_S, TWICE),
    FaultKind("gyro three times too high", "IMU", _scaled("gyro", 3.0, 3.0, 3.0), None, CALM),
    FaultKind("gyro's x and y exchanged", "IMU", _permuted("gyro", 1, 0, 2), None, CALM),
    FaultKind("gyro off by 2 rad/s", "IMU", _gyro_bias(2.0)),
    FaultKind(
        "quaternion's roll turned round", "IMU", _scaled("quaternion", 1.0, -1.0, 1.0, 1.0), None, CALM
    ),
    FaultKind(
        "quaternion's pitch turned round", "IMU", _scaled("quaternion", 1.0, 1.0, -1.0, 1.0), None, CALM
    ),
    FaultKind(
        "quaternion from world to body", "IMU", _scaled("quaternion", 1.0, -1.0, -1.0, -1.0), SLOW_S, LEVEL
    ),
    FaultKind("quaternion's w last", "IMU", _permuted("quaternion", 1, 2, 3, 0), main=True),
    FaultKind("quaternion off by 30 degrees", "IMU", _leaning(30.0), main=True),
    FaultKind("quaternion off by 15 degrees", "IMU", _leaning(15.0)),
    FaultKind(
        "acceleration's signs turned round", "IMU", _scaled("acceleration", -1.0, -1.0, -1.0), 0.6, MEAN
    ),
    FaultKind(
        "acceleration in units of g", "IMU", _scaled("acceleration", *(1 / GRAVITY_M_S2,) * 3), 1.3, MEAN
    ),
    FaultKind("IMU comes loose and leans by 0.2 rad/s", "IMU", _loose(0.0, 0.2), None, LOOSE),
    FaultKind("IMU late by 20 ms", "IMU", _imu_late(20), None, "late readings agree with each other"),
    FaultKind("IMU late by 100 ms", "IMU", _imu_late(100), SILENCE_S),
    FaultKind("IMU's readings queue up", "IMU", _imu_queues, QUEUE_S, GROWS),
)

# -- what motors reply -------------------------------------------------------------------------------------


def _values(
    change: Callable[[FaultInjector, np.ndarray, np.ndarray], None],
) -> Injection:
    return lambda injector: injector.on_values(
        lambda values, temperature: change(injector, values, temperature)
    )


def _row_frozen(row: int) -> Injection:
    """Position (0), velocity (1) or torque (2) of one motor stays what it is."""

    def inject(injector: FaultInjector) -> None:
        kept: list[float] = []

        def freeze(values: np.ndarray, _: np.ndarray) -> None:
            if not values[:, injector.joint].any():
                return
            kept.append(float(values[row, injector.joint])) if not kept else None
            values[row, injector.joint] = kept[0]

        injector.on_values(freeze)

    return inject


def _position_off(by: Callable[[FaultInjector], float]) -> Injection:
    """A motor's encoder is off from now on: it reports so, and closes its own loop on it."""

    def inject(injector: FaultInjector) -> None:
        injector.body.encoder_bias[injector.joint] += injector.rng.choice([-1.0, 1.0]) * by(injector)

    return inject


def _all_off(by: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.body.encoder_bias[:] += by

    return inject


def _sector(injector: FaultInjector) -> float:
    """One turn of a rotor, at the joint."""
    return float(2 * np.pi / injector.robot.motor_figures("gear_ratio")[injector.joint])


def _drifting(rate_rad_s: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        off = [0.0]

        def drift(values: np.ndarray, _: np.ndarray) -> None:
            off[0] += rate_rad_s * 0.002
            values[0, injector.joint] += off[0]

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


def _temperature(celsius: int) -> Injection:
    def change(injector: FaultInjector, _: np.ndarray, temperature: np.ndarray) -> None:
        temperature[injector.joint] = celsius

    return _values(change)


def _heating(injector: FaultInjector) -> None:
    now = [60.0]

    def heat(_: np.ndarray, temperature: np.ndarray) -> None:
        now[0] += 0.1  # of 500 ticks a second: 85 degrees after half a second
        temperature[injector.joint] = min(int(now[0]), 120)

    injector.on_values(heat)


def _ids_swapped(injector: FaultInjector) -> None:
    """Two motors of one bus answer under each other's id."""
    mates = np.flatnonzero(injector.wiring.channel == injector.channel)
    one, other = injector.rng.choice(mates, 2, replace=False)

    def swap(values: np.ndarray, _: np.ndarray) -> None:
        values[:, [one, other]] = values[:, [other, one]]

    injector.on_values(swap)


def _buses_swapped(injector: FaultInjector) -> None:
    """Two plugs exchanged: replies of two like legs come from each other's bus."""
    channels = np.unique(injector.wiring.channel)
    counts = np.bincount(injector.wiring.channel)
    first, second = channels[:2]
    assert counts[first] == counts[second]
    one, other = (np.flatnonzero(injector.wiring.channel == channel) for channel in (first, second))

    def swap(values: np.ndarray, _: np.ndarray) -> None:
        values[:, one], values[:, other] = values[:, other].copy(), values[:, one].copy()

    injector.on_values(swap)


def _error(code: int) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.body.faults.motors.error[injector.joint] = code

    return inject


def _error_once(injector: FaultInjector) -> None:
    left = [1]

    def corrupt(frames: Frames, joint: np.ndarray) -> Frames:
        rows = np.flatnonzero(joint == injector.joint)
        if not left[0] or not len(rows):
            return frames
        left[0] = 0
        data = frames.data.copy()
        data[rows, 7] = 2
        return frames._replace(data=data)

    injector.on_replies(corrupt)


def _silent(all_of_them: bool) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.body.faults.motors.silent[slice(None) if all_of_them else injector.joint] = True

    return inject


def _bus_dead(injector: FaultInjector) -> None:
    """Neither end of a bus hears the other."""
    injector.on_all(lambda frames: frames.take(frames.channel != injector.channel))
    injector.bus.outgoing = lambda frames, _: frames.take(frames.channel != injector.channel)


def _all_dead(injector: FaultInjector) -> None:
    injector.on_all(nothing)
    injector.bus.outgoing = lambda frames, _: nothing(frames)


def _commands_lost(injector: FaultInjector) -> None:
    injector.bus.outgoing = lambda frames, _: nothing(frames)


def _commands_lost_to_one(injector: FaultInjector) -> None:
    keep = np.arange(len(injector.robot.joint_names)) != injector.joint
    injector.bus.outgoing = lambda frames, _: frames.take(keep) if len(frames.id) == len(keep) else frames


def _replies(
    change: Callable[[FaultInjector], Callable[[Frames], Frames]],
) -> Injection:
    def inject(injector: FaultInjector) -> None:
        corrupt = change(injector)
        injector.on_replies(lambda frames, _: corrupt(frames))

    return inject


def _stuck(injector: FaultInjector) -> None:
    injector.body.faults.motors.stuck[injector.joint] = True


def _wrong_sender(injector: FaultInjector) -> None:
    def corrupt(frames: Frames, joint: np.ndarray) -> Frames:
        data = frames.data.copy()
        data[joint == injector.joint, 0] = 0x7E
        return frames._replace(data=data)

    injector.on_replies(corrupt)


def _doubled(batches: Batches, _: int) -> Batches:
    return [*batches, *batches]


def _twice(injector: FaultInjector) -> None:
    injector.bus.incoming = _doubled


def _foreign(injector: FaultInjector) -> None:
    """A bus on which somebody else talks, too."""
    foreign = Frames(
        np.full(8, injector.channel), np.arange(0x500, 0x508), np.full((8, 8), 0xA5, np.uint8), np.full(8, 8)
    )
    injector.bus.incoming = lambda batches, _: [foreign, *batches, foreign]


def _queue(injector: FaultInjector) -> None:
    injector.falls_behind(0.5, lambda frames: not from_imu(frames))


def _lost(share: float) -> Injection:
    return lambda injector: injector.on_all(dropped(share, injector.rng))


def _flipped(share: float) -> Injection:
    return lambda injector: injector.on_all(flipped(share, injector.rng))


def _late(milliseconds: int) -> Injection:
    return lambda injector: injector.late(1000 * milliseconds)


WAY = "a joint has to move for a while before its readings contradict each other"
NEAR_ZERO = "a joint near its zero reads much the same with either sign; noticed once it moves"
BARELY = "a joint that swings by a hundredth of a radian reads much the same; noticed where it moves"
EXPLAINED = "a motor that is asked for no more than readings 30 ms late explain gives nothing to compare"
ALIKE = "two joints in like poses read alike until they move apart"
STEADY = "a motor of which the same is asked again and again may report the same; noticed where that moves"
DRIFTS = "at this rate it is off by `wander_rad` after 50 ms, and a joint that swings fast is granted more"
HEATS = "it takes 500 ms to get there"
NEXT = "the next reading is 2 ms away"
HARMLESS = "most bits of a reading weigh less than its noise; noticed once one of the others is hit"
CONSTANT_LAG = (
    "late readings agree with each other; a walk bears some of it, and a fall is noticed by its tilt"
)
REPLIES = (
    FaultKind("one motor silent", "motors' replies", _silent(False), SILENCE_S, main=True),
    FaultKind("all motors silent", "motors' replies", _silent(True), SILENCE_S),
    FaultKind("a bus dead", "motors' replies", _bus_dead, SILENCE_S, main=True),
    FaultKind("all buses dead", "motors' replies", _all_dead, SILENCE_S),
    FaultKind("commands to one motor lost", "motors' replies", _commands_lost_to_one, SILENCE_S),
    FaultKind("all commands lost", "motors' replies", _commands_lost, SILENCE_S),
    *(
        FaultKind(f"motor reports error {code}", "motors' replies", _error(code), 0.01, main=code == 2)
        for code in range(1, 7)
    ),
    FaultKind("motor reports an unknown error", "motors' replies", _error(99), 0.01),
    FaultKind("motor reports an error in one reply", "motors' replies", _error_once, 0.01),
    FaultKind("one reply over and over", "motors' replies", _stuck, SLOW_S, WAY, main=True),
    FaultKind("position frozen", "motors' replies", _row_frozen(0), None, BARELY, main=True),
    FaultKind("velocity frozen", "motors' replies", _row_frozen(1), None, BARELY),
    FaultKind("velocity zero", "motors' replies", _zeroed(1), None, BARELY),
    FaultKind("velocity's sign turned round", "motors' replies", _negative(1), SLOW_S, WAY),
    FaultKind("velocity doubled", "motors' replies", _values(_doubled_speed), None, BARELY),
    FaultKind("position's sign turned round", "motors' replies", _negative(0), SLOW_S, NEAR_ZERO),
    FaultKind("torque zero", "motors' replies", _zeroed(2), None, EXPLAINED),
    FaultKind("torque frozen", "motors' replies", _row_frozen(2), None, STEADY),
    FaultKind("torque's sign turned round", "motors' replies", _negative(2), None, EXPLAINED),
    FaultKind("encoder jumps by 0.3 rad", "motors' replies", _position_off(lambda _: 0.3), main=True),
    FaultKind("encoder jumps by 1 rad", "motors' replies", _position_off(lambda _: 1.0)),
    FaultKind("encoder jumps by a turn", "motors' replies", _position_off(lambda _: 2 * np.pi), main=True),
    FaultKind("encoder jumps by a turn of the rotor", "motors' replies", _position_off(_sector)),
    FaultKind("encoder drifts by 1 rad/s", "motors' replies", _drifting(1.0), LATER_S, DRIFTS),
    FaultKind("ids of two motors swapped", "motors' replies", _ids_swapped, SOON_S, ALIKE, main=True),
    FaultKind("two buses swapped", "motors' replies", _buses_swapped),
    FaultKind("motor at 90 degrees Celsius", "motors' replies", _temperature(90), main=True),
    FaultKind("temperature sensor reads 255", "motors' replies", _temperature(255)),
    FaultKind("motor heats up past 85 degrees", "motors' replies", _heating, SOON_S, HEATS),
    FaultKind("replies under an unknown id", "motors' replies", _wrong_sender, SILENCE_S),
    FaultKind("replies cut to 2 bytes", "motors' replies", _replies(lambda _: cut_short), SILENCE_S),
    FaultKind("replies of zeros", "motors' replies", _replies(lambda _: emptied), SILENCE_S),
    FaultKind("all frames twice", "motors' replies", _twice, None, "it does no harm"),
    FaultKind("foreign frames on the bus", "motors' replies", _foreign, None, "it does no harm"),
    *(
        FaultKind(f"{what} of the frames lost", "motors' replies", _lost(share), None, reason)
        for what, share, reason in (
            ("1 %", 0.01, NEXT),
            ("2 %", 0.02, NEXT),
            ("5 %", 0.05, NEXT),
            ("a tenth", 0.1, NEXT),
            ("half", 0.5, "the next reading is a few ticks away"),
        )
    ),
    *(
        FaultKind(
            f"bits flipped in {percent} % of the frames",
            "motors' replies",
            _flipped(percent / 100),
            within_s,
            HARMLESS,
        )
        for percent, within_s in ((1, SOON_S), (5, LATER_S), (20, IMPLAUSIBLE_S))
    ),
    *(
        FaultKind(f"all frames late by {late} ms", "motors' replies", _late(late), None, CONSTANT_LAG)
        for late in (10, 20)
    ),
    FaultKind("all frames late by 50 ms", "motors' replies", _late(50), SILENCE_S),
    FaultKind("all frames late by 100 ms", "motors' replies", _late(100), SILENCE_S),
    FaultKind("replies queue up", "motors' replies", _queue, QUEUE_S, GROWS),
)

# -- motors and body ---------------------------------------------------------------------------------------


def _reboot(all_of_them: bool) -> Injection:
    def inject(injector: FaultInjector) -> None:
        joints = np.arange(len(injector.robot.joint_names)) if all_of_them else np.array([injector.joint])
        injector.body.reboot(joints)

    return inject


def _strength(of_one: float | None = None, of_all: float = 1.0) -> Injection:
    def inject(injector: FaultInjector) -> None:
        strength = np.full(len(injector.robot.joint_names), of_all)
        if of_one is not None:
            strength[injector.joint] = of_one
        injector.body.weaken(strength)

    return inject


def _sagging(share: float) -> Injection:
    return lambda injector: injector.body.sag(share)


def _pushed(speed_m_s: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        angle = injector.rng.uniform(0.0, 2 * np.pi)
        injector.body.push((speed_m_s * np.cos(angle), speed_m_s * np.sin(angle), 0.5 * speed_m_s))

    return inject


def _put(quaternion: tuple[float, float, float, float]) -> Injection:
    return lambda injector: injector.turn_over(quaternion, 0.5)


TILT = "noticed by its tilt"
WEAK = (
    "a motor that delivers less than it says is a heavier robot to all sensors; a fall is noticed by its tilt"
)
SAG = "motors that do not tell their voltage are slower and weaker, as those of a heavier robot"
LIMP = "a motor may report none for `limp_s`, since it may be late; it counts in windows of 40 ms"
OTHER_WAY = "of a motor that is late a torque points the other way for moments: it counts on average"
BODY = (
    FaultKind(
        "one motor rebooted: limp, but replies",
        "motors and body",
        _reboot(False),
        None,
        EXPLAINED,
        main=True,
    ),
    FaultKind("all motors rebooted", "motors and body", _reboot(True), LATER_S, LIMP, main=True),
    FaultKind("motor pulls the other way", "motors and body", _strength(-1.0), SOON_S, OTHER_WAY, main=True),
    FaultKind("motor has a third of its torque", "motors and body", _strength(0.33), None, WEAK),
    FaultKind("all motors have half their torque", "motors and body", _strength(of_all=0.5), None, WEAK),
    *(
        FaultKind(
            f"supply sags to {percent} % of its voltage",
            "motors and body",
            _sagging(percent / 100),
            None,
            SAG,
        )
        for percent in (70, 40)
    ),
    FaultKind(
        "joint blocked",
        "motors and body",
        lambda injector: injector.brake(injector.joint, 1e3),
        None,
        "its readings are true",
    ),
    FaultKind("pushed over", "motors and body", _pushed(5.0), None, TILT),
    FaultKind(
        "turned upside down",
        "motors and body",
        _put((0.0, 1.0, 0.0, 0.0)),
        IMPLAUSIBLE_S,
    ),
)

# -- policy and program ------------------------------------------------------------------------------------


def _decides(change: Callable[[FaultInjector, JointCommand], Any]) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.policy.change_decision = lambda decision: change(injector, decision)

    return inject


def _filled(field: str, value: float) -> Injection:
    return _decides(lambda _, decision: decision._replace(**{field: np.full_like(decision.position, value)}))


def _raise(*_: object) -> Any:
    raise RuntimeError("on purpose")


def _stance_raises(injector: FaultInjector) -> None:
    injector.policy.replace_stance = _raise


def _command_raises(injector: FaultInjector) -> None:
    injector.command_source.replacement = _raise


def _command_nan(injector: FaultInjector) -> None:
    injector.command_source.replacement = lambda: np.full(3, np.nan)


def _bang_bang(injector: FaultInjector, decision: JointCommand) -> JointCommand:
    lower, upper = injector.robot.soft_limits
    sign = injector.rng.random() < 0.5
    return decision._replace(position=upper if sign else lower, kp=np.full_like(lower, 500.0))


def _random(injector: FaultInjector, decision: JointCommand) -> JointCommand:
    n = len(decision.position)
    return JointCommand(
        injector.rng.uniform(-10, 10, n),
        injector.rng.uniform(-50, 50, n),
        injector.rng.uniform(0, 500, n),
        injector.rng.uniform(0, 5, n),
        injector.rng.uniform(-100, 100, n),
    )


def _receive_raises(injector: FaultInjector) -> None:
    injector.bus.incoming = _raise


def _send_raises(injector: FaultInjector) -> None:
    injector.bus.outgoing = _raise


def _refused(injector: FaultInjector) -> None:
    """An interface whose queue is full."""
    send = injector.bus.send
    injector.bus.send = lambda frames, now_us: send(frames, now_us) * 0 + 1  # type: ignore[method-assign]


LIMITED = "what a policy wants within the limits is its own; a fall is noticed by its tilt"
UNHEARD = "no frame goes out any more: motors stop by their own time-out"
POLICY = (
    *(
        FaultKind(
            f"policy: {name} of {value}", "policy and program", _filled(name, value), 0.03, main=name == "kp"
        )
        for name, value in (("position", np.nan), ("kp", np.nan), ("torque", np.inf), ("kd", -np.inf))
    ),
    FaultKind("policy raises", "policy and program", _decides(_raise), 0.03, main=True),
    FaultKind("policy returns nothing", "policy and program", _decides(lambda *_: None), 0.03),
    FaultKind(
        "policy decides for one joint too few",
        "policy and program",
        _decides(lambda _, decision: JointCommand(*(part[:-1] for part in decision))),
        0.03,
    ),
    FaultKind("policy: kp of 1e9", "policy and program", _filled("kp", 1e9), None, LIMITED),
    FaultKind("policy: kd of 1e300", "policy and program", _filled("kd", 1e300), None, LIMITED),
    FaultKind("policy: torque of 1e9", "policy and program", _filled("torque", 1e9), None, LIMITED),
    FaultKind("policy: position of 1e9", "policy and program", _filled("position", 1e9), None, LIMITED),
    FaultKind(
        "policy from limit to limit", "policy and program", _decides(_bang_bang), None, LIMITED, main=True
    ),
    FaultKind("policy at random", "policy and program", _decides(_random), None, LIMITED, main=True),
    FaultKind("the velocity command raises", "policy and program", _command_raises, 0.03),
    FaultKind(
        "the velocity command is not a number",
        "policy and program",
        _command_nan,
        None,
        "it counts as 0, and a note says so",
    ),
    FaultKind("the policy's stance raises", "policy and program", _stance_raises, 0.03, estimating=True),
    FaultKind("receiving raises", "policy and program", _receive_raises, 0.01),
    FaultKind("sending raises", "policy and program", _send_raises, 0.01, UNHEARD),
    FaultKind("the interface refuses frames", "policy and program", _refused, 0.01, UNHEARD),
)

# -- from the beginning ------------------------------------------------------------------------------------

UNANSWERED_S = 1.05  # `start_timeout_s`
START_S = 1.3  # start-up, and a while of standing
WALKING_S = 2.0  # and the first steps


def _at_start(name: str, inject: Injection, within_s: float | None = UNANSWERED_S, **rest: Any) -> FaultKind:
    return FaultKind(name, "at the start", inject, within_s, starting=True, **rest)


def _nan_quaternion(reading: Inertial) -> Inertial:
    return reading._replace(quaternion=(0.0, 0.0, 0.0, 1e-3))


UNANSWERED = "motors and IMU have `start_timeout_s` to answer"
AT_REST = "compared once the robot has stood at rest for a while"
LITTLE = "a robot that stands asks little of some joints: noticed once it asks for more"
IN_RANGE = "noticed, and named, where it leaves the joint's range; else it reads like any other pose"
START = (
    _at_start("a motor is missing", _silent(False), reason=UNANSWERED, main=True),
    _at_start("all motors are missing", _silent(True), reason=UNANSWERED),
    _at_start("the IMU is missing", _imu_silent, reason=UNANSWERED, main=True),
    _at_start("a bus is missing", _bus_dead, reason=UNANSWERED),
    _at_start("no commands arrive", _commands_lost, reason=UNANSWERED),
    _at_start("a motor reports an error", _error(3), IMPLAUSIBLE_S),
    _at_start("a quaternion that is none", _imu(_nan_quaternion), reason=UNANSWERED),
    _at_start("one encoder off by a turn", _position_off(lambda _: 2 * np.pi), 0.02, main=True),
    _at_start("all encoders off by a turn", _all_off(2 * np.pi), 0.02),
    _at_start(
        "one encoder off by a turn of the rotor", _position_off(_sector), None, reason=IN_RANGE, main=True
    ),
    _at_start("IMU askew by 30 degrees", _leaning(30.0), IMPLAUSIBLE_S, main=True),
    _at_start("IMU askew by 15 degrees", _leaning(15.0), IMPLAUSIBLE_S),
    _at_start("IMU askew by 30 degrees, all its parts alike", _loose(30.0), START_S, reason=AT_REST),
    _at_start("IMU comes loose and leans by 0.2 rad/s", _loose(0.0, 0.2), START_S, reason=AT_REST),
    _at_start("IMU askew by 5 degrees", _leaning(5.0), None, reason="less than a slope"),
    _at_start("IMU upside down", _imu(lambda r: turned(r, 0, 180.0)), IMPLAUSIBLE_S),
    _at_start("IMU on its side, all its parts alike", _loose(90.0), IMPLAUSIBLE_S, main=True),
    _at_start("acceleration frames lost", _imu_frame(ACCELERATION_ID, nothing), reason=UNANSWERED),
    _at_start("acceleration in units of g", _scaled("acceleration", *(1 / GRAVITY_M_S2,) * 3), IMPLAUSIBLE_S),
    _at_start("acceleration a fifth too high", _scaled("acceleration", 1.2, 1.2, 1.2), IMPLAUSIBLE_S),
    _at_start("acceleration reads nothing but zero", _scaled("acceleration", 0.0, 0.0, 0.0), IMPLAUSIBLE_S),
    _at_start("gyro off by 2 rad/s", _gyro_bias(2.0), reason=UNANSWERED),
    _at_start("robot upside down", _put((0.0, 1.0, 0.0, 0.0)), IMPLAUSIBLE_S),
    _at_start("robot on its side", _put((1.0, 1.0, 0.0, 0.0)), IMPLAUSIBLE_S, main=True),
    _at_start("a motor at 90 degrees Celsius", _temperature(90), IMPLAUSIBLE_S),
    _at_start("ids of two motors swapped", _ids_swapped, WALKING_S, main=True, reason=ALIKE),
    _at_start("two buses swapped", _buses_swapped, START_S, reason=ALIKE),
    _at_start("motor pulls the other way", _strength(-1.0), START_S, reason=LITTLE),
    _at_start("the interface refuses frames", _refused, 0.01),
    _at_start("receiving raises", _receive_raises, 0.01),
)

KINDS = (*IMU, *REPLIES, *BODY, *POLICY, *START)
