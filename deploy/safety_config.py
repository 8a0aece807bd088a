"""Limits of the safety supervisor: `safety` in robot.yaml and in a file for --config."""

import math
from dataclasses import dataclass, field

from footfall.common.config import require_between
from footfall.deploy.battery import BatteryLimits
from footfall.deploy.recovery_config import RecoveryConfig
from footfall.deploy.sensor_checks.table import SensorLimits


@dataclass(frozen=True)
class SafetyConfig:
    """Limits of the supervisor, and settings of damping."""

    start_timeout_s: float = 1.0  # for every motor and the IMU to reply
    still_s: float = 0.05  # time at rest, in which the IMU is checked, before joints get stiffness
    silence_timeout_s: float = 0.05  # longest time without a motor's reply or a new IMU reading
    tilt_limit_rad: float = 1.05
    late_steps: int = 5  # consecutive policy steps that took longer than their period
    late_limit_s: float = 0.07  # longest duration of one policy step
    damping_kd: float = 3.0  # N m s/rad
    damping_s: float = 0.5  # duration of damping before the motors are disabled
    pause_limit_s: float = 0.07  # longest time between two ticks; motors without commands disable themselves
    guard_share: float = 1.1  # of the longer of pause_limit_s and late_limit_s: when a guard damps the robot
    skipped_share: float = 0.25  # of the last second's ticks that may be skipped because the loop is late
    first_pose_rad: float = 0.1  # allowed start beyond a joint's range: calibration is not exact
    sensors: SensorLimits = field(default_factory=SensorLimits)
    battery: BatteryLimits = field(default_factory=BatteryLimits)
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)

    def __post_init__(self) -> None:
        require_between(self, 0.001, 60.0, "start_timeout_s", "silence_timeout_s", "late_limit_s")
        require_between(self, 0.001, 60.0, "pause_limit_s")
        require_between(self, 1.0, 10.0, "guard_share")  # below 1 the loop itself could not react in time
        require_between(self, 0.0, 60.0, "still_s")
        require_between(self, 1, 1000, "late_steps")
        require_between(self, 0.01, 100.0, "damping_kd")
        require_between(self, 1e-9, math.pi, "first_pose_rad")
        require_between(self, 1e-9, math.pi / 2, "tilt_limit_rad")  # a robot on its side has fallen
        require_between(self, 0.01, 60.0, "damping_s")
        require_between(self, 0.0, 1.0, "skipped_share")

    @property
    def guard_after_s(self) -> float:
        """Time after the start of a tick at which a guard takes control, s."""
        return self.guard_share * max(self.late_limit_s, self.pause_limit_s)
