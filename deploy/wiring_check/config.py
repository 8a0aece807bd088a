"""Motions of the wiring check, and what passes."""

from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class WiringCheckConfig:
    """One joint after the other moves to and fro. Errors are shares of what the robot's model does."""

    settle_s: float = 1.5  # holding still, before the first motion
    move_s: float = 0.6  # of each joint, to one side, to the other and back
    standing_rad: float = 0.05  # amplitude while the robot stands
    lying_rad: float = 0.15  # amplitude while it lies
    least_rad: float = 0.03  # amplitude of a joint that is found at the end of its range
    motor_lag_s: float = 0.004  # from a command to the report of what it did, over the bus
    imu_lag_s: float = 0.002  # likewise, of the base
    alike: float = 0.13  # error of a joint's response up to which no other wiring is tried
    imu_alike: float = 0.25  # the same of the base's tilt by the IMU
    explained: float = 0.5  # of the squared error that another wiring has to leave at most to be the cause
    unlike: float = 0.9  # error of most joints' responses, or of the IMU's, that is a fault without a cause
    askew_rad: float = 0.25  # between the base's tilt by the IMU and that of the model on level ground
    lean_rad: float = 0.2  # turn of the base during the check at which it ends
    lost_rad: float = 0.4  # largest error of a joint

    def __post_init__(self) -> None:
        require_between(self, 0.1, 10.0, "settle_s", "move_s")
        require_between(
            self, 0.01, 0.5, "standing_rad", "lying_rad", "least_rad", "lean_rad", "lost_rad", "askew_rad"
        )
        require_between(self, 0.01, 1.0, "alike", "imu_alike", "explained")
        require_between(self, 0.0, 0.1, "motor_lag_s", "imu_lag_s")
        require_between(self, 0.1, 10.0, "unlike")
