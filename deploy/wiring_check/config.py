"""Motions of the wiring check, and what passes."""

from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class WiringCheckConfig:
    """One joint after the other moves to and fro. Errors are shares of the model's responses."""

    settle_s: float = 1.5  # holding still, before the first motion
    move_s: float = 0.6  # motion of each joint, to one side, to the other and back
    standing_rad: float = 0.05  # amplitude while the robot stands
    lying_rad: float = 0.15  # amplitude while it lies
    least_rad: float = 0.03  # amplitude of a joint that is found at the end of its range
    motor_lag_s: float = 0.004  # from a command to the report of its effect, over the bus
    imu_lag_s: float = 0.002  # likewise, from a command to the tilt that the IMU reports
    alike: float = 0.13  # largest error of a joint's response that passes
    doubtful: float = 0.09  # likewise, if a wrong wiring does not explain it
    imu_alike: float = 0.25  # largest error of the base's tilt by the IMU that passes
    explained: float = 0.5  # largest share of the squared error that the cause may leave
    explained_in_doubt: float = 0.3  # likewise, of errors that would pass
    unlike: float = 0.9  # error of most joints, or of the IMU, that is a fault even if no cause explains it
    askew_rad: float = 0.25  # largest difference of the mean tilts by IMU and model, on level ground
    lean_rad: float = 0.2  # turn of the base that ends the check
    lost_rad: float = 0.4  # distance of a joint from its target that ends the check

    def __post_init__(self) -> None:
        require_between(self, 0.1, 10.0, "settle_s", "move_s")
        require_between(
            self, 0.01, 0.5, "standing_rad", "lying_rad", "least_rad", "lean_rad", "lost_rad", "askew_rad"
        )
        require_between(self, 0.01, 1.0, "alike", "imu_alike", "explained")
        require_between(self, 0.01, 1.0, "doubtful", "explained_in_doubt")
        require_between(self, 0.0, 0.1, "motor_lag_s", "imu_lag_s")
        require_between(self, 0.1, 10.0, "unlike")
