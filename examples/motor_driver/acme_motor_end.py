"""Simulated motors of acme_driver.py: the far end of the same protocol.

The simulated robot does the physics, the timeouts and the faults. This class decodes the frames that motors
receive and encodes their replies.
"""

import numpy as np
from acme_driver import (
    CLEAR,
    COMMAND,
    COMMAND_FIELDS,
    DISABLE,
    ENABLE,
    ORDER,
    REPLY,
    REPLY_FIELDS,
    UNITS,
    ZERO,
)

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.polled import motor_lookup
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests

ORDERS = {ENABLE: Request.ENABLE, DISABLE: Request.DISABLE, ZERO: Request.ZERO, CLEAR: Request.CLEAR}


class AcmeMotorEnd(PolledMotorEnd):
    """Far end of the protocol, for all its motors at once."""

    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": start, "can_mask": 0x780, "extended": False} for start in (COMMAND, ORDER)
    )
    timeout_error = 3

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._lookup = motor_lookup(wiring)

    def requests(self, frames: Frames) -> Requests:
        usable = np.isin(frames.id & ~0x7F, (COMMAND, ORDER)) & (frames.length == 8)
        motor = np.where(usable, self._lookup[frames.channel, frames.id & 0x7F], -1)
        frames, motor = frames.take(motor >= 0), motor[motor >= 0]
        content = np.ascontiguousarray(frames.data).view(COMMAND_FIELDS).ravel()
        values = np.array([content[name] * UNITS[name] for name in UNITS])
        kinds = np.array(
            [ORDERS.get(first_byte, Request.COMMAND) for first_byte in frames.data[:, 0].tolist()], int
        )
        return Requests(motor, values, np.where(frames.id & ~0x7F == ORDER, kinds, Request.COMMAND))

    def reply(self, motor: Motors, report: Report) -> Frames:
        content = np.zeros(report.values.shape[1], REPLY_FIELDS)
        for name, row in zip(("position", "velocity", "torque"), report.values, strict=True):
            limits = np.iinfo(REPLY_FIELDS[name])
            content[name] = np.clip(np.rint(row / UNITS[name]), limits.min, limits.max)
        content["error"], content["celsius"] = report.error, report.temperature_c
        motor_id, channel = self._wiring.motor_id[motor], self._wiring.channel[motor]
        data = content.view(np.uint8).reshape(-1, 8)
        return Frames(channel, REPLY + motor_id, data, np.full(len(motor_id), 8))
