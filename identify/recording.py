"""A log's commands and readings of the joints as arrays."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.log_analysis.columns import RECORDED_BUS, LogColumns, read_columns
from footfall.deploy.log_analysis.robot import check_joints
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.description import Robot

MIN_TICKS = 100
MIN_STEP = 1e-7  # between readings; a smaller difference is an error of floating-point numbers
# A position step is a jump if it exceeds JUMP_RAD plus SPEED_FACTOR times the travel at no-load speed.
JUMP_RAD = 0.1
SPEED_FACTOR = 2.0


@dataclass(frozen=True)
class Recording:
    """Commands and readings of n joints at T ticks."""

    source: str
    time_s: np.ndarray  # (T,) sending times of commands
    command: np.ndarray  # (T, 5, n) position, velocity, stiffness, damping, torque; holds until the next tick
    read_s: np.ndarray  # (T, n) arrival times of readings
    position: np.ndarray  # (T, n) rad
    torque: np.ndarray  # (T, n) N m as reported
    turn_rad_s: float  # rms of the base's angular velocity
    gravity: np.ndarray  # (3,) mean direction of gravity in the base frame

    @property
    def period_s(self) -> float:
        """Mean time between ticks."""
        return float((self.time_s[-1] - self.time_s[0]) / (len(self.time_s) - 1))

    @property
    def position_noise_rad(self) -> np.ndarray:
        """Standard deviation of the position readings' noise, (n,).

        A joint that never moved is assumed to have the largest rounding error of all joints.
        """
        rounding = max(_rounding_error(each) for each in self.position.T)
        moved = np.ptp(self.position, axis=0) > 0.0
        return np.maximum(np.where(moved, reading_noise(self.position), rounding), 1e-5)


def reading_noise(readings: np.ndarray) -> np.ndarray:
    """Standard deviation of the noise of readings (T, n), (n,), from their third differences.

    It is at least their rounding error: a joint that rests repeats one reading, and its third differences are
    zero.
    """
    third = np.diff(readings, 3, axis=0)
    rounding = np.array([_rounding_error(each) for each in readings.T])
    result: np.ndarray = np.maximum(np.sqrt((third**2).mean(axis=0) / 20.0), rounding)
    return result


def _rounding_error(readings: np.ndarray) -> float:
    """Standard deviation of readings, (T,), rounded to their smallest difference; 0 if all are equal."""
    steps = np.diff(np.unique(readings))
    steps = steps[steps > MIN_STEP]
    return float(steps.min()) / np.sqrt(12.0) if len(steps) else 0.0


def read_recording(path: Path, robot: Robot, start_s: float = 0.0, end_s: float = np.inf) -> Recording:
    """The longest part of a log in which its policy was in control.

    Raises:
        UserError: the log cannot be read, is of another robot, or has no such part.
    """
    columns = read_columns(path)
    check_joints(columns.log, robot)
    stretches = [(begin, end) for mode, begin, end in columns.states() if mode == "WALKING"]
    if not stretches:
        raise UserError(f"{path} has no motion under a policy")
    begin, end = max(stretches, key=lambda each: each[1] - each[0])
    found = _between(columns, str(path), len(robot.joint_names), max(begin, start_s), min(end, end_s))
    _check_continuous(found, robot)
    if columns.log.metadata.get("bus") == RECORDED_BUS:
        return found
    return replace(found, command=as_received(robot, found.command))


def _check_continuous(recording: Recording, robot: Robot) -> None:
    """A single wrong reading would count as noise, within which any error of the model is small.

    Raises:
        UserError: a reading is farther from the one before than its joint can move.
    """
    elapsed_s = np.diff(recording.time_s)[:, None]
    limit = JUMP_RAD + SPEED_FACTOR * np.asarray(robot.motor.no_load_speed) * elapsed_s
    jumps = np.argwhere(~(np.abs(np.diff(recording.position, axis=0)) <= limit))
    if len(jumps):
        row, joint = jumps[0]
        raise UserError(
            f"{recording.source}: {robot.joint_names[joint]} jumps from {recording.position[row, joint]:.3g}"
            f" to {recording.position[row + 1, joint]:.3g} rad at {recording.time_s[row + 1]:.3f} s, faster"
            " than the motor: correct wrong readings and full turns in the recording"
        )


def as_received(robot: Robot, command: np.ndarray) -> np.ndarray:
    """Commands (T, 5, n) after encoding: a frame rounds, and some cannot encode exactly zero."""
    wiring = wiring_of(robot)
    driver, end = open_driver(wiring), open_motor_end(wiring)
    received = command.copy()
    for row, values in enumerate(command):
        requests = end.requests(driver.command(values))
        if requests.values.shape[1]:
            received[row][:, requests.motor] = requests.values
    return received


def _between(columns: LogColumns, source: str, count: int, begin_s: float, end_s: float) -> Recording:
    targets, gains = columns.targets, columns.column("/joint_gains", 2 * count)
    readings, ages = columns.readings, columns.column("/reading_ages", count + 1)
    times, command_rows, reading_rows = np.intersect1d(
        targets.time_s.round(6), readings.time_s.round(6), return_indices=True
    )
    inside = (times >= begin_s) & (times < end_s)
    if (
        inside.sum() < MIN_TICKS
        or len(gains.time_s) != len(targets.time_s)
        or len(ages.time_s) != len(readings.time_s)
    ):
        raise UserError(f"{source} has too few commands and readings between {begin_s:g} and {end_s:g} s")
    times, command_rows, reading_rows = times[inside], command_rows[inside], reading_rows[inside]
    target, gain = targets.values[command_rows], gains.values[command_rows]
    reading = readings.values[reading_rows]
    imu = columns.column("/imu/data", 37)
    imu_inside = (imu.time_s >= begin_s) & (imu.time_s < end_s)
    return Recording(
        source=source,
        time_s=times,
        command=np.concatenate([target[:, : 2 * count], gain, target[:, 2 * count :]], axis=1).reshape(
            -1, 5, count
        ),
        read_s=times[:, None] - ages.values[reading_rows, :count],
        position=reading[:, :count],
        torque=reading[:, 2 * count :],
        turn_rad_s=float(np.sqrt((imu.values[imu_inside, 13:16] ** 2).sum(axis=1).mean())),
        gravity=_gravity(imu.values[imu_inside, :4]),
    )


def _gravity(orientation: np.ndarray) -> np.ndarray:
    """Mean direction of gravity in the body frame, (3,), from quaternions x, y, z, w, (T, 4)."""
    x, y, z, w = orientation.T
    down = -np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    mean = down.mean(axis=0)
    result: np.ndarray = mean / np.linalg.norm(mean)
    return result
