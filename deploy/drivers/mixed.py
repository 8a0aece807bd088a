"""Driver of a robot with several motor protocols: each part has its own joints."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Driver, Replies
from footfall.deploy.frames import Frames, joined, no_frames, takes_fd

Joints = np.ndarray  # indices


class MixedDriver:
    """Combines several drivers."""

    def __init__(self, parts: Sequence[tuple[Driver, Joints]]) -> None:
        """`parts` are drivers with their joints; each joint belongs to one driver."""
        self._parts = parts
        self._n = sum(len(joints) for _, joints in parts)
        self.filters: tuple[CanFilter, ...] = tuple(each for driver, _ in parts for each in driver.filters)
        self.answers_each_frame = all(getattr(driver, "answers_each_frame", False) for driver, _ in parts)
        self.exchange_bits = self._by_joint((), lambda driver: driver.exchange_bits)

    def _by_joint(self, rows: tuple[int, ...], read: Callable[[Driver], np.ndarray]) -> np.ndarray:
        """Values of all drivers by joint, (*rows, n)."""
        values = [read(driver) for driver, _ in self._parts]
        result = np.zeros((*rows, self._n), values[0].dtype)
        for part, (_, joints) in zip(values, self._parts, strict=True):
            result[..., joints] = part
        return result

    def _joined(self, frames: Callable[[Driver], Frames]) -> Frames:
        return joined([frames(driver) for driver, _ in self._parts])

    @property
    def lowest(self) -> np.ndarray:
        return self._by_joint((5,), lambda driver: driver.lowest)

    @property
    def highest(self) -> np.ndarray:
        return self._by_joint((5,), lambda driver: driver.highest)

    @property
    def gain_rounding(self) -> np.ndarray:
        return self._by_joint((2,), lambda driver: driver.gain_rounding)

    def query_settings(self) -> Frames:
        queries = [driver.query_settings() for driver, _ in self._parts if driver.not_ready()]
        return joined(queries) if queries else no_frames()

    def not_ready(self) -> str:
        return next(filter(None, (driver.not_ready() for driver, _ in self._parts)), "")

    def enable(self) -> Frames:
        return self._joined(lambda driver: driver.enable())

    def not_enabled(self) -> str:
        return next(filter(None, (driver.not_enabled() for driver, _ in self._parts)), "")

    def disable(self) -> Frames:
        return self._joined(lambda driver: driver.disable())

    def not_confirmed_off(self) -> np.ndarray:
        return self._by_joint((), lambda driver: driver.not_confirmed_off())

    def clear(self) -> Frames:
        return self._joined(lambda driver: driver.clear())

    def zero(self) -> Frames:
        return self._joined(lambda driver: driver.zero())

    def command(self, values: np.ndarray) -> Frames:
        return joined([driver.command(values[:, joints]) for driver, joints in self._parts])

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        batches = [driver.damping(kd[joints]) for driver, joints in self._parts]
        turns = math.lcm(*map(len, batches))
        return tuple(joined([each[turn % len(each)] for each in batches]) for turn in range(turns))

    def replies(self, frames: Frames) -> Replies:
        classic = frames.can_frames()
        parts = [
            (driver.replies(frames if takes_fd(driver.filters) else classic), joints)
            for driver, joints in self._parts
        ]
        times = [replies.time_us for replies, _ in parts if replies.time_us is not None]
        return Replies(
            motor=np.concatenate([joints[replies.motor] for replies, joints in parts]),
            values=np.concatenate([replies.values for replies, _ in parts], axis=1),
            error=np.concatenate([replies.error for replies, _ in parts]),
            temperature_c=np.concatenate([replies.temperature_c for replies, _ in parts]),
            voltage=np.concatenate([replies.voltage for replies, _ in parts]),
            time_us=np.concatenate(times) if len(times) == len(parts) else None,
            current_a=np.concatenate([_current(replies) for replies, _ in parts]),
        )

    def error_name(self, code: int, joint: int = 0) -> str:
        for driver, joints in self._parts:
            if joint in joints:
                return driver.error_name(code, int(np.flatnonzero(joints == joint)[0]))
        raise ValueError(f"no joint {joint}")


def _current(replies: Replies) -> np.ndarray:
    """Current of each motor, A; NaN if not reported."""
    return np.full(len(replies.error), np.nan) if replies.current_a is None else replies.current_a
