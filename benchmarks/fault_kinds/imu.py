"""Faults of the IMU."""

from collections.abc import Callable
from itertools import count

import numpy as np

from fault_kinds.kind import QUEUE_S, SILENCE_S, FaultKind
from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.drivers.imu import ACCELERATION_ID, GYRO_ID, QUATERNION_ID, Inertial
from footfall.deploy.frames import Frames
from footfall.plant.frame_changes import (
    cut_short,
    each_imu_frame,
    emptied,
    from_imu,
    mounted,
    nothing,
    turned,
)
from footfall.plant.imu_ends import IMU_PERIOD_S
from footfall.plant.injection import FaultInjector, Injection


def imu_frame(identifier: int, change: Callable[[Frames], Frames]) -> Injection:
    return lambda injector: injector.on_imu_frames(each_imu_frame(identifier, change))


def changed(change: Callable[[Inertial], Inertial]) -> Injection:
    return lambda injector: injector.on_imu(change)


def _frozen(*parts: str) -> Injection:
    def inject(injector: FaultInjector) -> None:
        kept: list[Inertial] = []

        def freeze(reading: Inertial) -> Inertial:
            kept.append(reading) if not kept else None
            return reading._replace(**{part: getattr(kept[0], part) for part in parts})

        injector.on_imu(freeze)

    return inject


def scaled(part: str, *factors: float) -> Injection:
    """A part of the reading times factors, one for each axis."""

    def change(reading: Inertial) -> Inertial:
        values = getattr(reading, part)
        return reading._replace(**{part: tuple(v * f for v, f in zip(values, factors, strict=True))})

    return changed(change)


def _permuted(part: str, *order: int) -> Injection:
    return changed(lambda r: r._replace(**{part: tuple(getattr(r, part)[k] for k in order)}))


def gyro_bias(size: float) -> Injection:
    return changed(lambda r: r._replace(gyro=tuple(rate + size for rate in r.gyro)))


def leaning(degrees: float) -> Injection:
    def inject(injector: FaultInjector) -> None:
        axis, sign = int(injector.rng.integers(2)), float(injector.rng.choice([-1.0, 1.0]))
        injector.on_imu(lambda reading: turned(reading, axis, sign * degrees))

    return inject


def loose(degrees: float = 0.0, rate_rad_s: float = 0.0) -> Injection:
    """An IMU that turns slowly in its loose mount; its readings are right in its own frame."""

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


def imu_silent(injector: FaultInjector) -> None:
    injector.body.faults.imu_silent = True


def _imu_stuck(injector: FaultInjector) -> None:
    injector.body.faults.imu_stuck = True


def _imu_late(milliseconds: int) -> Injection:
    return lambda injector: injector.late(1000 * milliseconds, from_imu)


def _imu_queues(injector: FaultInjector) -> None:
    injector.falls_behind(0.5, from_imu)


TWICE = "the error is twice the body's rotation, which takes part of a step to reach 0.04 rad"
GROWS = "a reader at half the rate of arrival is late by `silence_timeout_s` after twice that time"
CALM = "in a calm walk the body's rotation is as small as the noise; noticed once it turns more"
LEVEL = "nearly the same for a level body that has not turned since the start"
PAUSING = "readings may repeat while the joints rest, as between slow steps"
LOOSE = "its readings agree with each other; only legs that stand still reveal the tilt"
MEAN = "steps shake an accelerometer: only its mean over a second is compared"
IMU = (
    FaultKind("gyro frames lost", imu_frame(GYRO_ID, nothing), SILENCE_S),
    FaultKind("acceleration frames lost", imu_frame(ACCELERATION_ID, nothing), SILENCE_S),
    FaultKind("quaternion frames lost", imu_frame(QUATERNION_ID, nothing), SILENCE_S, main=True),
    FaultKind("gyro frames cut to 2 bytes", imu_frame(GYRO_ID, cut_short), SILENCE_S),
    FaultKind("acceleration frames cut to 2 bytes", imu_frame(ACCELERATION_ID, cut_short), SILENCE_S),
    FaultKind("quaternion frames cut to 2 bytes", imu_frame(QUATERNION_ID, cut_short), SILENCE_S),
    FaultKind("gyro frames of zeros", imu_frame(GYRO_ID, emptied), SILENCE_S),
    FaultKind("acceleration frames of zeros", imu_frame(ACCELERATION_ID, emptied), SILENCE_S),
    FaultKind("quaternion frames of zeros", imu_frame(QUATERNION_ID, emptied), SILENCE_S),
    FaultKind("quaternion of length 0.9", imu_frame(QUATERNION_ID, _short_quaternion), SILENCE_S),
    FaultKind("IMU silent", imu_silent, SILENCE_S, main=True),
    FaultKind("IMU repeats one sample", _imu_stuck, SILENCE_S),
    FaultKind(
        "IMU frozen, its counters go on",
        _frozen(*Inertial._fields),
        0.3,
        PAUSING,
        main=True,
    ),
    FaultKind("gyro frozen", _frozen("gyro")),
    FaultKind("acceleration frozen", _frozen("acceleration")),
    FaultKind("quaternion frozen", _frozen("quaternion")),
    FaultKind("gyro reads zero", scaled("gyro", 0.0, 0.0, 0.0)),
    FaultKind("gyro's signs reversed", scaled("gyro", -1.0, -1.0, -1.0), 0.3, TWICE),
    FaultKind("gyro three times too high", scaled("gyro", 3.0, 3.0, 3.0), None, CALM),
    FaultKind("gyro's x and y exchanged", _permuted("gyro", 1, 0, 2), None, CALM),
    FaultKind("gyro off by 2 rad/s", gyro_bias(2.0)),
    FaultKind("quaternion's roll reversed", scaled("quaternion", 1.0, -1.0, 1.0, 1.0), None, CALM),
    FaultKind("quaternion's pitch reversed", scaled("quaternion", 1.0, 1.0, -1.0, 1.0), None, CALM),
    FaultKind("quaternion from world to body", scaled("quaternion", 1.0, -1.0, -1.0, -1.0), 1.5, LEVEL),
    FaultKind("quaternion's w last", _permuted("quaternion", 1, 2, 3, 0), main=True),
    FaultKind("quaternion off by 30 degrees", leaning(30.0), main=True),
    FaultKind("quaternion off by 15 degrees", leaning(15.0)),
    FaultKind("acceleration's signs reversed", scaled("acceleration", -1.0, -1.0, -1.0), 0.6, MEAN),
    FaultKind("acceleration in units of g", scaled("acceleration", *(1 / GRAVITY_M_S2,) * 3), 1.3, MEAN),
    FaultKind("IMU comes loose and tilts at 0.2 rad/s", loose(0.0, 0.2), None, LOOSE),
    FaultKind("IMU late by 20 ms", _imu_late(20), None, "late readings agree with each other"),
    FaultKind("IMU late by 100 ms", _imu_late(100), SILENCE_S),
    FaultKind("IMU's readings queue up", _imu_queues, QUEUE_S, GROWS),
)
