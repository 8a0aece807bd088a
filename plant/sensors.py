"""Encoders and IMU of the simulated robot: the true state with delay, bias and noise."""

import operator
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import imu
from footfall.domain_rand.accelerometer import randomised_accelerometer
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample, sensor_bias
from footfall.plant.delays import DelayLine
from footfall.robots.kinds import Parts
from footfall.robots.readings import READINGS

MOTORS = ("joint_position", "joint_velocity", "joint_torque")  # fields of `Sensed` that motors report
IMU = imu.Inertial._fields  # fields of `Sensed` that the IMU reports
BIASED_BY_MOTOR = "joint_position"  # the motor adds its bias, since it controls the biased position
ACCELEROMETER = 1  # combined with the seed, so that its noise does not change that of other readings
_NOISE_BLOCK = 256  # readings whose noise is drawn at once

Indices = np.ndarray | slice


class Layout(NamedTuple):
    """Indices of a robot's parts in a plant's state."""

    qpos: Indices  # of the joints, in joint order
    qvel: Indices
    base_qpos: int  # first index of the base's position and quaternion
    base_qvel: int


class _Moment(NamedTuple):
    """The true state at a physics step."""

    joints: np.ndarray  # (3, n) as in `MOTORS`
    inertial: tuple[list[float], list[float], list[float]]  # as in `imu.Inertial`


class _Error(NamedTuple):
    """Bias and noise of one reading."""

    row: int  # of the device's sensed values
    shift: Callable[[Any, Any], Any]  # adds an offset of the reading to the sensed value
    bias: np.ndarray | None  # constant offset of the reading
    noise: slice  # its columns in a row of `_Noise`

    def on_lists(self) -> "_Error":
        """The same for sensed values that are lists of floats, which are faster than short arrays."""
        return self._replace(shift=lambda value, offset: self.shift(value, offset.tolist()))


class SimulatedSensors:
    """Stores the recent states of a plant and reads them with the declared delay, bias and noise.

    Readings are declared in `robots/readings.py`, delays and biases in `domain_rand/randomisation.py`.
    """

    def __init__(
        self,
        data: mujoco.MjData,
        layout: Layout,
        sample: Sample,
        noise: Noise | None,
        step_s: float,
        joints: int,
        seed: int,
        mean_velocity: bool = False,
    ) -> None:
        """Sensors of a plant.

        Args:
            data: its state.
            layout: where its joints and base are.
            sample: delays and biases.
            noise: half-widths of the noise; None: no noise.
            step_s: physics step.
            joints: number of joints.
            seed: seed of the noise and of swinging delays.
            mean_velocity: whether motors report a joint's mean velocity over two steps, like drives that
                measure it with an encoder. An engine's velocities may alternate from step to step: the
                integral of every second one would drift away from the positions.

        Raises:
            UserError: a reading with bias or noise has no `shift`.
        """
        self._qpos, self._qvel, self._acceleration = data.qpos, data.qvel, data.sensordata[:3]
        at = layout.base_qpos + 3
        self._quaternion = data.qpos[at : at + 4]
        at = layout.base_qvel + 3
        self._gyro = data.qvel[at : at + 3]
        self._layout, self._n = layout, joints
        self._mean_velocity, self._velocity_before = mean_velocity, self._qvel[layout.qvel].copy()
        self._delay_line: DelayLine[_Moment] = DelayLine(sample, step_s, seed)
        self._noise = None if noise is None else _Noise(noise, joints, seed)
        self._motor_errors = list(_errors(MOTORS, sample, noise, joints, operator.add))
        self._imu_errors = [each.on_lists() for each in _errors(IMU, sample, noise, joints, _add_lists)]
        accelerometer = randomised_accelerometer(sample)
        self._acceleration_bias = np.broadcast_to(accelerometer.bias, 3).tolist()
        self._acceleration_noise = float(accelerometer.noise)
        self._acceleration_random = np.random.default_rng((seed, ACCELEROMETER))

    def remember(self, torque: np.ndarray) -> np.ndarray:
        """Store the current state, to be read after the observation delay. Call at each physics step.

        Returns:
            True joint positions rad, velocities rad/s and motor torques N m, (3, n), not to be written to.
        """
        layout = self._layout
        joints = np.empty((3, self._n))
        joints[0], joints[1], joints[2] = self._qpos[layout.qpos], self._qvel[layout.qvel], torque
        inertial = self._gyro.tolist(), self._acceleration.tolist(), self._quaternion.tolist()
        self._delay_line.push(_Moment(self._as_reported(joints) if self._mean_velocity else joints, inertial))
        return joints

    def _as_reported(self, joints: np.ndarray) -> np.ndarray:
        """The true values of this step, with the mean of its velocity and that of the step before."""
        reported = joints.copy()
        reported[1] = 0.5 * (self._velocity_before + joints[1])
        self._velocity_before = joints[1].copy()
        return reported

    def joints(self, encoder_bias: np.ndarray) -> np.ndarray:
        """Joint positions rad, velocities rad/s and motor torques N m, (3, n), as motors report them.

        `encoder_bias` (n,) rad is the motors' own.
        """
        readings = self._delay_line.delayed().joints.copy()
        readings[0] += encoder_bias
        self._add_errors(readings, self._motor_errors)
        return readings

    def inertial(self) -> imu.Inertial:
        """The IMU's reading."""
        readings = list(self._delay_line.delayed().inertial)
        self._add_errors(readings, self._imu_errors)
        half_width, bias = self._acceleration_noise, self._acceleration_bias
        if half_width or any(bias):
            drawn = self._acceleration_random.uniform(-half_width, half_width, 3).tolist()
            readings[1] = [a + b + n for a, b, n in zip(readings[1], bias, drawn, strict=True)]
        return imu.Inertial(*readings)

    def _add_errors(self, values: Any, errors: list[_Error]) -> None:
        for error in errors:
            if error.bias is not None:
                values[error.row] = error.shift(values[error.row], error.bias)
        if self._noise is not None:
            noise = self._noise.draw()
            for error in errors:
                values[error.row] = error.shift(values[error.row], noise[error.noise])


class _Noise:
    """Uniform noise of all readings, drawn in blocks."""

    def __init__(self, noise: Noise, joints: int, seed: int) -> None:
        by_reading = _columns(joints)
        self._half_widths = np.concatenate(
            [
                np.full(columns.stop - columns.start, getattr(noise, name))
                for name, columns in by_reading.items()
            ]
        )
        self._random = np.random.default_rng(seed)
        self._rows = np.zeros((0, len(self._half_widths)))
        self._row = 0

    def draw(self) -> np.ndarray:
        """One noise value for each component of all readings, in the layout of `_columns`."""
        if self._row >= len(self._rows):
            u = self._random.uniform(-1.0, 1.0, (_NOISE_BLOCK, len(self._half_widths)))
            self._rows, self._row = u * self._half_widths, 0
        self._row += 1
        return self._rows[self._row - 1]


def _columns(joints: int) -> dict[str, slice]:
    """The columns of each reading in a row of noise, readings of motors first."""
    by_reading, start = {}, 0
    for name in sorted(READINGS, key=lambda name: READINGS[name].sensed not in MOTORS):
        stop = start + READINGS[name].kind.size(Parts(joints))
        by_reading[name] = slice(start, stop)
        start = stop
    return by_reading


def _errors(
    fields: Sequence[str], sample: Sample, noise: Noise | None, joints: int, add: Callable[[Any, Any], Any]
) -> Iterator[_Error]:
    """Bias and noise of the readings of one device's fields; `add` adds an offset to a field's values."""
    for name, columns in _columns(joints).items():
        declared = READINGS[name]
        if declared.sensed not in fields:
            continue
        drawn = None if name == BIASED_BY_MOTOR else sensor_bias(sample, name)
        bias = None if drawn is None else np.asarray(drawn, dtype=float)
        half_width = 0.0 if noise is None else getattr(noise, name)
        if bias is None and not half_width:
            continue
        if not declared.can_shift:
            raise UserError(
                f"reading '{name}': the simulated robot cannot add bias or noise to it, its declaration has"
                " no shift"
            )
        yield _Error(fields.index(declared.sensed), declared.shift or add, bias, columns)


def _add_lists(value: list[float], offset: list[float]) -> list[float]:
    return [a + b for a, b in zip(value, offset, strict=True)]
