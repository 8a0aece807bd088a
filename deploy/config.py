"""Settings of the deploy loop."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from footfall.common.config import merged, read_yaml, require_between, structure
from footfall.common.errors import UserError
from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.estimation.config import EstimatorConfig
from footfall.deploy.handover import HandoverConfig
from footfall.deploy.levelling import LevellingConfig
from footfall.deploy.safety import SafetyConfig
from footfall.robots.description import Robot

MOTOR_TIMEOUT_S = 0.1  # timeout of the motors: without a command they disable themselves, and report that
LATE_TICKS = 2  # smallest limit: one late tick is not a fault
START_TICKS = 10  # smallest start timeout: motors are queried, enabled and checked
AT_LEAST = {"silence_timeout_s": LATE_TICKS, "pause_limit_s": LATE_TICKS, "start_timeout_s": START_TICKS}


@dataclass(frozen=True)
class DeployConfig:
    """Settings of the control loop. The defaults suit a robot of some tens of kilograms."""

    joint_rate_hz: float = 500.0  # rate of ticks: readings, supervisor, commands
    estimator_rate_hz: float = 250.0  # minimum rate; the estimator also runs before each policy step
    stand_s: float = 1.0  # duration of the motion from the measured to the default pose, with settling
    stand_kp_scale: float = 4.0  # stiffness while standing, relative to the robot's gains
    stand_kd_scale: float = 2.0  # damping while standing, relative to the robot's gains
    pose_rate_rad_s: float = 0.8  # joint speed while standing up or lying down
    in_place_s: float = 1.0  # time for which a robot with `held_start` steps in place before it is let go
    stop_rate_rad_s: float = 8.0  # joint speed after stopping, until all feet stand
    stop_s: float = 1.0  # time for a policy to stop before the robot lies down
    sink_rate_rad_s: float = 12.0  # joint speed after a fault while walking: the base is lowered first
    sink_share: float = 0.7  # share of the path from standing to lying at this speed
    scale: float = 1.0  # factor of stiffness, damping and torque in the motors' commands
    realtime_priority: int | None = None  # SCHED_FIFO, 1 to 99, for runs in real time
    host_queue: int = HOST_QUEUE  # transmit queue of a simulated CAN interface, frames
    motor_timeout_s: float = MOTOR_TIMEOUT_S  # value of robot.yaml; simulated motors can have a longer one
    estimator: EstimatorConfig = field(default_factory=EstimatorConfig)
    odometry: bool = False  # estimate the base's motion for the log, even if the policy does not need it
    logs_most_mb: float = 2000.0  # disk space for automatic logs of runs on real buses
    levelling: LevellingConfig = field(default_factory=LevellingConfig)
    handover: HandoverConfig = field(default_factory=HandoverConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)

    def __post_init__(self) -> None:
        require_between(self, 1.0, 10_000.0, "joint_rate_hz")
        require_between(self, 1.0, 10_000.0, "estimator_rate_hz")
        require_between(self, 0.001, 60.0, "stand_s", "motor_timeout_s")
        require_between(self, 0.0, 60.0, "stop_s", "in_place_s")
        require_between(self, 1, 10_000, "host_queue")
        require_between(self, 0.1, 100.0, "stand_kp_scale")  # below 0.1 a robot sinks instead of standing up
        require_between(self, 0.0, 100.0, "stand_kd_scale")
        require_between(self, 0.01, 100.0, "pose_rate_rad_s", "stop_rate_rad_s", "sink_rate_rad_s")
        require_between(self, 0.0, 1.0, "sink_share")
        require_between(self, 0.01, 1.0, "scale")
        require_between(self, 10.0, 1e7, "logs_most_mb")
        require_between(self, 1, 99, "realtime_priority")
        for name, ticks in AT_LEAST.items():
            limit_s, min_s = getattr(self.safety, name), ticks * self.tick_us * 1e-6
            if limit_s < min_s:
                raise ValueError(
                    f"safety.{name} is {limit_s:g} s: at {self.joint_rate_hz:g} Hz"
                    f" it must be at least {min_s:g} s ({ticks} ticks)"
                )
        if self.safety.start_timeout_s < self.safety.still_s + START_TICKS * self.tick_us * 1e-6:
            raise ValueError(
                f"safety.still_s is {self.safety.still_s:g} s:"
                f" it must be shorter than start_timeout_s, {self.safety.start_timeout_s:g} s"
            )
        self._check_order_of_timeouts()

    def _check_order_of_timeouts(self) -> None:
        """Require that loop or guard damp the robot before motors without commands disable themselves."""
        safety = self.safety
        longer = max("pause_limit_s", "late_limit_s", key=lambda name: getattr(safety, name))
        for limit, silent_s in (
            ("silence_timeout_s", safety.silence_timeout_s),
            (f"{longer} × guard_share + a tick", safety.guard_after_s + self.tick_us * 1e-6),
        ):
            if silent_s > self.motor_timeout_s:
                raise ValueError(
                    f"safety.{limit} is {silent_s:g} s: motors without commands"
                    f" for {self.motor_timeout_s:g} s (motor_timeout_s) disable themselves earlier"
                )

    @cached_property  # a loop reads it in each tick
    def tick_us(self) -> int:
        return round(1e6 / self.joint_rate_hz)

    @property
    def damping_ticks(self) -> int:
        """Largest number of ticks until a robot is damped and its motors are disabled."""
        return math.ceil(self.safety.damping_s * 1e6 / self.tick_us) + 2

    @property
    def held_up_s(self) -> float:
        """Time from the first command until a robot with `held_start` is let go."""
        return self.stand_s + self.in_place_s


def deploy_config(robot: Robot, path: Path | None = None, simulated: bool = False) -> DeployConfig:
    """Default settings with a robot's limits and its motors' timeout, and with changes from a YAML file.

    Args:
        robot: robot with these limits and motors.
        path: file with changes, if any.
        simulated: whether the motors are simulated; only simulated motors can have a longer timeout.

    Raises:
        UserError: robot or file has malformed or invalid settings.
    """
    timeout_s = float(robot.motor_figures("timeout_s").min())
    own = {"safety": robot.description.safety, "motor_timeout_s": timeout_s}
    config = structure(own, DeployConfig, str(robot.folder / "robot.yaml"))
    if path is None or (changes := read_yaml(path)) is None:
        return config
    changed = structure(merged(own, changes), DeployConfig, str(path))
    if changed.motor_timeout_s > timeout_s and not simulated:
        raise UserError(
            f"{path}: motor_timeout_s is {changed.motor_timeout_s:g} s: {robot.name}'s motors"
            f" disable themselves after {timeout_s:g} s, and only simulated motors can wait longer"
        )
    return changed
