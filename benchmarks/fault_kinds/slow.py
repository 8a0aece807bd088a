"""Faults that grow over many windows of a check."""

import numpy as np

from fault_kinds.imu import changed
from fault_kinds.intermittent import TICK_S, each_tick
from fault_kinds.kind import FaultKind
from footfall.deploy.drivers.imu import Inertial
from footfall.plant.frame_changes import turned
from footfall.plant.imu_ends import IMU_PERIOD_S
from footfall.plant.injection import FaultInjector, Injection


def leaning_ahrs(rate_rad_s: float) -> Injection:
    """An attitude that drifts from the true one, and a gyro that reports the same drift."""

    def inject(injector: FaultInjector) -> None:
        axis, sign = int(injector.rng.integers(2)), float(injector.rng.choice([-1.0, 1.0]))
        rate, readings = sign * rate_rad_s, [0]

        def lean(reading: Inertial) -> Inertial:
            readings[0] += 1
            angle = float(np.rad2deg(rate * IMU_PERIOD_S * readings[0]))
            gyro = (np.array(reading.gyro) + rate * np.eye(3)[axis]).tolist()
            return turned(reading, axis, angle)._replace(gyro=gyro)

        changed(lean)(injector)

    return inject


def encoder_drifts(rate_rad_s: float, all_joints: bool = False) -> Injection:
    """Encoders that drift: motors report the drift, and control on it."""

    def inject(injector: FaultInjector) -> None:
        joints = slice(None) if all_joints else injector.joint
        step = injector.rng.choice([-1.0, 1.0]) * rate_rad_s * TICK_S

        def drift(_: int) -> None:
            injector.body.encoder_bias[joints] += step

        injector.bus.incoming = each_tick(drift)

    return inject


DRIFTING = "velocity noise hides a slow drift until it has added up for seconds"
LEANS = "steps shake an accelerometer: only its mean over seconds is compared"
SLOW = (
    FaultKind(
        "attitude and gyro drift alike, by 0.1 rad/s",
        leaning_ahrs(0.1),
        None,
        LEANS,
        main=True,
        observed_s=8.0,
    ),
    *(
        FaultKind(
            f"encoder drifts by {rate:g} rad/s",
            encoder_drifts(rate),
            None,
            DRIFTING,
            main=rate == 0.1,
            observed_s=8.0,
        )
        for rate in (0.02, 0.05, 0.1)
    ),
    FaultKind(
        "all encoders drift by 0.02 rad/s",
        encoder_drifts(0.02, True),
        None,
        DRIFTING,
        main=True,
        observed_s=8.0,
    ),
    FaultKind("all encoders drift by 0.1 rad/s", encoder_drifts(0.1, True), None, DRIFTING, observed_s=8.0),
)
