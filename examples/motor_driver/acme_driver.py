"""Example of a motor driver for a new protocol; acme_motor_end.py has its simulated motors.

    footfall deploy trot --robot my_robot --command 0.4,0,0

In my_robot/robot.yaml a motor names it: `protocol: acme_driver:AcmeDriver`. The protocol is fictitious:

    0x100 + id  command  position, velocity, torque (int16), stiffness, damping (uint8)
    0x180 + id  order    first byte: 1 enable, 2 disable, 3 zero, 4 clear errors
    0x200 + id  reply    position, velocity, torque (int16), error (uint8), temperature (int8, Celsius)

A motor answers every frame with a reply. Numbers are little-endian.
"""

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Replies
from footfall.deploy.drivers.polled import Orders, PolledDriver, to_every_motor
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

COMMAND, ORDER, REPLY = 0x100, 0x180, 0x200
ENABLE, DISABLE, ZERO, CLEAR = 1, 2, 3, 4
ERRORS = {1: "over-current", 2: "over-temperature", 3: "a communication time-out"}
# Unit per count: rad, rad/s, N m/rad, N m s/rad, N m.
UNITS = {"position": 5e-4, "velocity": 2e-3, "kp": 1.0, "kd": 0.02, "torque": 2e-3}
COMMAND_FIELDS = np.dtype("<i2, <i2, <i2, u1, u1")
COMMAND_FIELDS.names = ("position", "velocity", "torque", "kp", "kd")
REPLY_FIELDS = np.dtype("<i2, <i2, <i2, u1, i1")
REPLY_FIELDS.names = ("position", "velocity", "torque", "error", "celsius")


class AcmeDriver(PolledDriver):
    """Encodes commands and decodes replies of all motors at once; arrays are in joint order."""

    maker = "Acme"
    models = ()  # robot.yaml names the class itself
    motor_end = "acme_motor_end:AcmeMotorEnd"
    filters: tuple[CanFilter, ...] = ({"can_id": REPLY, "can_mask": 0x780, "extended": False},)

    def __init__(self, wiring: Wiring) -> None:
        n = len(wiring.motor_id)
        content = np.zeros((4, n, 8), np.uint8)
        content[:, :, 0] = np.array([[ENABLE], [DISABLE], [ZERO], [CLEAR]])
        batches = [to_every_motor(wiring, data) for data in content]
        super().__init__(wiring, Orders(*(frames._replace(id=ORDER + frames.id) for frames in batches)))
        unit = np.array([[unit] * n for unit in UNITS.values()])  # (5, n), the rows of a command
        self.lowest = unit * [[np.iinfo(COMMAND_FIELDS[name]).min] for name in UNITS]
        self.highest = unit * [[np.iinfo(COMMAND_FIELDS[name]).max] for name in UNITS]
        self.gain_rounding = 0.5 * unit[2:4]

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        return COMMAND + motor_id, ORDER + motor_id, REPLY + motor_id

    def command(self, values: np.ndarray) -> Frames:
        if not np.isfinite(values).all():
            raise ValueError("a command is not finite")
        content = np.zeros(values.shape[1], COMMAND_FIELDS)
        for (name, unit), row in zip(UNITS.items(), np.clip(values, self.lowest, self.highest), strict=True):
            content[name] = np.rint(row / unit)
        frames = to_every_motor(self._wiring, content.view(np.uint8).reshape(-1, 8))
        return frames._replace(id=COMMAND + frames.id)

    def replies(self, frames: Frames) -> Replies:
        motor = self._lookup[frames.channel, frames.id & 0x7F]
        usable = (frames.id & ~0x7F == REPLY) & (frames.length == 8) & (motor >= 0)
        frames, motor = frames.take(usable), motor[usable]
        content = np.ascontiguousarray(frames.data).view(REPLY_FIELDS).ravel()
        values = np.array([content[name] * UNITS[name] for name in ("position", "velocity", "torque")])
        celsius, no_voltage = content["celsius"].astype(float), np.full(len(motor), np.nan)
        return Replies(motor, values, content["error"], celsius, no_voltage, frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return ERRORS.get(code, f"error {code}")
