"""A user's own drivers: a motor protocol in units of 1/1000, and an IMU with two frames."""

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Replies
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.polled import Orders, PolledDriver, motor_lookup, to_every_motor
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests

REPLY = 0x400
COMMAND, ENABLE, DISABLE, ZERO = range(4)  # byte 7
MILLI = np.dtype("<i2")
IMU_IDS = (0x500, 0x501)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def milli(values: np.ndarray, kind: int) -> np.ndarray:
    """Three numbers for each of k frames, (3, k), in thousandths, and a kind, as bytes (k, 8)."""
    data = np.zeros((values.shape[1], 8), np.uint8)
    data[:, :6] = np.rint(1000 * values).clip(-32768, 32767).T.astype(MILLI, order="C").view(np.uint8)
    data[:, 7] = kind
    return data


def numbers(data: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(data[:, :6]).view(MILLI).T / 1000


class OwnDriver(PolledDriver):
    """A motor that follows a position with gains of its own: 40 N m/rad and 1 N m s/rad."""

    maker = "own"
    models: tuple[str, ...] = ()
    motor_end = "own_drivers:OwnMotorEnd"
    filters: tuple[CanFilter, ...] = ({"can_id": REPLY, "can_mask": 0x780, "extended": False},)

    def __init__(self, wiring: Wiring) -> None:
        zeros = np.zeros((3, len(wiring.motor_id)))
        orders = (milli(zeros, kind) for kind in (ENABLE, DISABLE, ZERO))
        super().__init__(wiring, Orders(*(to_every_motor(wiring, data) for data in orders)))
        self.highest = np.tile([[30.0], [30.0], [500.0], [5.0], [30.0]], len(wiring.motor_id))
        self.lowest = np.where(np.arange(5)[:, None] // 2 == 1, 0.0, -self.highest)
        self.gain_rounding = np.zeros((2, len(wiring.motor_id)))

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        return motor_id, REPLY + motor_id

    def command(self, values: np.ndarray) -> Frames:
        if not np.isfinite(values).all():
            raise ValueError("a command that is not finite cannot be sent")
        numbers_to_send = np.array([values[0] * (values[2] > 0), values[3], values[4] + 0.0])
        return to_every_motor(self._wiring, milli(numbers_to_send, COMMAND))

    def replies(self, frames: Frames) -> Replies:
        motor = self._lookup[frames.channel, frames.id & 0x7F]
        is_reply = (motor >= 0) & (frames.id & ~0x7F == REPLY) & (frames.length == 8)
        frames, motor = frames.take(is_reply), motor[is_reply]
        unknown = np.full(len(motor), np.nan)
        return Replies(motor, numbers(frames.data), frames.data[:, 7], unknown, unknown, frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return f"error {code}"


class OwnMotorEnd(PolledMotorEnd):
    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0x780, "extended": False},)

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._lookup = motor_lookup(wiring)

    def requests(self, frames: Frames) -> Requests:
        motor = self._lookup[frames.channel, frames.id & 0xFF]
        is_request = (motor >= 0) & (frames.id < 0x80) & (frames.data[:, 7] <= ZERO)
        frames, motor = frames.take(is_request), motor[is_request]
        position, damping, torque = numbers(frames.data)
        ones = np.ones(len(motor))
        kind = np.array([Request.COMMAND, Request.ENABLE, Request.DISABLE, Request.ZERO])[frames.data[:, 7]]
        return Requests(motor, np.array([position, 0 * ones, 40.0 * ones, damping, torque]), kind)

    def reply(self, motor: np.ndarray | slice, report: Report) -> Frames:
        wiring, data = self._wiring, milli(report.values, 0)
        data[:, 7] = report.error
        return Frames(wiring.channel[motor], REPLY + wiring.motor_id[motor], data, np.full(len(data), 8))


class OwnImu:
    """Gyro in one frame, acceleration in another; it has no orientation and reports level."""

    filters: tuple[CanFilter, ...] = ({"can_id": IMU_IDS[0], "can_mask": 0x7FE, "extended": False},)
    identifiers: tuple[int, ...] = IMU_IDS
    imu_end = "own_drivers:OwnImuEnd"
    oldest = "gyro"

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self.reading = Inertial((0.0,) * 3, (0.0, 0.0, 9.81), LEVEL)
        self.arrived_us: int | None = None

    def absorb(self, frames: Frames, now_us: int) -> None:
        for channel, identifier, values in zip(
            frames.channel, frames.id, numbers(frames.data).T, strict=True
        ):
            if channel == self._channel and identifier in IMU_IDS:
                part = ("gyro", "acceleration")[int(identifier) - IMU_IDS[0]]
                self.reading = self.reading._replace(**{part: tuple(values.tolist())})
                self.arrived_us = now_us


class OwnImuEnd:
    def __init__(self, channel: int) -> None:
        self._channel = np.full(2, channel)

    def encode(self, reading: Inertial) -> Frames:
        data = milli(np.array([reading.gyro, reading.acceleration]).T, 0)
        return Frames(self._channel, np.array(IMU_IDS), data, np.full(2, 8))
