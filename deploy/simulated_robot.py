"""The robot on the far side of the bus: motors that decode frames and a body in MuJoCo that they move.

Each physics step applies the joint law with the plant's own motors. Frames take effect, and readings are
taken, at the physics step nearest to the moment in question.
"""

from collections import deque
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from deploy import imu, mit
from deploy.frames import Frames
from deploy.ground_truth import Truth, Witness
from deploy.simulated_wire import Side, SimulatedWires
from deploy.wiring import Wiring
from domain_rand.bodies import apply_to_model, body_map
from domain_rand.noise import Noise
from domain_rand.sample import Sample, randomised_motor
from robots.actuator import JointCommand, friction_torque, motor_torque
from robots.description import Robot
from robots.errors import UserError
from robots.model import joint_addresses, read_plant

MOTOR_TIMEOUT_S = 0.1  # a motor that hears nothing for so long switches itself off
IMU_PERIOD_S = 0.002
TEMPERATURE_C = 30
_NOISE_BLOCK = 256  # readings whose noise is drawn at once


@dataclass
class Faults:
    """Faults to inject, switched on and off from outside. Arrays are (n,) in joint order."""

    silent: np.ndarray  # bool: the motor is cut off; it carries on until its own time-out
    stuck: np.ndarray  # bool: the motor repeats its last reply
    error: np.ndarray  # uint8: error code that the motor reports
    imu_silent: bool = False
    imu_stuck: bool = False


class Energy:
    """Electrical and mechanical energy of the motors, J, summed since the last `take`."""

    def __init__(self, robot: Robot) -> None:
        ampere_per_nm = 1.0 / (
            robot.motor_figures("torque_constant_nm_a") * robot.motor_figures("gear_ratio")
        )
        self._copper = robot.motor_figures("winding_resistance_ohm") * ampere_per_nm**2
        self._electrical = self._mechanical = self._positive = 0.0
        self._seconds = 0.0

    def add(self, torque: np.ndarray, velocity: np.ndarray, dt_s: float) -> None:
        power = torque * velocity
        mechanical = float(power.sum())
        self._mechanical += mechanical * dt_s
        self._positive += float(np.maximum(power, 0.0).sum()) * dt_s
        self._electrical += (mechanical + float(self._copper @ (torque * torque))) * dt_s
        self._seconds += dt_s

    def take(self) -> tuple[float, float, float]:
        """Mean electrical, mechanical and positive mechanical power since the last call, W."""
        seconds = self._seconds or 1.0
        means = (self._electrical / seconds, self._mechanical / seconds, self._positive / seconds)
        self._electrical = self._mechanical = self._positive = self._seconds = 0.0
        return means


class SimulatedRobot:
    """A robot in simulation, seen through its buses. Stands in its default pose on the ground at first."""

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        wires: SimulatedWires,
        plant: Path | None = None,
        sample: Sample | None = None,
        noise: Noise | None = None,
        seed: int = 0,
    ) -> None:
        """Raises UserError if the plant does not fit the robot, or the sample does not fit the plant."""
        self._plant = read_plant(robot, plant)
        self.notes = self._plant.notes
        self.model = self._plant.model
        self._sample = sample = sample or Sample()
        if sample.link_mass is not None and len(sample.link_mass) != self.model.nbody - 1:
            raise UserError(
                f"the randomised plant was drawn for {len(sample.link_mass)} bodies,"
                f" this one has {self.model.nbody - 1}"
            )
        apply_to_model(self.model, sample, body_map(self.model, robot))
        self.data = mujoco.MjData(self.model)
        self._wiring, self._wires = wiring, wires
        self._codec = mit.Codec(wiring.protocols)
        self._motor = randomised_motor(self._plant.motor, sample)
        qpos, qvel = joint_addresses(self.model, robot)
        self._qpos, self._qvel = _as_slice(qpos), _as_slice(qvel)
        self._witness = Witness(self._plant, self.data, (qpos, qvel), robot.description.standing_height_m)
        self._energy = Energy(robot)
        base_joint = self.model.body_jntadr[self._plant.base]
        self._free_qpos = int(self.model.jnt_qposadr[base_joint])
        self._free_qvel = int(self.model.jnt_dofadr[base_joint])

        n = len(robot.joint_names)
        self._n = n
        self._dt_s = float(self.model.opt.timestep)
        self._dt_us = round(self._dt_s * 1e6)
        self._step = 0
        self._imu_every = round(IMU_PERIOD_S / self._dt_s)
        self._timeout_steps = round(MOTOR_TIMEOUT_S / self._dt_s)
        self._imu_counter = 0
        self._head = wiring.motor_id.astype(np.uint64)
        self._reply_id = mit.REPLY_ID + wiring.motor_id
        self._imu_frames = Frames(
            np.full(3, wiring.imu_channel), np.array(imu.IDS), np.zeros((3, 8), np.uint8), np.full(3, 8)
        )
        self._gain_scale = np.ones((5, n))
        if sample.kp is not None:
            self._gain_scale[2] = sample.kp
        if sample.kd is not None:
            self._gain_scale[3] = sample.kd
        self._bias = np.zeros(n) if sample.encoder_bias is None else np.asarray(sample.encoder_bias)
        self._action_steps = _steps(sample.action_delay_s, self._dt_s)
        self._observation_steps = _steps(sample.observation_delay_s, self._dt_s)

        self._values = np.zeros((5, n))  # the command that each motor follows
        self._enabled = np.zeros(n, dtype=bool)
        self._any_enabled = False
        self._heard_step = np.zeros(n, dtype=np.int64)
        self._due: deque[tuple[int, np.ndarray, np.ndarray]] = deque()
        self._torque = np.zeros(n)
        self._acceleration = np.array([0.0, 0.0, 9.81])
        self._readings: deque[tuple[np.ndarray, imu.Inertial]] = deque(
            maxlen=self._observation_steps + 1
        )
        self._last_reply = np.zeros((n, 8), dtype=np.uint8)
        self.faults = Faults(np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, np.uint8))
        self._noise = None if noise is None else _half_widths(noise, n)
        self._rng = np.random.default_rng(seed)
        self._noise_rows = np.zeros((0, 2 * n + 6))
        self._noise_row = 0
        self._stand(robot)

    # -- what a study may do from outside ------------------------------------------------------------

    @property
    def time_us(self) -> int:
        """Simulated time that has passed."""
        return self._step * self._dt_us

    def advance(self, now_us: int) -> None:
        """Simulate up to a time, exchanging frames on the way."""
        while (self._step + 1) * self._dt_us <= now_us:
            self._advance_one_step()

    def truth(self) -> Truth:
        """The true state."""
        return self._witness.truth(self._torque)

    def fall(self) -> str | None:
        """Why the robot counts as fallen, or None."""
        return self._witness.fall()

    def diverged(self) -> bool:
        """Whether the simulation lost its numbers."""
        return self._witness.diverged()

    def take_power(self) -> tuple[float, float, float]:
        """Mean electrical, mechanical and positive mechanical power since the last call, W."""
        return self._energy.take()

    def push(self, delta_v_world: tuple[float, float, float]) -> None:
        """Change the velocity of the whole robot at once, m/s, world frame."""
        self.data.qvel[self._free_qvel : self._free_qvel + 3] += delta_v_world

    # -- one physics step ----------------------------------------------------------------------------

    def _advance_one_step(self) -> None:
        start_us = self._step * self._dt_us
        self._readings.append(self._read())
        for frames in self._wires.receive(Side.ROBOT, start_us + self._dt_us / 2):
            self._obey(frames, start_us)
        if self._step % self._imu_every == 0:
            self._report_imu(start_us)
        while self._due and self._due[0][0] <= self._step:
            _, motors, values = self._due.popleft()
            self._values[:, motors] = values
        if self._any_enabled:
            self._check_timeouts()
        self._move()
        self._step += 1

    def _move(self) -> None:
        data = self.data
        position, velocity = data.qpos[self._qpos], data.qvel[self._qvel]
        if self._any_enabled:
            measured = position + self._bias  # a motor closes its loop on its own encoder
            torque = motor_torque(JointCommand(*self._values), measured, velocity, self._motor)
            torque *= self._enabled
        else:
            torque = np.zeros(self._n)
        self._torque = torque
        data.qfrc_applied[self._qvel] = torque + friction_torque(velocity, self._motor)
        self._energy.add(torque, velocity, self._dt_s)
        mujoco.mj_step(self.model, data)

    def _check_timeouts(self) -> None:
        late = self._step - self._heard_step > self._timeout_steps
        if late.any():
            self._enabled &= ~late
            self._any_enabled = bool(self._enabled.any())

    # -- frames --------------------------------------------------------------------------------------

    def _obey(self, frames: Frames, now_us: float) -> None:
        motor = self._wiring.lookup[frames.channel, frames.id & 0xFF]
        usable = (motor >= 0) & (frames.id < 0x100) & (frames.length == 8)
        usable &= ~self.faults.silent[motor]
        data = frames.data
        if not usable.all():
            motor, data = motor[usable], data[usable]
            if not len(motor):
                return
        word = mit.words(data)
        special = word >= mit.ENTER
        if special.any():
            self._switch(word[special], motor[special])
        ordinary = ~special
        if ordinary.any():
            if special.any():
                self._follow(word[ordinary], motor[ordinary])
            else:
                self._follow(word, motor)
        self._heard_step[motor] = self._step
        self._reply(motor, now_us)

    def _follow(self, word: np.ndarray, motor: np.ndarray) -> None:
        values = self._codec.decode(word, motor) * self._gain_scale[:, motor]
        self._due.append((self._step + self._action_steps, motor, values))

    def _switch(self, word: np.ndarray, motor: np.ndarray) -> None:
        entered = motor[word == mit.ENTER]
        self._values[:, entered[~self._enabled[entered]]] = 0.0  # a motor wakes up limp
        self._enabled[entered] = True
        self._enabled[motor[word == mit.EXIT]] = False
        zeroed = motor[word == mit.ZERO]
        self._bias[zeroed] = -self.data.qpos[self._qpos][zeroed]
        self._any_enabled = bool(self._enabled.any())

    def _reply(self, motor: np.ndarray, now_us: float) -> None:
        joints = self._readings[0][0]
        if self._noise is not None:
            joints = joints.copy()
            joints[:2] += self._noise_now()[: 2 * self._n].reshape(2, self._n)
        tail = self.faults.error[motor] | np.uint64(TEMPERATURE_C << 8)
        data = self._codec.encode_replies(motor, self._head[motor], joints[:, motor], tail)
        if self.faults.stuck.any():
            stuck = self.faults.stuck[motor]
            data[stuck] = self._last_reply[motor[stuck]]
        self._last_reply[motor] = data
        channel = self._wiring.channel[motor]
        reply = Frames(channel, self._reply_id[motor], data, np.full(len(motor), 8))
        self._wires.send(Side.ROBOT, reply, now_us)

    def _report_imu(self, now_us: float) -> None:
        if self.faults.imu_silent:
            return
        if not self.faults.imu_stuck:
            self._imu_counter += 1
            reading = self._readings[0][1]
            if self._noise is not None:
                reading = _disturbed(reading, self._noise_now()[2 * self._n :].tolist())
            data = imu.encode(reading, self._imu_counter)
            self._imu_frames = self._imu_frames._replace(data=data)
        self._wires.send(Side.ROBOT, self._imu_frames, now_us)

    # -- readings ------------------------------------------------------------------------------------

    def _read(self) -> tuple[np.ndarray, imu.Inertial]:
        """Readings of this moment without noise: (3, n) of the joints, and the IMU's."""
        data, sample = self.data, self._sample
        joints = np.empty((3, self._n))
        joints[0] = data.qpos[self._qpos]
        joints[0] += self._bias
        joints[1] = data.qvel[self._qvel]
        joints[2] = self._torque
        gyro = data.qvel[self._free_qvel + 3 : self._free_qvel + 6]
        if sample.gyro_bias is not None:
            gyro = gyro + sample.gyro_bias
        quaternion = data.qpos[self._free_qpos + 3 : self._free_qpos + 7].tolist()
        if sample.gravity_bias is not None:
            quaternion = _tilted(quaternion, [float(b) for b in sample.gravity_bias])
        return joints, imu.Inertial(
            tuple(gyro.tolist()), tuple(data.sensordata[:3].tolist()), tuple(quaternion)
        )

    def _noise_now(self) -> np.ndarray:
        """Noise of one reading: joint positions, joint velocities, gyro, gravity; (2 n + 6,)."""
        if self._noise_row >= len(self._noise_rows):
            u = self._rng.uniform(-1.0, 1.0, (_NOISE_BLOCK, 2 * self._n + 6))
            self._noise_rows, self._noise_row = u * self._noise, 0
        self._noise_row += 1
        return self._noise_rows[self._noise_row - 1]

    # -- beginning -----------------------------------------------------------------------------------

    def _stand(self, robot: Robot) -> None:
        """Default pose, upright, as high as the lowest part just touches the ground."""
        data, at = self.data, self._free_qpos
        data.qpos[self._qpos] = robot.default_pose
        data.qpos[at + 3 : at + 7] = (1.0, 0.0, 0.0, 0.0)
        low, high = 0.0, 4.0 * robot.description.standing_height_m
        for _ in range(30):
            data.qpos[at + 2] = middle = (low + high) / 2
            mujoco.mj_fwdPosition(self.model, data)
            low, high = (middle, high) if self._touches_ground() else (low, middle)
        data.qpos[at + 2] = low
        mujoco.mj_forward(self.model, data)

    def _touches_ground(self) -> bool:
        contact = self.data.contact
        bodies = self.model.geom_bodyid[contact.geom]
        return bool(((bodies == 0).any(axis=1) & (contact.dist <= 0.0)).any())


def _as_slice(indices: np.ndarray) -> slice | np.ndarray:
    """Consecutive indices as a slice, which NumPy reads and writes without a copy."""
    first, last = int(indices[0]), int(indices[-1])
    return slice(first, last + 1) if (np.diff(indices) == 1).all() else indices


def _steps(delay_s: np.ndarray | None, dt_s: float) -> int:
    return 0 if delay_s is None else round(float(delay_s) / dt_s)


def _half_widths(noise: Noise, n: int) -> np.ndarray:
    return np.concatenate(
        [
            np.full(n, noise.joint_position),
            np.full(n, noise.joint_velocity),
            np.full(3, noise.gyro),
            np.full(3, noise.gravity),
        ]
    )


def _disturbed(reading: imu.Inertial, noise: list[float]) -> imu.Inertial:
    gyro = tuple(value + extra for value, extra in zip(reading.gyro, noise[:3], strict=True))
    return reading._replace(
        gyro=gyro, quaternion=tuple(_tilted(list(reading.quaternion), noise[3:]))
    )


def _tilted(quaternion: list[float], offset: list[float]) -> list[float]:
    """A quaternion whose gravity in the body frame is the given one's plus an offset, normalised.

    Gravity in the body frame is g; it shall be h, parallel to g + offset. The shortest rotation that
    takes h to g, applied first, does that and leaves the heading alone.
    """
    w, x, y, z = quaternion
    g = (2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1.0)
    h = [a + b for a, b in zip(g, offset, strict=True)]
    norm = sum(a * a for a in h) ** 0.5
    h = [a / norm for a in h]
    a = 1.0 + h[0] * g[0] + h[1] * g[1] + h[2] * g[2]
    b = h[1] * g[2] - h[2] * g[1]
    c = h[2] * g[0] - h[0] * g[2]
    d = h[0] * g[1] - h[1] * g[0]
    norm = (a * a + b * b + c * c + d * d) ** 0.5
    a, b, c, d = a / norm, b / norm, c / norm, d / norm
    return [
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    ]
