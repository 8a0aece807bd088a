"""In-process CAN buses that take as long as real ones: one frame at a time, at 1 Mbit/s, behind queues."""

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.frames import EXTENDED, Frames, frame_bits

NODE_BACKLOG_US = 20_000.0  # a motor or an IMU gives up on a frame that would wait longer

_REMEMBERED = 16  # arrays of channels

_BITS = np.array([[frame_bits(length, extended) for length in range(9)] for extended in (False, True)], float)


class Side(IntEnum):
    """Who sends: the controller, or the motors and the IMU."""

    HOST = 0
    ROBOT = 1


@dataclass
class _Plan:
    """How a batch of given channels, lengths and kinds of identifier follows one another on the wires."""

    channel: np.ndarray  # (k,), and
    length: np.ndarray  # (k,): of the batch that last had this plan
    place: np.ndarray  # (k,) how many frames of the batch are on the same wire up to this one
    offset: np.ndarray  # (k,) microseconds from the start of the batch on its wire to the frame's end
    occupied: list[float]  # microseconds that the batch takes on each wire
    frames: np.ndarray  # (channels,) frames on each wire
    most: int  # frames on the busiest wire
    sent: list[int] = field(default_factory=lambda: [0, 0])  # times that each side sent such a batch


class _Batch:
    """Frames on their way."""

    def __init__(self, frames: Frames, start: list[float], plan: _Plan, last: float) -> None:
        self.frames = frames
        self.last = last  # by then all of them have arrived
        self._start, self._plan = start, plan  # on each wire
        self._arrival: np.ndarray | None = None  # worked out when it is needed, which is seldom

    @property
    def arrival(self) -> np.ndarray:
        """When each frame arrives, (k,)."""
        if self._arrival is None:
            self._arrival = np.array(self._start)[self.frames.channel] + self._plan.offset
        return self._arrival

    def take(self, rows: np.ndarray) -> Frames:
        """Remove the frames at some rows (a mask)."""
        taken = self.frames.take(rows)._replace(time_us=self.arrival[rows])
        self.frames, self._arrival = self.frames.take(~rows), self.arrival[~rows]
        return taken


class SimulatedWires:
    """Several buses. A frame occupies its wire for its bits at 1 Mbit/s, with worst-case stuffing.

    Frames on one wire go in the order in which they were queued. Arbitration gives the same order, since
    the controller's frames have the lower identifiers and a motor answers after it was addressed.
    """

    def __init__(self, names: tuple[str, ...], host_queue: int = HOST_QUEUE) -> None:
        self.names = names
        self._host_queue = host_queue
        self._free_at = [0.0] * len(names)  # when each wire falls idle
        self._all_free_at = 0.0
        self._flying: tuple[deque[_Batch], ...] = (deque(), deque())
        self._plans: dict[tuple[bytes, ...], _Plan] = {}
        self._plan_of_array: dict[int, _Plan] = {}  # by the identity of an array of channels
        self.refused = np.zeros((2, len(names)), dtype=np.int64)

    def send(self, side: Side, frames: Frames, now_us: float) -> int:
        """Queue frames at a time that never runs backwards; returns how many were refused.

        A refused frame is counted and lost, as one that meets ENOBUFS is.
        """
        plan = self._plan(frames)
        refused = 0
        if self._crowded(side, plan, now_us):
            accepted = self._accept(side, frames, plan, now_us)
            refused = int(np.count_nonzero(~accepted))
            if refused:
                np.add.at(self.refused[side], frames.channel[~accepted], 1)
                frames = frames.take(accepted)
                plan = self._plan(frames)
        if len(frames.channel):
            start = [free_at if free_at > now_us else now_us for free_at in self._free_at]
            self._free_at = [begun + taken for begun, taken in zip(start, plan.occupied, strict=True)]
            self._all_free_at = max(self._free_at)
            plan.sent[side] += 1
            self._flying[side].append(_Batch(frames, start, plan, self._all_free_at))
        return refused

    def sent(self, side: Side) -> np.ndarray:
        """Frames that a side has sent on each wire, (channels,)."""
        none = np.zeros(len(self.names), dtype=np.int64)
        return sum((plan.frames * plan.sent[side] for plan in self._plans.values()), none)

    def busy_us(self) -> np.ndarray:
        """How long each wire has been, or will be, occupied by what was sent, (channels,)."""
        none = np.zeros(len(self.names))
        return sum((np.array(plan.occupied) * sum(plan.sent) for plan in self._plans.values()), none)

    def receive(self, side: Side, now_us: float) -> list[Frames]:
        """Frames for `side`, sent by the other one, that have arrived by now; oldest batch first."""
        queue = self._flying[1 - side]
        arrived: list[Frames] = []
        if not queue:
            return arrived
        rest: list[_Batch] = []
        while queue:
            batch = queue.popleft()
            if batch.last <= now_us:
                arrived.append(batch.frames._replace(time_us=batch.arrival))
                continue
            here = batch.arrival <= now_us
            if here.any():
                arrived.append(batch.take(here))
            rest.append(batch)
        queue.extend(rest)
        return arrived

    def _plan(self, frames: Frames) -> _Plan:
        known = self._plan_of_array.get(id(frames.channel))
        if known is not None and known.channel is frames.channel and known.length is frames.length:
            return known  # whoever keeps an array of channels keeps the kind of identifier, too
        extended = frames.id >= EXTENDED
        key = frames.channel.tobytes(), frames.length.tobytes(), extended.tobytes()
        plan = self._plans.get(key)
        if plan is None:
            channel, duration = frames.channel, _BITS[extended.astype(np.intp), frames.length]
            before = np.tril(channel[:, None] == channel[None, :]).astype(float)
            on = (np.arange(len(self.names))[:, None] == channel[None, :]).astype(float)
            count = on.sum(axis=1).astype(np.int64)
            plan = _Plan(
                channel,
                frames.length,
                place=before.sum(axis=1),
                offset=before @ duration,
                occupied=(on @ duration).tolist(),
                frames=count,
                most=int(count.max(initial=0)),
            )
            self._plans[key] = plan
        plan.channel, plan.length = frames.channel, frames.length
        if len(self._plan_of_array) >= _REMEMBERED:
            self._plan_of_array.clear()
        self._plan_of_array[id(frames.channel)] = plan
        return plan

    def _crowded(self, side: Side, plan: _Plan, now_us: float) -> bool:
        """Whether any frame might be refused: a cheap test that is false in ordinary traffic."""
        if side is Side.HOST:
            return self._all_free_at > now_us or plan.most > self._host_queue
        return self._all_free_at > now_us + NODE_BACKLOG_US

    def _accept(self, side: Side, frames: Frames, plan: _Plan, now_us: float) -> np.ndarray:
        """Which frames find a place, (k,) bool."""
        if side is Side.ROBOT:
            return np.array(self._free_at)[frames.channel] <= now_us + NODE_BACKLOG_US
        waiting = np.zeros(len(self.names), dtype=np.int64)
        for batch in self._flying[side]:
            np.add.at(waiting, batch.frames.channel[batch.arrival > now_us], 1)
        return waiting[frames.channel] + plan.place <= self._host_queue
