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
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    acceleration: np.ndarray


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
        self._data, self._layout, self._n = data, layout, joints
        gyro_bias, gravity_bias = (sensor_bias(sample, name) for name in ("gyro", "gravity"))
        self._gyro_bias = np.zeros(3) if gyro_bias is None else np.asarray(gyro_bias)
        self._gravity_bias = None if gravity_bias is None else np.asarray(gravity_bias).tolist()
        delay_s = float(sample.get("observation_delay_s", 0.0))
        self._past: deque[_Moment] = deque(maxlen=round(delay_s / step_s) + 1)
        self._noisy = noise is not None
        self._half_widths = _half_widths(noise or Noise(), joints)
        self._random = np.random.default_rng(seed)
        self._rows = np.zeros((0, 2 * joints + 6))
        self._row = 0

    def remember(self, torque: np.ndarray) -> None:
        """Keep this moment, to be read after the observation delay. To be called at each physics step."""
        data = self._data
        self._past.append(_Moment(data.qpos.copy(), data.qvel.copy(), torque, data.sensordata[:3].copy()))

    def joints(self, encoder_bias: np.ndarray) -> np.ndarray:
        """Joint positions rad, velocities rad/s and motor torques N m, (3, n)."""
        moment, layout = self._past[0], self._layout
        readings = np.empty((3, self._n))
        np.add(moment.qpos[layout.qpos], encoder_bias, out=readings[0])
        readings[1] = moment.qvel[layout.qvel]
        readings[2] = moment.torque
        if self._noisy:
            readings[:2] += self._noise()[: 2 * self._n].reshape(2, self._n)
        return readings

    def inertial(self) -> imu.Inertial:
        """The IMU's reading."""
        moment, layout = self._past[0], self._layout
        gyro = moment.qvel[layout.base_qvel + 3 : layout.base_qvel + 6] + self._gyro_bias
        quaternion = moment.qpos[layout.base_qpos + 3 : layout.base_qpos + 7].tolist()
        if self._gravity_bias is not None:
            quaternion = shift_gravity(quaternion, self._gravity_bias)
        if self._noisy:
            noise = self._noise()[2 * self._n :]
            gyro += noise[:3]
            quaternion = shift_gravity(quaternion, noise[3:].tolist())
        return imu.Inertial(gyro.tolist(), moment.acceleration.tolist(), quaternion)

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
