"""A robot with motors of several protocols: each speaks to its own joints."""

from collections.abc import Callable, Sequence

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Driver, MotorEnd, Motors, Replies, Request, Requests
from footfall.deploy.frames import Frames

Joints = np.ndarray  # indices


def _joined(batches: Sequence[Frames]) -> Frames:
    return Frames(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


class MixedDriver:
    """The controller's end."""

    def __init__(self, parts: Sequence[tuple[Driver, Joints]]) -> None:
        """`parts` are drivers, each with the joints that it speaks to: every joint once."""
        self._parts = parts
        self._n = sum(len(joints) for _, joints in parts)
        self._part_of = {int(j): (driver, i) for driver, joints in parts for i, j in enumerate(joints)}
        self.filters: tuple[CanFilter, ...] = tuple(each for driver, _ in parts for each in driver.filters)
        self._read_ranges()
        self._outgoing = self._from_all(lambda driver: driver.enable())

    def _read_ranges(self) -> None:
        self.lowest, self.highest = np.zeros((5, self._n)), np.zeros((5, self._n))
        for driver, joints in self._parts:
            self.lowest[:, joints], self.highest[:, joints] = driver.lowest, driver.highest

    def _from_all(self, frames: Callable[[Driver], Frames]) -> Frames:
        return _joined([frames(driver) for driver, _ in self._parts])

    def ask(self) -> Frames:
        return _joined([driver.ask() for driver, _ in self._parts if driver.unready()])

    def unready(self) -> str:
        reason = next(filter(None, (driver.unready() for driver, _ in self._parts)), "")
        if not reason:
            self._read_ranges()  # which motors may have told
        return reason

    def enable(self) -> Frames:
        return self._from_all(lambda driver: driver.enable())

    def disable(self) -> Frames:
        return self._from_all(lambda driver: driver.disable())

    def command(self, values: np.ndarray) -> Frames:
        batches = [driver.command(values[:, joints]) for driver, joints in self._parts]
        identifier = np.concatenate([frames.id for frames in batches])
        data = np.concatenate([frames.data for frames in batches])
        return self._outgoing._replace(id=identifier, data=data)  # the same channels and lengths each time

    def replies(self, frames: Frames) -> Replies:
        parts = [(driver.replies(frames), joints) for driver, joints in self._parts]
        return Replies(
            np.concatenate([joints[replies.motor] for replies, joints in parts]),
            np.concatenate([replies.values for replies, _ in parts], axis=1),
            np.concatenate([replies.temperature_c for replies, _ in parts]),
            np.concatenate([replies.error for replies, _ in parts]),
        )

    def error_name(self, code: int, joint: int = 0) -> str:
        driver, own = self._part_of[joint]
        return driver.error_name(code, own)


class MixedMotorEnd:
    """The motors' end."""

    def __init__(self, parts: Sequence[tuple[MotorEnd, Joints]]) -> None:
        """`parts` are motors' ends, each with its joints: every joint once."""
        self._parts = parts
        self.filters: tuple[CanFilter, ...] = tuple(each for end, _ in parts for each in end.filters)
        self.time_out_error = parts[0][0].time_out_error
        n = sum(len(joints) for _, joints in parts)
        self._everyone = np.arange(n)
        self._part_of, self._own = np.zeros(n, np.intp), np.zeros(n, np.intp)
        for part, (_, joints) in enumerate(parts):
            self._part_of[joints], self._own[joints] = part, np.arange(len(joints))

    def requests(self, frames: Frames) -> Requests:
        parts = [(end.requests(frames), joints) for end, joints in self._parts]
        kinds = [
            np.full(requests.values.shape[1], Request.COMMAND) if requests.kind is None else requests.kind
            for requests, _ in parts
        ]
        return Requests(
            np.concatenate([joints[requests.motor] for requests, joints in parts]),
            np.concatenate([requests.values for requests, _ in parts], axis=1),
            None if all(requests.kind is None for requests, _ in parts) else np.concatenate(kinds),
        )

    def tell(self, frames: Frames) -> Frames | None:
        told = [answer for end, _ in self._parts if (answer := end.tell(frames)) is not None]
        return _joined(told) if told else None

    def reply(
        self,
        motor: Motors,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray | None = None,
    ) -> Frames:
        """As `MotorEnd.reply`; frames come in the order of the motors if these are grouped by protocol."""
        motor = self._everyone[motor]
        batches = []
        for part, (end, _) in enumerate(self._parts):
            rows = np.flatnonzero(self._part_of[motor] == part)
            those = None if on is None else on[rows]
            batches.append(
                end.reply(self._own[motor[rows]], values[:, rows], temperature_c, error[rows], those)
            )
        return _joined(batches)
