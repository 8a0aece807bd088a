"""Simulated wires take their time, keep order, and refuse what does not fit their queues."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.frames import EXTENDED, Frames, frame_bits
from footfall.plant.bus import SimulatedBus
from footfall.plant.wires import Side, SimulatedWires


def frames(*channels: int, length: int = 8) -> Frames:
    k = len(channels)
    data = np.zeros((k, 8), np.uint8)
    data[:, 0] = np.arange(k)
    return Frames(np.array(channels), np.arange(1, k + 1), data, np.full(k, length))


def numbers(batches: list[Frames]) -> list[int]:
    return [int(n) for batch in batches for n in batch.data[:, 0]]


class TestFrameBits:
    @pytest.mark.parametrize(
        ("length", "extended", "stuffed", "bits"),
        [
            (8, False, False, 111),
            (8, False, True, 135),
            (8, True, False, 131),
            (8, True, True, 160),
            (0, False, True, 55),  # 34 bits that may be stuffed: at most 8 more
            (3, False, True, 85),  # 58: 14 more, the first after five
            (7, True, True, 150),
            (0, True, False, 67),
        ],
    )
    def test_known_figures(self, length: int, extended: bool, stuffed: bool, bits: int) -> None:
        assert frame_bits(length, extended, stuffed) == bits

    def test_a_frame_counts_its_most_stuff_bits_unless_told_otherwise(self) -> None:
        """Shorthand of ISO 11898: 47 + 8 n + floor((34 + 8 n - 1) / 4), and 67 and 54 with 29 bits."""
        for length in range(9):
            assert frame_bits(length) == 47 + 8 * length + math.floor((33 + 8 * length) / 4)
            assert frame_bits(length, True) == 67 + 8 * length + math.floor((53 + 8 * length) / 4)

    def test_twelve_motors_at_500_hz_need_two_buses(self) -> None:
        exchange_us = 2 * frame_bits(8)
        assert 6 * exchange_us * 500 / 1e6 == pytest.approx(0.81)


class TestTime:
    def test_a_frame_arrives_when_its_last_bit_does(self) -> None:
        wires = SimulatedWires(("a",))
        wires.send(Side.HOST, frames(0), 1000)
        assert wires.receive(Side.ROBOT, 1134) == []
        assert numbers(wires.receive(Side.ROBOT, 1135)) == [0]

    def test_frames_on_one_wire_follow_one_another_and_wires_work_in_parallel(self) -> None:
        wires = SimulatedWires(("a", "b"))
        wires.send(Side.HOST, frames(0, 0, 1), 0)
        assert numbers(wires.receive(Side.ROBOT, 135)) == [0, 2]
        assert numbers(wires.receive(Side.ROBOT, 269)) == []
        assert numbers(wires.receive(Side.ROBOT, 270)) == [1]

    def test_replies_wait_for_commands_that_are_already_queued(self) -> None:
        wires = SimulatedWires(("a",))
        wires.send(Side.HOST, frames(0, 0, 0), 0)
        wires.send(Side.ROBOT, frames(0), 135)
        assert numbers(wires.receive(Side.HOST, 4 * 135 - 1)) == []
        assert numbers(wires.receive(Side.HOST, 4 * 135)) == [0]

    def test_short_frames_take_less_time(self) -> None:
        wires = SimulatedWires(("a",))
        wires.send(Side.HOST, frames(0, length=0), 0)
        assert numbers(wires.receive(Side.ROBOT, frame_bits(0))) == [0]

    def test_frames_with_29_bits_take_longer(self) -> None:
        """160 us with the most stuff bits, 135 with 11 bits; also where both kinds follow one another."""
        wires = SimulatedWires(("a",))
        plain, extended = frames(0), frames(0)
        extended.id[:] |= EXTENDED
        wires.send(Side.HOST, extended, 0)
        assert wires.receive(Side.ROBOT, 159) == []
        assert wires.receive(Side.ROBOT, 160)[0].id.tolist() == [EXTENDED | 1]
        wires.send(Side.HOST, plain, 1000)
        assert wires.receive(Side.ROBOT, 1134) == []
        assert wires.receive(Side.ROBOT, 1135)[0].id.tolist() == [1]

    def test_nobody_hears_what_they_sent_themselves(self) -> None:
        wires = SimulatedWires(("a",))
        wires.send(Side.HOST, frames(0), 0)
        assert wires.receive(Side.HOST, 10_000) == []

    def test_load_is_the_share_of_busy_time(self) -> None:
        wires = SimulatedWires(("a", "b"))
        for tick in range(10):
            wires.send(Side.HOST, frames(0, 0, 0), tick * 2000)
        assert wires.busy_us().tolist() == [10 * 3 * 135, 0]


class TestQueue:
    def test_a_batch_longer_than_the_queue_loses_its_tail(self) -> None:
        wires = SimulatedWires(("a",))
        assert wires.send(Side.HOST, frames(*[0] * (HOST_QUEUE + 2)), 0) == 2
        assert wires.refused[Side.HOST].tolist() == [2]
        assert numbers(wires.receive(Side.ROBOT, 10**6)) == list(range(HOST_QUEUE))

    def test_room_appears_as_frames_leave(self) -> None:
        wires = SimulatedWires(("a",))
        wires.send(Side.HOST, frames(*[0] * HOST_QUEUE), 0)
        assert wires.send(Side.HOST, frames(0), 100) == 1
        assert wires.send(Side.HOST, frames(0), 136) == 0

    def test_a_full_queue_of_one_bus_does_not_touch_another(self) -> None:
        wires = SimulatedWires(("a", "b"))
        wires.send(Side.HOST, frames(*[0] * HOST_QUEUE), 0)
        assert wires.send(Side.HOST, frames(0, 1), 0) == 1
        assert wires.refused[Side.HOST].tolist() == [1, 0]

    def test_eighteen_motors_on_one_bus_at_500_hz_overflow_and_on_three_do_not(self) -> None:
        def refused(buses: int) -> int:
            wires = SimulatedWires(tuple("abc")[:buses], host_queue=18)
            channels = [i % buses for i in range(18)]
            lost = 0
            for tick in range(50):
                lost += wires.send(Side.HOST, frames(*channels), tick * 2000)
                wires.send(Side.ROBOT, frames(*channels), tick * 2000 + 135)
            return lost

        assert refused(1) > 0
        assert refused(3) == 0

    def test_motors_on_a_jammed_bus_give_up_rather_than_queue_for_ever(self) -> None:
        wires = SimulatedWires(("a",))
        for _ in range(100):
            wires.send(Side.ROBOT, frames(*[0] * 10), 0)
        assert wires.refused[Side.ROBOT, 0] > 0
        arrived = numbers(wires.receive(Side.HOST, 22_000))
        assert len(arrived) == wires.sent(Side.ROBOT)[0]


def test_a_bus_counts_what_the_controller_sent_and_what_it_got() -> None:
    """Three frames of 135 us on the first wire in one millisecond."""
    wires = SimulatedWires(("a", "b"))
    wires.send(Side.HOST, frames(0, 0, 1), 0)
    wires.send(Side.ROBOT, frames(0), 0)
    bus = SimulatedBus(wires, SimpleNamespace(time_us=1000))  # type: ignore[arg-type]
    first, second = bus.statistics()
    assert (first.name, first.frames_sent, first.frames_received, first.frames_refused) == ("a", 2, 1, 0)
    assert (second.name, second.frames_sent, second.frames_received) == ("b", 1, 0)
    assert (first.load, second.load) == pytest.approx((0.405, 0.135))


def test_frames_tell_when_they_arrived() -> None:
    """135 us each, one after another on the first wire; the second batch is read in two pieces."""
    wires = SimulatedWires(("a", "b"))
    wires.send(Side.ROBOT, frames(0, 0, 1), 1000)
    (batch,) = wires.receive(Side.HOST, 2000)
    assert batch.time_us is not None
    assert batch.time_us.tolist() == [1135, 1270, 1135]
    wires.send(Side.ROBOT, frames(0, 0), 3000)
    pieces = [wires.receive(Side.HOST, now)[0].time_us for now in (3200, 3300)]
    assert [piece.tolist() for piece in pieces if piece is not None] == [[3135], [3270]]
