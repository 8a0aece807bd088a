"""List of all sensor checks, with their combined settings."""

from dataclasses import dataclass

from footfall.common.config import require_between
from footfall.deploy.sensor_checks import imu, legs, links, single_reading, torque, travel, unexplained
from footfall.deploy.sensor_checks.check import BodyCheck, JointCheck

JOINT_CHECKS: tuple[type[JointCheck], ...] = (
    single_reading.PositionRange,
    single_reading.Speed,
    single_reading.Torque,
    travel.Drift,
    travel.Wander,
    travel.Stuck,
    travel.Creep,
    torque.NoTorque,
    torque.Opposing,
    torque.TorqueStuck,
    unexplained.Unexplained,
    unexplained.CommandsIgnored,
    torque.ReplyRepeated,
    single_reading.Temperature,
    single_reading.ColderThanOthers,
    single_reading.TooCold,
    single_reading.Voltage,
)
BODY_CHECKS: tuple[type[BodyCheck], ...] = (
    imu.Rotation,
    imu.GyroRepeated,
    imu.AccelerationRepeated,
    imu.QuaternionRepeated,
    imu.RestError,
    imu.LateralError,
    imu.Lift,
    imu.LongLateralError,
    legs.Slope,
    legs.LegTurn,
    legs.Sunk,
)


LINK_CHECKS: tuple[type[links.LinkCheck], ...] = (
    links.Answers,
    links.ImuOlder,
    links.ImuReplayed,
    links.Unanswered,
    links.ImuLost,
    links.ImuFrozen,
)


@dataclass(frozen=True)
class SensorLimits(
    single_reading.SingleReadingLimits,
    travel.TravelLimits,
    torque.TorqueLimits,
    unexplained.UnexplainedLimits,
    imu.ImuLimits,
    legs.LegLimits,
    links.LinkLimits,
):
    """Limits of contradictions between readings: `safety.sensors` in robot.yaml and in a file for --config.

    The defaults are at least 1.6 times the largest values of simulated robots while walking, randomised,
    pushed and with noisy sensors (docs/safety.md).
    """

    period_s: float = 0.04  # duration of a window; a fault is detected within a few windows

    def __post_init__(self) -> None:
        require_between(self, 0.001, 0.2, "period_s")
        single_reading.SingleReadingLimits.__post_init__(self)
        travel.TravelLimits.__post_init__(self)
        torque.TorqueLimits.__post_init__(self)
        unexplained.UnexplainedLimits.__post_init__(self)
        imu.ImuLimits.__post_init__(self)
        legs.LegLimits.__post_init__(self)
        links.LinkLimits.__post_init__(self)
