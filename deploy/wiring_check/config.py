"""Settings of the wiring check: motions and limits."""

from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class WiringCheckConfig:
    """One joint after the other moves to both sides. Errors are relative to the model's responses."""

    settle_s: float = 1.5  # duration of standing still before the first motion
    move_s: float = 0.6  # duration of each joint's motion, to one side, to the other and back
    standing_rad: float = 0.05  # amplitude while the robot stands
    lying_rad: float = 0.15  # amplitude while it lies
    min_rad: float = 0.03  # amplitude of a joint at a limit of its range
    soles_stiffness: float = 2.0  # relative to standing, on two soles: softer legs sway or tip over
    motor_lag_s: float = 0.001  # delay from a command to the reading with its effect, besides these ticks:
    motor_lag_ticks: float = 1.5  # half a tick until the next command, and one over the bus
    imu_lag_s: float = 0.002  # same for the tilt measured by the IMU
    max_delay_s: float = 0.05  # largest further delay of readings after commands, estimated by the check
    alike: float = 0.13  # maximum error of a joint's response
    doubtful: float = 0.09  # same, if a wrong wiring explains the error
    imu_alike: float = 0.25  # maximum error of the base's tilt measured by the IMU
    explained: float = 0.5  # maximum share of the squared error that a cause may leave unexplained
    explained_in_doubt: float = 0.3  # same for errors that would pass otherwise
    explained_of_motor: float = 0.1  # same for the torques of one motor, and for those in its own motion
    unlike: float = 0.9  # error of most joints, or of the IMU, that is a fault even without an explanation
    askew_rad: float = 0.25  # maximum difference between the mean tilts of IMU and model, on level ground
    lean_rad: float = 0.2  # rotation of the base that ends the check
    lost_rad: float = 0.4  # error of a joint's position that ends the check

    def __post_init__(self) -> None:
        require_between(self, 0.1, 10.0, "settle_s", "move_s")
        require_between(
            self, 0.01, 0.5, "standing_rad", "lying_rad", "min_rad", "lean_rad", "lost_rad", "askew_rad"
        )
        require_between(self, 0.01, 1.0, "alike", "imu_alike", "explained")
        require_between(self, 0.01, 1.0, "doubtful", "explained_in_doubt", "explained_of_motor")
        require_between(self, 0.0, 0.1, "motor_lag_s", "imu_lag_s", "max_delay_s")
        require_between(self, 0.0, 10.0, "motor_lag_ticks")
        require_between(self, 0.1, 10.0, "unlike", "soles_stiffness")
