"""In-process CAN buses with realistic timing: one frame at a time, at 1 Mbit/s, behind queues."""

import math
from collections import deque
from enum import IntEnum
from operator import add
from typing import NamedTuple

import numpy as np

from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.frames import Frames, Layout, bits_of, layout_of
from footfall.plant.wire_faults import ERROR_BITS, FaultyWires, WireFaults
from footfall.plant.wire_plan import Plan, planned, precedence

NODE_BACKLOG_US = 20_000.0  # a motor or an IMU drops a frame that would wait longer
MAX_PLANS = 64  # maximum number kept: layouts never repeat if identifiers contain values

_NOT_KNOWN = np.zeros(0)


class Side(IntEnum):
    """The sender: the controller, or the motors and the IMU."""

    HOST = 0
    ROBOT = 1


class _Batch:
    """Frames on their way."""

    __slots__ = ("_arrival", "_offset", "_start", "bits", "frames", "last")

    def __init__(self, frames: Frames, start: float | list[float], offset: np.ndarray, last: float) -> None:
        self.frames = frames
        self.last = last  # when all frames have arrived, or later if another wire is busy for longer
        self._start = start  # of the batch, on all wires or on each
        self._offset = offset  # (k,) from the start on its wire to each frame's arrival
        self._arrival: np.ndarray | None = None  # computed on demand
        self.bits: np.ndarray = _NOT_KNOWN  # (k,) of each frame on its wire, repetitions included

    @property
    def arrival(self) -> np.ndarray:
        """Arrival time of each frame, us, (k,)."""
        if self._arrival is None:
            start = self._start
            begun = np.array(start)  # adding an array takes less time than adding a number
            if isinstance(start, list):
                begun = begun[self.frames.channel]
            self._arrival = begun + self._offset
        return self._arrival

    def take(self, rows: np.ndarray) -> Frames:
        """Remove and return the frames at some rows (a mask)."""
        taken = self.frames.take(rows).at(self.arrival[rows])
        self.frames, self._arrival = self.frames.take(~rows), self.arrival[~rows]
        if self.bits is not _NOT_KNOWN:
            self.bits = self.bits[~rows]
        return taken

    def set_arrival(self, arrival: np.ndarray) -> None:
        """Set the arrival time of each frame, us, (k,)."""
        self._arrival, self.last = arrival, float(arrival.max())


class SimulatedWires:
    """Several buses. A frame occupies its wire for its bits at 1 Mbit/s, worst-case stuffing included.

    If several nodes have a frame to send when a wire becomes idle, the lowest identifier wins. The host
    offers only the frame at the head of its queue; each motor, and the IMU, is a node of its own. Ordinary
    traffic is in that order already, so the order is computed only if a batch would overtake others.
    """

    def __init__(
        self, names: tuple[str, ...], host_queue: int = HOST_QUEUE, faults: WireFaults | None = None
    ) -> None:
        self.names = names
        self.set_faults(faults)
        self._host_queue = host_queue
        self._free_at = [0.0] * len(names)  # times at which wires become idle
        self._all_free_at = 0.0
        self._repeated_us = np.zeros(len(names))  # time of errors and of repeated frames
        self._last_waiting = [0.0] * len(names)  # highest precedence number since each wire was idle
        self._in_transit: tuple[deque[_Batch], ...] = (deque(), deque())
        self._plans: dict[Layout, Plan] = {}  # computing a plan takes 100 us
        self._sent = np.zeros((2, len(names)), dtype=np.int64)  # frames of deleted plans, for each side
        self._busy_us = np.zeros(len(names))  # time that the frames of deleted plans took
        self.refused = np.zeros((2, len(names)), dtype=np.int64)

    def send(self, side: Side, frames: Frames, now_us: float) -> int:
        """Queue frames; returns the number of refused frames. `now_us` must not decrease between calls.

        A refused frame is counted and lost, as with ENOBUFS.
        """
        refused = 0
        if self._faulty is not None:
            working = self._faulty.working(frames.channel)
            if side is Side.HOST:
                self._faulty.count_unacknowledged(frames.channel)
            frames = frames.take(working)
        plan = self._plan(frames)
        if self._crowded(side, plan, now_us):
            accepted = self._accept(side, frames, plan, now_us)
            refused = int(np.count_nonzero(~accepted))
            if refused:
                np.add.at(self.refused[side], frames.channel[~accepted], 1)
                frames = frames.take(accepted)
                plan = self._plan(frames)
        if len(frames.channel):
            overtaken = self._overtaken(side, plan, now_us)
            start = self._occupy(plan, now_us)
            plan.sent[side] += 1
            batch = _Batch(frames, start, plan.offset, self._all_free_at)
            self._in_transit[side].append(batch)
            if self._faulty is not None:
                self._repeat(side, batch)
            for wire in overtaken:
                self._arbitrate(wire, now_us)
        return refused

    def set_faults(self, faults: WireFaults | None) -> None:
        """Inject these faults from now on; None: no faults."""
        self._faulty = None if faults is None else FaultyWires(faults, len(self.names))

    def fault(self) -> str:
        """First bus that fails for the controller, and why; empty if all work."""
        return "" if self._faulty is None else self._faulty.fault(self.names)

    def _occupy(self, plan: Plan, now_us: float) -> float | list[float]:
        """Occupy wires with a batch; returns its start, for all wires or for each."""
        if self._all_free_at <= now_us:  # the usual case
            self._free_at = [now_us + taken for taken in plan.occupied]
            self._all_free_at = now_us + plan.longest
            return now_us
        start = [free_at if free_at > now_us else now_us for free_at in self._free_at]
        self._free_at = list(map(add, start, plan.occupied))
        self._all_free_at = max(self._free_at)
        same = start.count(start[0]) == len(start)  # usually: all wires carry as many frames
        return start[0] if same else start

    def _overtaken(self, side: Side, plan: Plan, now_us: float) -> list[int]:
        """Wires on which a frame of a new batch precedes a queued one."""
        overtaken: list[int] = []
        if self._all_free_at <= now_us:
            self._last_waiting = plan.last
        else:
            last_before = self._last_waiting
            self._last_waiting = plan.last.copy()
            for wire, free_at in enumerate(self._free_at):
                if free_at > now_us:
                    last = last_before[wire]
                    if plan.first[wire] < last:
                        overtaken.append(wire)
                    if last > plan.last[wire]:
                        self._last_waiting[wire] = last
        # Nodes of the robot send in parallel, so their frames need arbitration among themselves.
        return overtaken if plan.orderly or side is Side.HOST else plan.wires

    def _repeat(self, side: Side, batch: _Batch) -> None:
        """Delay a batch by transmissions that errors destroy and that are repeated."""
        assert self._faulty is not None
        frames = batch.frames
        repetitions = self._faulty.repetitions(frames.channel, side is Side.HOST)
        if not repetitions.any():
            return
        batch.bits, arrival = bits_of(frames), batch.arrival.copy()
        extra_us = repetitions * (batch.bits + ERROR_BITS)  # a bit takes 1 us
        batch.bits = batch.bits + extra_us
        for wire in range(len(self.names)):
            on_wire = frames.channel == wire
            arrival[on_wire] += np.cumsum(extra_us[on_wire])
            repeated_us = float(extra_us[on_wire].sum())
            self._free_at[wire] += repeated_us
            self._repeated_us[wire] += repeated_us
        batch.set_arrival(arrival)
        self._all_free_at = max(self._free_at)

    def _arbitrate(self, wire: int, now_us: float) -> None:
        """Order by arbitration the frames on a wire whose transmission has not begun."""
        host_frames: list[_Waiting] = []  # the controller's, first in, first out
        other_nodes: list[_Waiting] = []  # of other nodes, sorted by precedence
        begin_us = math.inf
        for side, waiting in ((Side.HOST, host_frames), (Side.ROBOT, other_nodes)):
            for batch in self._in_transit[side]:
                if batch.last <= now_us:  # all its frames have arrived
                    continue
                if batch.bits is _NOT_KNOWN:
                    batch.bits = bits_of(batch.frames)
                start = batch.arrival - batch.bits
                rows = np.flatnonzero((batch.frames.channel == wire) & (start >= now_us - 1e-6))
                if not len(rows):
                    continue
                begin_us = min(begin_us, float(start[rows].min()))
                order = precedence(batch.frames.id[rows]).tolist()
                waiting += [
                    _Waiting(*each) for each in zip(order, [batch] * len(rows), rows.tolist(), strict=True)
                ]
        other_nodes.sort(key=lambda each: each.order)
        at_us, host_queue, other_queue = begin_us, deque(host_frames), deque(other_nodes)
        arrivals: dict[_Batch, np.ndarray] = {}
        while host_queue or other_queue:
            host_wins = bool(host_queue) and (not other_queue or host_queue[0].order <= other_queue[0].order)
            _, batch, row = (host_queue if host_wins else other_queue).popleft()
            at_us += float(batch.bits[row])
            if batch not in arrivals:
                arrivals[batch] = batch.arrival.copy()
            arrivals[batch][row] = at_us
        for batch, arrival in arrivals.items():
            batch.set_arrival(arrival)

    def sent(self, side: Side) -> np.ndarray:
        """Frames that a side has sent on each wire, (channels,)."""
        return sum((plan.frames * plan.sent[side] for plan in self._plans.values()), self._sent[side].copy())

    def busy_us(self) -> np.ndarray:
        """Time that all frames so far occupy each wire, us, (channels,)."""
        earlier = self._busy_us + self._repeated_us
        return sum((np.array(plan.occupied) * sum(plan.sent) for plan in self._plans.values()), earlier)

    def receive(self, side: Side, now_us: float) -> list[Frames]:
        """Frames for `side`, sent by the other one, that have arrived by now; oldest batch first."""
        queue = self._in_transit[1 - side]
        arrived: list[Frames] = []
        if not queue:
            return arrived
        undelivered: list[_Batch] = []
        while queue:
            batch = queue.popleft()
            if batch.last <= now_us:
                frames = batch.frames
                arrived.append(frames.at(batch.arrival) if side is Side.HOST else frames)
                continue
            arrived_now = batch.arrival <= now_us
            if arrived_now.any():
                arrived.append(batch.take(arrived_now))
            undelivered.append(batch)
        queue.extend(undelivered)
        return arrived if self._faulty is None else [self._faulty.deliver(frames) for frames in arrived]

    def _plan(self, frames: Frames) -> Plan:
        key = layout_of(frames)
        plan = self._plans.get(key)
        if plan is None:
            if len(self._plans) >= MAX_PLANS:
                self._drop_plans()
            plan = self._plans[key] = planned(frames, len(self.names))
        return plan

    def _drop_plans(self) -> None:
        """Delete all plans, keeping their totals."""
        for side in Side:
            self._sent[side] = self.sent(side)
        self._busy_us = self.busy_us() - self._repeated_us
        self._plans.clear()

    def _crowded(self, side: Side, plan: Plan, now_us: float) -> bool:
        """Whether a frame might be refused: a fast test that is false in ordinary traffic."""
        if side is Side.HOST:
            return self._all_free_at > now_us or plan.max_frames > self._host_queue
        return self._all_free_at > now_us + NODE_BACKLOG_US

    def _accept(self, side: Side, frames: Frames, plan: Plan, now_us: float) -> np.ndarray:
        """Mask of the frames that fit into a queue, (k,)."""
        if side is Side.ROBOT:
            return np.array(self._free_at)[frames.channel] <= now_us + NODE_BACKLOG_US
        queued = np.zeros(len(self.names), dtype=np.int64)  # frames on each wire
        for batch in self._in_transit[side]:
            np.add.at(queued, batch.frames.channel[batch.arrival > now_us], 1)
        return queued[frames.channel] + plan.position <= self._host_queue


class _Waiting(NamedTuple):
    """A frame whose transmission has not begun."""

    order: float  # precedence number
    batch: _Batch
    row: int
