"""Two motors with the same id on two buses."""

import numpy as np

from footfall.deploy.wiring import Wiring


def two_motors(
    hip: str, knee: str, motor_id: int = 3, gear_ratio: tuple[float, float] = (6.0, 9.0)
) -> Wiring:
    """The wiring of two motor models, beside an IMU on the first bus."""
    return Wiring(
        buses=("can0", "can1"),
        channel=np.array([0, 1]),
        motor_id=np.array([motor_id, motor_id]),
        imu_channel=0,
        imu_protocol="footfall",
        models=(hip, knee),
        gear_ratio=np.array(gear_ratio),
        timeout_s=np.array([0.1, 0.1]),
        watchdog_endpoints=np.zeros((2, 2), int),
        joint_names=("hip", "knee"),
    )
