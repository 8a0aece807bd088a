"""Scores of one episode: pure functions of its trace, from ground truth.

- Velocity error: length of the difference between commanded and true (vx, vy) in the body frame.
- Root mean square: over time, without the first second after each change of command. The start of the walk is
  such a change.
- Distance: see `plant/progress.py`.
- Progress: path along the commanded direction, as a share of the commanded path.
"""

from dataclasses import dataclass

import numpy as np

from footfall.plant.progress import path_length
from footfall.plant.trace import Trace
from footfall.robots.description import Robot

SETTLE_S = 1.0
SUCCESS_PROGRESS = 0.7  # progress at which an episode counts as a success


@dataclass(frozen=True)
class EpisodeMetrics:
    """One episode's scores. NaN where there was nothing to measure."""

    fell: bool  # fell, tipped over, or stopped in an emergency, after which a robot lies on the ground
    emergency_stop: bool
    walked_s: float
    scored_s: float  # part of walked_s, later than a second after any change of command
    lin_vel_mse: float  # m^2/s^2
    yaw_rate_mse: float  # rad^2/s^2
    mean_velocity: tuple[float, float, float]  # forward m/s, leftward m/s, yaw rad/s, over scored time
    distance_m: float
    progress: float  # share of the commanded path
    electrical_j: float  # shaft work and copper loss
    mechanical_j: float  # net shaft work
    positive_j: float  # shaft work of driving motors, without recovered braking work
    weight_n: float
    peak_torque_nm: float
    peak_torque_share: float  # torque over the motor's limit, worst joint
    foot_slip_m_s: float  # mean horizontal speed of feet that bear load
    stance_s: float  # time that feet bore load, summed over feet
    legs_touch_share: float  # share of the time in which two different legs press on each other
    target_rate_rad_s: float  # root mean square over joints and time
    torque_rate_nm_s: float  # the same for the motors' torque
    estimate_mse: float  # of the estimated horizontal velocity, m^2/s^2; NaN without an estimator

    @property
    def succeeded(self) -> bool:
        """Whether the robot stayed up and followed its command over most of the path."""
        return not self.fell and not self.progress < SUCCESS_PROGRESS  # NaN: the command was to stand


def score(trace: Trace, robot: Robot, weight_n: float) -> EpisodeMetrics:
    """Score an episode; `weight_n` is the weight of the simulated robot with its payload, N."""
    stopped = trace.final_state == "ESTOP"
    dt_s = 1.0 / trace.record_rate_hz
    settled = settled_samples(trace)
    velocity = np.column_stack([trace.base_velocity[:, :2], trace.base_angular_velocity[:, 2]])
    error = velocity - trace.command
    torque = np.abs(trace.motor_torque)
    slip_m_s, stance_s = _slip(trace)
    estimated = trace.estimated_velocity[:, :2] - trace.base_velocity[:, :2]
    return EpisodeMetrics(
        fell=trace.fell or stopped,
        emergency_stop=stopped,
        walked_s=float(len(trace.time_s) * dt_s),
        scored_s=float(settled.sum() * dt_s),
        lin_vel_mse=_mean((error[settled, :2] ** 2).sum(axis=1)),
        yaw_rate_mse=_mean(error[settled, 2] ** 2),
        mean_velocity=tuple(_mean(column) for column in velocity[settled].T),  # type: ignore[arg-type]
        distance_m=path_length(trace.base_position, trace.record_rate_hz),
        progress=progress(trace.command[:, :2], velocity[:, :2]),
        electrical_j=float(trace.electrical_power.sum() * dt_s),
        mechanical_j=float(trace.mechanical_power.sum() * dt_s),
        positive_j=float(trace.positive_power.sum() * dt_s),
        weight_n=weight_n,
        peak_torque_nm=float(torque.max()) if torque.size else np.nan,
        peak_torque_share=float((torque / robot.motor.peak_torque).max()) if torque.size else np.nan,
        foot_slip_m_s=slip_m_s,
        stance_s=stance_s,
        legs_touch_share=_mean(trace.legs_touch),
        target_rate_rad_s=_rate(trace.joint_target, dt_s),
        torque_rate_nm_s=_rate(trace.motor_torque, dt_s),
        estimate_mse=_mean((estimated[settled] ** 2).sum(axis=1)),
    )


def progress(command: np.ndarray, velocity: np.ndarray) -> float:
    """Path along the commanded direction as a share of the commanded path; NaN if none was commanded.

    Args:
        command: horizontal velocity, m/s, body frame, (T, 2).
        velocity: true horizontal velocity of the base, m/s, body frame, (T, 2).
    """
    speed = np.linalg.norm(command, axis=1)
    moving = speed > 0.0
    along = (velocity[moving] * command[moving]).sum(axis=1) / speed[moving]
    return float(along.sum() / speed.sum()) if moving.any() else np.nan


def settled_samples(trace: Trace) -> np.ndarray:
    """Whether each sample is later than `SETTLE_S` after the last change of command, bool (T,)."""
    if not len(trace.time_s):
        return np.zeros(0, dtype=bool)
    changed = np.any(np.diff(trace.command, axis=0) != 0.0, axis=1)
    changed = np.concatenate([[True], changed])
    changed_s = np.maximum.accumulate(np.where(changed, trace.time_s, -np.inf))
    return trace.time_s - changed_s > SETTLE_S - 1e-9


def _slip(trace: Trace) -> tuple[float, float]:
    """Mean horizontal speed of loaded feet, m/s, and the loaded time summed over feet, s."""
    speed = np.linalg.norm(trace.foot_velocity[..., :2], axis=-1)[trace.foot_contact]
    return _mean(speed), len(speed) / trace.record_rate_hz


def _rate(values: np.ndarray, dt_s: float) -> float:
    """Root mean square rate of change of (T, n) values."""
    return float(np.sqrt(_mean((np.diff(values, axis=0) / dt_s) ** 2)))


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else np.nan
