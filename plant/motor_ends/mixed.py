"""Motors of several protocols on one robot."""

from collections.abc import Sequence

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.frames import Frames, joined, takes_fd
from footfall.plant.motor_ends.motor_end import MotorEnd, Report, Request, Requests

Joints = np.ndarray  # indices


class MixedMotorEnd:
    """Simulated motors of several protocols."""

    def __init__(self, parts: Sequence[tuple[MotorEnd, Joints]]) -> None:
        """`parts` are the motors' ends of the protocols, each with its joints; every joint occurs once."""
        self._parts = parts
        self.filters: tuple[CanFilter, ...] = tuple(each for end, _ in parts for each in end.filters)
        n = sum(len(joints) for _, joints in parts)
        self.broadcasts = any(end.broadcasts for end, _ in parts)
        self.timeout_error: np.ndarray = np.zeros(n, np.uint64)
        self.timeout_latches: np.ndarray = np.zeros(n, bool)
        for end, joints in parts:
            self.timeout_error[joints] = end.timeout_error
            self.timeout_latches[joints] = end.timeout_latches
        self._joints = np.arange(n)
        self._part_of, self._row_in_part = np.zeros(n, np.intp), np.zeros(n, np.intp)
        for part, (_, joints) in enumerate(parts):
            self._part_of[joints], self._row_in_part[joints] = part, np.arange(len(joints))

    @property
    def timeout_s(self) -> np.ndarray:
        timeout_s = np.full(len(self._row_in_part), np.nan)
        for end, joints in self._parts:
            timeout_s[joints] = end.timeout_s
        return timeout_s

    def requests(self, frames: Frames) -> Requests:
        parts = [(end.requests(_receivable(end, frames)), joints) for end, joints in self._parts]
        kinds = [
            np.full(requests.values.shape[1], Request.COMMAND) if requests.kind is None else requests.kind
            for requests, _ in parts
        ]
        return Requests(
            np.concatenate([joints[requests.motor] for requests, joints in parts]),
            np.concatenate([requests.values for requests, _ in parts], axis=1),
            None if all(requests.kind is None for requests, _ in parts) else np.concatenate(kinds),
        )

    def settings_replies(self, frames: Frames) -> Frames | None:
        return _joined([end.settings_replies(_receivable(end, frames)) for end, _ in self._parts])

    def reply(self, motor: Motors, report: Report) -> Frames:
        """See `MotorEnd.reply`. Frames are grouped by protocol."""
        motor = self._joints[motor]
        batches = []
        for part, (end, _) in enumerate(self._parts):
            rows = np.flatnonzero(self._part_of[motor] == part)
            batches.append(end.reply(self._row_in_part[motor[rows]], report.take(rows)))
        return joined(batches)

    def broadcast(self, now_us: int, connected: np.ndarray, report: Report) -> Frames | None:
        return _joined(
            [
                end.broadcast(now_us, connected[joints], report.take(joints))
                for end, joints in self._parts
                if end.broadcasts
            ]
        )


def _receivable(end: MotorEnd, frames: Frames) -> Frames:
    """The frames that these motors can receive: CAN FD frames only if they have a CAN FD controller."""
    return frames if takes_fd(end.filters) else frames.can_frames()


def _joined(batches: Sequence[Frames | None]) -> Frames | None:
    """The batches that are not None, joined into one; None if all are None."""
    existing = [frames for frames in batches if frames is not None]
    return joined(existing) if existing else None
