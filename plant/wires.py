"""In-process CAN buses that take as long as real ones: one frame at a time, at 1 Mbit/s, behind queues."""

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.frames import Frames, frame_bits

NODE_BACKLOG_US = 20_000.0  # a motor or an IMU gives up on a frame that would wait longer

_BITS = np.array([frame_bits(length) for length in range(9)], dtype=float)


class Side(IntEnum):
    """Who sends: the controller, or the motors and the IMU."""

    HOST = 0
    ROBOT = 1


@dataclass
class _Plan:
    """How a batch of given channels and lengths follows one another on the wires."""

    place: np.ndarray  # (k,) how many frames of the batch are on the same wire up to this one
    offset: np.ndarray  # (k,) microseconds from the start of the batch on its wire to the frame's end
    occupied: np.ndarray  # (channels,) microseconds that the batch takes on each wire
    frames: np.ndarray  # (channels,) frames on each wire
    most: int  # frames on the busiest wire
    sent: list[int] = field(default_factory=lambda: [0, 0])  # times that each side sent such a batch


class SimulatedWires:
    """Several buses. A frame occupies its wire for its bits at 1 Mbit/s, with worst-case stuffing.

    Frames on one wire go in the order in which they were queued. Arbitration gives the same order, since
    the controller's frames have the lower identifiers and a motor answers after it was addressed.
    """

    def __init__(self, names: tuple[str, ...], host_queue: int = HOST_QUEUE) -> None:
        self.names = names
        self._host_queue = host_queue
        self._free_at = np.zeros(len(names))  # when each wire falls idle
        self._all_free_at = 0.0
        self._flying: tuple[deque[tuple[Frames, np.ndarray, float]], ...] = (deque(), deque())
        self._plans: dict[tuple[bytes, bytes], _Plan] = {}
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
            start = np.maximum(self._free_at, now_us)
            arrival = start[frames.channel] + plan.offset
            self._free_at = start + plan.occupied
            self._all_free_at = float(self._free_at.max())
            plan.sent[side] += 1
            self._flying[side].append((frames, arrival, self._all_free_at))
        return refused

    def sent(self, side: Side) -> np.ndarray:
        """Frames that a side has sent on each wire, (channels,)."""
        none = np.zeros(len(self.names), dtype=np.int64)
        return sum((plan.frames * plan.sent[side] for plan in self._plans.values()), none)

    def busy_us(self) -> np.ndarray:
        """How long each wire has been, or will be, occupied by what was sent, (channels,)."""
        none = np.zeros(len(self.names))
        return sum((plan.occupied * sum(plan.sent) for plan in self._plans.values()), none)

    def receive(self, side: Side, now_us: float) -> list[Frames]:
        """Frames for `side`, sent by the other one, that have arrived by now; oldest batch first."""
        queue = self._flying[1 - side]
        arrived: list[Frames] = []
        rest: list[tuple[Frames, np.ndarray, float]] = []
        while queue:
            frames, arrival, last = queue.popleft()
            if last <= now_us:
                arrived.append(frames)
                continue
            here = arrival <= now_us
            if here.any():
                arrived.append(frames.take(here))
                frames, arrival = frames.take(~here), arrival[~here]
            rest.append((frames, arrival, last))
        queue.extend(rest)
        return arrived

    def _plan(self, frames: Frames) -> _Plan:
        key = frames.channel.tobytes(), frames.length.tobytes()
        plan = self._plans.get(key)
        if plan is None:
            channel, duration = frames.channel, _BITS[frames.length]
            before = np.tril(channel[:, None] == channel[None, :]).astype(float)
            on = (np.arange(len(self.names))[:, None] == channel[None, :]).astype(float)
            count = on.sum(axis=1).astype(np.int64)
            plan = _Plan(
                place=before.sum(axis=1),
                offset=before @ duration,
                occupied=on @ duration,
                frames=count,
                most=int(count.max(initial=0)),
            )
            self._plans[key] = plan
        return plan

    def _crowded(self, side: Side, plan: _Plan, now_us: float) -> bool:
        """Whether any frame might be refused: a cheap test that is false in ordinary traffic."""
        if side is Side.HOST:
            return self._all_free_at > now_us or plan.most > self._host_queue
        return self._all_free_at > now_us + NODE_BACKLOG_US

    def _accept(self, side: Side, frames: Frames, plan: _Plan, now_us: float) -> np.ndarray:
        """Which frames find a place, (k,) bool."""
        if side is Side.ROBOT:
            return self._free_at[frames.channel] <= now_us + NODE_BACKLOG_US
        waiting = np.zeros(len(self.names), dtype=np.int64)
        for queued, arrival, _ in self._flying[side]:
            np.add.at(waiting, queued.channel[arrival > now_us], 1)
        return waiting[frames.channel] + plan.place <= self._host_queue
