"""Settings of the deploy loop."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from footfall.common.config import merged, read_yaml, require_between, structure
from footfall.common.errors import UserError
from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.estimation.config import EstimatorConfig
from footfall.deploy.handover import HandoverConfig
from footfall.deploy.levelling import LevellingConfig
from footfall.deploy.safety import SafetyConfig
from footfall.robots.description import Robot

MOTOR_TIMEOUT_S = 0.1  # after this time without a command a motor disables itself, and reports that
LATE_TICKS = 2  # shortest limit: one late tick is no fault
START_TICKS = 10  # shortest start timeout: motors are queried, enabled and checked
AT_LEAST = {"silence_timeout_s": LATE_TICKS, "pause_limit_s": LATE_TICKS, "start_timeout_s": START_TICKS}


@dataclass(frozen=True)
class DeployConfig:
    """Settings of the control loop. The defaults suit a robot of a few ten kilograms."""

    joint_rate_hz: float = 500.0  # of ticks: readings, supervisor, commands
    estimator_rate_hz: float = 250.0  # at least; also once before each policy step
    stand_s: float = 1.0  # from the measured pose to the default pose, and settling
    stand_kp_scale: float = 4.0  # of the robot's gains
    stand_kd_scale: float = 2.0  # likewise
    pose_rate_rad_s: float = 0.8  # fastest that a joint moves while the robot stands up or lies down
    in_place_s: float = 1.0  # that a robot with `held_start` steps in place before it is let go
    stop_rate_rad_s: float = 8.0  # the same after stopping, until all feet stand
    stop_s: float = 1.0  # that a policy has to stop before the robot lies down
    sink_rate_rad_s: float = 12.0  # the same while walking: the base is lowered first
    sink_share: float = 0.7  # of the path from standing to lying that is so fast
    scale: float = 1.0  # share of stiffness, damping and torque that reaches the motors in a decision
    realtime_priority: int | None = None  # SCHED_FIFO, 1 to 99, for wall-clock runs
    host_queue: int = HOST_QUEUE  # frames that a simulated CAN interface queues
    motor_timeout_s: float = MOTOR_TIMEOUT_S  # of robot.yaml; simulated motors can wait longer
    estimator: EstimatorConfig = field(default_factory=EstimatorConfig)
    odometry: bool = False  # estimate the base's motion for the log, also where the policy does not need it
    logs_most_mb: float = 2000.0  # disk space of the logs that runs on real buses write unasked
    levelling: LevellingConfig = field(default_factory=LevellingConfig)
    handover: HandoverConfig = field(default_factory=HandoverConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)

    def __post_init__(self) -> None:
        require_between(self, 1.0, 10_000.0, "joint_rate_hz")
        require_between(self, 1.0, 10_000.0, "estimator_rate_hz")
        require_between(self, 0.001, 60.0, "stand_s", "motor_timeout_s")
        require_between(self, 0.0, 60.0, "stop_s", "in_place_s")
        require_between(self, 1, 10_000, "host_queue")
        require_between(self, 0.1, 100.0, "stand_kp_scale")  # with less it sinks while it should stand up
        require_between(self, 0.0, 100.0, "stand_kd_scale")
        require_between(self, 0.01, 100.0, "pose_rate_rad_s", "stop_rate_rad_s", "sink_rate_rad_s")
        require_between(self, 0.0, 1.0, "sink_share")
        require_between(self, 0.01, 1.0, "scale")
        require_between(self, 10.0, 1e7, "logs_most_mb")
        require_between(self, 1, 99, "realtime_priority")
        for name, ticks in AT_LEAST.items():
            limit_s, least_s = getattr(self.safety, name), ticks * self.tick_us * 1e-6
            if limit_s < least_s:
                raise ValueError(
                    f"safety.{name} is {limit_s:g} s: at {self.joint_rate_hz:g} Hz"
                    f" it has to be {least_s:g} s at least ({ticks} ticks)"
                )
        if self.safety.start_timeout_s < self.safety.still_s + START_TICKS * self.tick_us * 1e-6:
            raise ValueError(
                f"safety.still_s is {self.safety.still_s:g} s:"
                f" the start takes {self.safety.start_timeout_s:g} s at most (start_timeout_s)"
            )
        self._check_who_is_first()

    def _check_who_is_first(self) -> None:
        """The loop or its guard damps the robot before motors without commands disable themselves."""
        safety = self.safety
        longer = max("pause_limit_s", "late_limit_s", key=lambda name: getattr(safety, name))
        for limit, silent_s in (
            ("silence_timeout_s", safety.silence_timeout_s),
            (f"{longer} × guard_share + a tick", safety.guard_after_s + self.tick_us * 1e-6),
        ):
            if silent_s > self.motor_timeout_s:
                raise ValueError(
                    f"safety.{limit} is {silent_s:g} s: motors that hear nothing"
                    f" for {self.motor_timeout_s:g} s (motor_timeout_s) have switched themselves off by then"
                )

    @property
    def tick_us(self) -> int:
        return round(1e6 / self.joint_rate_hz)

    @property
    def damping_ticks(self) -> int:
        """Most ticks that it takes to damp a robot and disable its motors."""
        return math.ceil(self.safety.damping_s * 1e6 / self.tick_us) + 2

    @property
    def held_up_s(self) -> float:
        """Time from the first command until a robot with `held_start` is let go."""
        return self.stand_s + self.in_place_s


def deploy_config(robot: Robot, path: Path | None = None, simulated: bool = False) -> DeployConfig:
    """The defaults with a robot's limits and its motors' timeout, and with the changes of a YAML file.

    Args:
        robot: whose limits and motors count.
        path: the file, if there is one.
        simulated: whether the motors are simulated; only those can wait longer than robot.yaml says.

    Raises:
        UserError: either is malformed or cannot work.
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
            f" switch themselves off after {timeout_s:g} s, and only simulated ones can wait for longer"
        )
    return changed
