"""A robot with motors of several protocols: each speaks to its own joints."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Driver, Replies
from footfall.deploy.frames import Frames, joined

Joints = np.ndarray  # indices


class MixedDriver:
    """The controller's end."""

    def __init__(self, parts: Sequence[tuple[Driver, Joints]]) -> None:
        """`parts` are drivers, each with the joints that it speaks to: every joint once."""
        self._parts = parts
        self._n = sum(len(joints) for _, joints in parts)
        self._part_of = {int(j): (driver, i) for driver, joints in parts for i, j in enumerate(joints)}
        self.filters: tuple[CanFilter, ...] = tuple(each for driver, _ in parts for each in driver.filters)
        self._read_ranges()
        self.exchange_bits = np.zeros(self._n, np.intp)
        for driver, joints in parts:
            self.exchange_bits[joints] = driver.exchange_bits
        batches = [driver.command(np.zeros((5, len(joints)))) for driver, joints in parts]
        self._outgoing = joined(batches)

    def _read_ranges(self) -> None:
        self.lowest, self.highest = np.zeros((5, self._n)), np.zeros((5, self._n))
        self.gain_rounding = np.zeros((2, self._n))
        for driver, joints in self._parts:
            self.lowest[:, joints], self.highest[:, joints] = driver.lowest, driver.highest
            self.gain_rounding[:, joints] = driver.gain_rounding

    def _from_all(self, frames: Callable[[Driver], Frames]) -> Frames:
        return joined([frames(driver) for driver, _ in self._parts])

    def query_settings(self) -> Frames:
        return joined([driver.query_settings() for driver, _ in self._parts if driver.not_ready()])

    def not_ready(self) -> str:
        reason = next(filter(None, (driver.not_ready() for driver, _ in self._parts)), "")
        if not reason:
            self._read_ranges()  # which motors may have told
        return reason

    def enable(self) -> Frames:
        return self._from_all(lambda driver: driver.enable())

    def not_enabled(self) -> str:
        return next(filter(None, (driver.not_enabled() for driver, _ in self._parts)), "")

    def disable(self) -> Frames:
        return self._from_all(lambda driver: driver.disable())

    def not_confirmed_off(self) -> np.ndarray:
        on = np.zeros(self._n, bool)
        for driver, joints in self._parts:
            on[joints] = driver.not_confirmed_off()
        return on

    def clear(self) -> Frames:
        return self._from_all(lambda driver: driver.clear())

    def zero(self) -> Frames:
        return self._from_all(lambda driver: driver.zero())

    def command(self, values: np.ndarray) -> Frames:
        batches = [driver.command(values[:, joints]) for driver, joints in self._parts]
        identifier = np.concatenate([frames.id for frames in batches])
        data = np.concatenate([frames.data for frames in batches])
        return self._outgoing._replace(id=identifier, data=data)  # the same channels and lengths each time

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        batches = [driver.damping(kd[joints]) for driver, joints in self._parts]
        turns = math.lcm(*map(len, batches))
        return tuple(joined([each[turn % len(each)] for each in batches]) for turn in range(turns))

    def replies(self, frames: Frames) -> Replies:
        parts = [(driver.replies(frames), joints) for driver, joints in self._parts]
        times = [replies.time_us for replies, _ in parts if replies.time_us is not None]
        return Replies(
            motor=np.concatenate([joints[replies.motor] for replies, joints in parts]),
            values=np.concatenate([replies.values for replies, _ in parts], axis=1),
            error=np.concatenate([replies.error for replies, _ in parts]),
            temperature_c=np.concatenate([replies.temperature_c for replies, _ in parts]),
            voltage=np.concatenate([replies.voltage for replies, _ in parts]),
            time_us=np.concatenate(times) if len(times) == len(parts) else None,
        )

    def error_name(self, code: int, joint: int = 0) -> str:
        driver, own = self._part_of[joint]
        return driver.error_name(code, own)
