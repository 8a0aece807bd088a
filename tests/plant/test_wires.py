"""Simulated buses carry what plain ones would."""

from collections import deque

import numpy as np
import pytest

from footfall.deploy.frames import Frames, frame_bits
from footfall.plant.wires import Side, SimulatedWires


class PlainWires:
    """The same rules, a frame at a time."""

    def __init__(self, wires: int, queue: int) -> None:
        self.free = [0.0] * wires
        self.queue = queue
        self.flying: tuple[deque, deque] = deque(), deque()
        self.sent, self.refused = np.zeros((2, wires), int), np.zeros((2, wires), int)
        self.busy = np.zeros(wires)

    def send(self, side: int, frames: list[tuple[int, int, int]], now: float) -> None:
        begun = list(self.free)
        waiting = [sum(w == k and due > now for due, w, _ in self.flying[side]) for k in range(len(begun))]
        for at, length, name in frames:
            waiting[at] += 1
            full = waiting[at] > self.queue if side == 0 else begun[at] > now + 20_000
            if full:
                self.refused[side, at] += 1
                continue
            self.free[at] = max(self.free[at], now) + frame_bits(length)
            self.busy[at] += frame_bits(length)
            self.sent[side, at] += 1
            self.flying[side].append((self.free[at], at, name))

    def receive(self, side: int, now: float) -> list[int]:
        """Names of what arrived."""
        arrived = [name for due, _, name in self.flying[1 - side] if due <= now]
        rest = [item for item in self.flying[1 - side] if item[0] > now]
        self.flying[1 - side].clear()
        self.flying[1 - side].extend(rest)
        return arrived


@pytest.mark.parametrize("seed", range(12))
def test_wires_carry_random_traffic_as_plain_ones_would(seed: int) -> None:
    """Unequal buses and lengths, some batches sent again, both sides, from idle to jammed."""
    rng = np.random.default_rng(seed)
    wires, plain = SimulatedWires(("a", "b", "c"), host_queue=4), PlainWires(3, 4)
    usual = rng.integers(0, 3, 5), rng.integers(0, 9, 5)
    now, name = 0.0, 0
    for _ in range(60):
        now += float(rng.choice([0, 40, 135, 500, 3000]))
        side = Side(int(rng.integers(2)))
        k = int(rng.integers(0, 6 if seed < 9 else 60))
        if rng.random() < 0.4:
            channel, length = usual
        else:
            channel, length = rng.choice([0, 0, 1, 2], k), rng.integers(0, 9, k)
        names = np.arange(name, name + len(channel))
        name += len(channel)
        batch = Frames(channel, names, np.zeros((len(channel), 8), np.uint8), length)
        before = plain.refused.sum()
        lost = wires.send(side, batch, now)
        plain.send(side, list(zip(channel.tolist(), length.tolist(), names.tolist(), strict=True)), now)
        assert lost == plain.refused.sum() - before
        now += float(rng.choice([0, 100, 135, 400]))
        for end in Side:
            arrived = [int(n) for each in wires.receive(end, now) for n in each.id]
            assert sorted(arrived) == sorted(plain.receive(end, now))
    for side in Side:
        np.testing.assert_array_equal(wires.sent(side), plain.sent[side])
        np.testing.assert_array_equal(wires.refused[side], plain.refused[side])
    np.testing.assert_allclose(wires.busy_us(), plain.busy)
    assert plain.sent.sum() > 50
