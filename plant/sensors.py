"""What the simulated robot's encoders and IMU would say: the true state with delay, bias and noise."""

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
        self._layout, self._n = layout, joints
        gyro_bias, gravity_bias = (sensor_bias(sample, name) for name in ("gyro", "gravity"))
        self._gyro_bias = np.zeros(3) if gyro_bias is None else np.asarray(gyro_bias)
        self._gravity_bias = None if gravity_bias is None else np.asarray(gravity_bias).tolist()
        delay_s = float(sample.get("observation_delay_s", 0.0))
        self._past = _Past(round(delay_s / step_s) + 1, len(data.qpos), len(data.qvel), joints)
        self._noisy = noise is not None
        self._half_widths = _half_widths(noise or Noise(), joints)
        self._random = np.random.default_rng(seed)
        self._rows = np.zeros((0, 2 * joints + 6))
        self._row = 0

    def remember(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Keep this moment, to be read after the observation delay. To be called at each physics step.

        Returns:
            The true joint positions, rad, and velocities, rad/s, (n,) each, until the next call.
        """
        layout, past = self._layout, self._past
        row = past.next_row()
        qpos, qvel = past.qpos[row], past.qvel[row]
        qpos[:], qvel[:] = self._qpos, self._qvel
        past.torque[row] = torque
        past.acceleration[row] = self._acceleration
        return qpos[layout.qpos], qvel[layout.qvel]

    def joints(self, encoder_bias: np.ndarray) -> np.ndarray:
        """Joint positions rad, velocities rad/s and motor torques N m, (3, n)."""
        layout, past, row = self._layout, self._past, self._past.oldest
        position, velocity = past.qpos[row][layout.qpos], past.qvel[row][layout.qvel]
        readings = np.array((position + encoder_bias, velocity, past.torque[row]))
        if self._noisy:
            readings[:2] += self._noise()[: 2 * self._n].reshape(2, self._n)
        return readings

    def inertial(self) -> imu.Inertial:
        """The IMU's reading."""
        past, row = self._past, self._past.oldest
        base_qpos, base_qvel = self._layout.base_qpos, self._layout.base_qvel
        gyro = past.qvel[row, base_qvel + 3 : base_qvel + 6] + self._gyro_bias
        quaternion = past.qpos[row, base_qpos + 3 : base_qpos + 7].tolist()
        if self._gravity_bias is not None:
            quaternion = shift_gravity(quaternion, self._gravity_bias)
        if self._noisy:
            noise = self._noise()[2 * self._n :]
            gyro += noise[:3]
            quaternion = shift_gravity(quaternion, noise[3:].tolist())
        return imu.Inertial(gyro.tolist(), past.acceleration[row].tolist(), quaternion)

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


class _Past:
    """The last moments of a plant, in rows that are used in turn."""

    def __init__(self, length: int, nq: int, nv: int, joints: int) -> None:
        self.qpos = np.zeros((length, nq))
        self.qvel = np.zeros((length, nv))
        self.torque = np.zeros((length, joints))  # of the motors
        self.acceleration = np.zeros((length, 3))
        self.oldest = 0
        self._length, self._count = length, 0

    def next_row(self) -> int:
        """The row for a new moment; the oldest one is then the one after it, once all rows are in use."""
        row = self._count % self._length
        self._count += 1
        self.oldest = self._count % self._length if self._count >= self._length else 0
        return row
