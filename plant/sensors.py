"""What the simulated robot's encoders and IMU would say: the true state with delay, bias and noise."""

from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.rotations import shift_gravity
from footfall.deploy.drivers import imu
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample, sensor_bias

_NOISE_BLOCK = 256  # readings whose noise is drawn at once

Indices = np.ndarray | slice


class Layout(NamedTuple):
    """Where a robot's parts lie in a plant's state."""

    qpos: Indices  # of the joints, in joint order
    qvel: Indices
    base_qpos: int  # position and quaternion of the base begin here
    base_qvel: int


class _Moment(NamedTuple):
    """The true state at a physics step."""

    joints: np.ndarray  # (3, n) position rad, velocity rad/s, motor torque N m
    inertial: tuple[list[float], list[float], list[float]]  # as in `imu.Inertial`


class SimulatedSensors:
    """Remembers the recent past of a plant and reads it as the robot's sensors would."""

    def __init__(
        self,
        data: mujoco.MjData,
        layout: Layout,
        sample: Sample,
        noise: Noise | None,
        step_s: float,
        joints: int,
        seed: int,
    ) -> None:
        self._qpos, self._qvel, self._acceleration = data.qpos, data.qvel, data.sensordata[:3]
        at = layout.base_qpos + 3
        self._quaternion = data.qpos[at : at + 4]
        at = layout.base_qvel + 3
        self._gyro = data.qvel[at : at + 3]
        self._layout, self._n = layout, joints
        gyro_bias, gravity_bias = (sensor_bias(sample, name) for name in ("gyro", "gravity"))
        self._gyro_bias = (np.zeros(3) if gyro_bias is None else np.asarray(gyro_bias)).tolist()
        self._gravity_bias = None if gravity_bias is None else np.asarray(gravity_bias).tolist()
        delay_s = float(sample.get("observation_delay_s", 0.0))
        self._past: deque[_Moment] = deque(maxlen=round(delay_s / step_s) + 1)
        self._noisy = noise is not None
        self._half_widths = _half_widths(noise or Noise(), joints)
        self._random = np.random.default_rng(seed)
        self._rows = np.zeros((0, 2 * joints + 6))
        self._row = 0

    def remember(self, torque: np.ndarray) -> np.ndarray:
        """Keep this moment, to be read after the observation delay. To be called at each physics step.

        Returns:
            True joint positions rad, velocities rad/s and motor torques N m, (3, n), not to be written to.
        """
        layout = self._layout
        joints = np.empty((3, self._n))
        joints[0], joints[1], joints[2] = self._qpos[layout.qpos], self._qvel[layout.qvel], torque
        inertial = self._gyro.tolist(), self._acceleration.tolist(), self._quaternion.tolist()
        self._past.append(_Moment(joints, inertial))
        return joints

    def joints(self, encoder_bias: np.ndarray) -> np.ndarray:
        """Joint positions rad, velocities rad/s and motor torques N m, (3, n)."""
        readings = self._past[0].joints.copy()
        readings[0] += encoder_bias
        if self._noisy:
            readings[:2] += self._noise()[: 2 * self._n].reshape(2, self._n)
        return readings

    def inertial(self) -> imu.Inertial:
        """The IMU's reading."""
        gyro, acceleration, quaternion = self._past[0].inertial
        if self._gravity_bias is not None:
            quaternion = shift_gravity(quaternion, self._gravity_bias)
        gyro = [rate + bias for rate, bias in zip(gyro, self._gyro_bias, strict=True)]
        if self._noisy:
            noise = self._noise()[2 * self._n :].tolist()
            gyro = [rate + error for rate, error in zip(gyro, noise[:3], strict=True)]
            quaternion = shift_gravity(quaternion, noise[3:])
        return imu.Inertial(gyro, acceleration, quaternion)

    def _noise(self) -> np.ndarray:
        """Noise of one reading: joint positions, joint velocities, gyro, gravity; (2 n + 6,)."""
        if self._row >= len(self._rows):
            u = self._random.uniform(-1.0, 1.0, (_NOISE_BLOCK, 2 * self._n + 6))
            self._rows, self._row = u * self._half_widths, 0
        self._row += 1
        return self._rows[self._row - 1]


def _half_widths(noise: Noise, n: int) -> np.ndarray:
    widths = (noise.joint_position, noise.joint_velocity, noise.gyro, noise.gravity)
    return np.repeat(widths, (n, n, 3, 3))
