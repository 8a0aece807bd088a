"""Simulated wires take their time, keep order, and refuse frames that do not fit their queues."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, short_episode

from footfall import Robot, run_episode
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import EXTENDED, Frames, frame_bits
from footfall.deploy.loop import ControlLoop
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.sample import Sample
from footfall.plant.bus import SimulatedBus
from footfall.plant.delays import DelayLine
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wire_faults import FaultyWires, WireFaults
from footfall.plant.wires import MAX_PLANS, Side, SimulatedWires


def frames(*channels: int) -> Frames:
    k = len(channels)
    return Frames(np.array(channels), np.arange(1, k + 1), np.zeros((k, 8), np.uint8), np.full(k, 8))


def named(*identifiers: int, length: int = 8) -> Frames:
    """Frames with given identifiers on the first wire."""
    k = len(identifiers)
    return Frames(np.zeros(k, int), np.array(identifiers), np.zeros((k, 8), np.uint8), np.full(k, length))


def test_motors_on_a_jammed_bus_drop_frames_instead_of_queueing_forever() -> None:
    """Motors keep frames for 20 ms."""
    wires = SimulatedWires(("a",))
    for _ in range(100):
        wires.send(Side.ROBOT, frames(*[0] * 10), 0)
    assert wires.refused[Side.ROBOT, 0] > 0
    assert sum(len(batch.id) for batch in wires.receive(Side.HOST, 22_000)) == wires.sent(Side.ROBOT)[0]


def test_a_bus_counts_sent_and_received_frames() -> None:
    """Within one millisecond, the first wire carries three frames of 135 us."""
    wires = SimulatedWires(("a", "b"))
    wires.send(Side.HOST, frames(0, 0, 1), 0)
    wires.send(Side.ROBOT, frames(0), 0)
    bus = SimulatedBus(wires, SimpleNamespace(time_us=1000))  # type: ignore[arg-type]
    first, second = bus.statistics()
    assert (first.name, first.frames_sent, first.frames_received, first.frames_refused) == ("a", 2, 1, 0)
    assert (second.name, second.frames_sent, second.frames_received) == ("b", 1, 0)
    assert (first.load, second.load) == pytest.approx((0.405, 0.135))


def test_frames_of_more_layouts_than_are_kept_are_counted() -> None:
    """Some protocols have values in their identifiers, so layouts never repeat."""
    wires = SimulatedWires(("can0", "can1"))
    for number in range(2 * MAX_PLANS):
        batch = frames(0, 1, 1)
        wires.send(Side.HOST, batch._replace(id=batch.id + number), 1000 * number)
    counts = 2 * MAX_PLANS * np.array([1, 2])
    assert wires.sent(Side.HOST).tolist() == counts.tolist()
    assert wires.busy_us() == pytest.approx(frame_bits(8) * counts)


def test_a_full_queue_of_the_host_refuses_the_rest() -> None:
    wires, batches = SimulatedWires(("a", "b"), host_queue=3), ((0, 0), (0,), (0, 1), (0,) * 5)
    assert [wires.send(Side.HOST, frames(*batch), 0) for batch in batches] == [0, 0, 1, 5]
    assert wires.send(Side.HOST, frames(0), 135) == 0  # one frame has left
    assert wires.send(Side.ROBOT, frames(*[0] * 5), 135) == 0


def test_frames_have_their_arrival_time() -> None:
    """Frames on the first wire take 135 us each, one after another. The second batch is read in two parts."""
    wires = SimulatedWires(("a", "b"))
    wires.send(Side.ROBOT, frames(0, 0, 1), 1000)
    (batch,) = wires.receive(Side.HOST, 2000)
    assert batch.time_us is not None
    assert batch.time_us.tolist() == [1135, 1270, 1135]
    wires.send(Side.ROBOT, frames(0, 0), 3000)
    pieces = [wires.receive(Side.HOST, now)[0].time_us for now in (3200, 3300)]
    assert [piece.tolist() for piece in pieces if piece is not None] == [[3135], [3270]]


def by_hand(sent: list[tuple[float, int, int, int]]) -> dict[int, float]:
    """Arrival time of each identifier: whenever the wire is idle, the lowest waiting identifier is sent."""
    host, robot = ([frame for frame in sent if frame[1] == side] for side in (Side.HOST, Side.ROBOT))
    arrives, now = {}, 0.0
    while host or robot:
        offered = [f for f in (*host[:1], *robot) if f[0] <= now]
        if not offered:
            now = min(f[0] for f in (*host[:1], *robot))
            continue
        wins = min(offered, key=lambda f: f[2])
        (host if wins[1] == Side.HOST else robot).remove(wins)
        now += frame_bits(wins[3])
        arrives[wins[2]] = now
    return arrives


def test_with_equal_first_bits_the_11_bit_identifier_wins() -> None:
    """The 11-bit frame's next bit is dominant. 0x101 in 29 bits begins with 0x000 and wins over 0x001."""
    wires = SimulatedWires(("a",))
    same_prefix = EXTENDED | 0x101 << 18
    wires.send(Side.ROBOT, named(same_prefix, 0x101, 0x001, EXTENDED | 0x101), 0)
    arrived = [batch for now_us in range(0, 20_000, 5) for batch in wires.receive(Side.HOST, now_us)]
    found = np.concatenate([batch.id for batch in arrived]).tolist()
    assert found == [EXTENDED | 0x101, 0x001, 0x101, same_prefix]


@pytest.mark.parametrize("seed", range(5))
def test_random_traffic_equals_that_of_a_bus_that_arbitrates_bit_by_bit(seed: int) -> None:
    """Compared with a model that arbitrates among the waiting frames whenever the wire is idle."""
    rng = np.random.default_rng(seed)
    wires = SimulatedWires(("a",), host_queue=1000)
    sent: list[tuple[float, int, int, int]] = []  # time, side, identifier, length
    now, numbers = 0.0, rng.permutation(0x7FF)
    for step in range(40):
        now += float(rng.choice([0, 50, 135, 300]))
        side, k, length = int(rng.integers(2)), int(rng.integers(1, 5)), int(rng.integers(0, 9))
        batch = named(*numbers[8 * step : 8 * step + k].tolist(), length=length)
        wires.send(Side(side), batch, now)
        sent += [(now, side, identifier, length) for identifier in batch.id.tolist()]
    found, expected = {}, by_hand(sent)
    for batch in (*wires.receive(Side.HOST, 1e9), *wires.receive(Side.ROBOT, 1e9)):
        times = batch.time_us if batch.time_us is not None else np.full(len(batch.id), np.nan)
        found |= dict(zip(batch.id.tolist(), times.tolist(), strict=True))
    assert set(found) == set(expected)
    for identifier, at in found.items():
        assert math.isnan(at) or at == pytest.approx(expected[identifier])
    assert sum(not math.isnan(at) for at in found.values()) > 20


def test_corruption_changes_one_bit_of_the_data() -> None:
    wires = SimulatedWires(("a",), host_queue=100, faults=WireFaults(corrupted=0.5))
    sent = named(*range(1, 41), length=3)
    wires.send(Side.HOST, sent, 0)
    (received,) = wires.receive(Side.ROBOT, 1e9)
    changed = np.unpackbits(received.data ^ sent.data, axis=1).sum(axis=1)
    assert set(changed.tolist()) == {0, 1}
    assert 10 < changed.sum() < 30
    assert not received.data[:, 3:].any()
    assert not sent.data.any()


def test_an_error_counts_eight_and_a_sent_frame_minus_one() -> None:
    """ISO 11898-1; frames destroyed one time in ten never make a controller passive."""
    draws = iter([np.ones(4, np.intp), np.array([3, 1, 2, 1]), np.array([3, 1, 2, 1])])
    given: Any = SimpleNamespace(geometric=lambda *_: next(draws))
    wires, sent = FaultyWires(WireFaults(destroyed=0.1), 2, given), np.ones(4, np.intp)
    wires.repetitions(sent, from_host=True)
    assert wires.transmit_errors.tolist() == [0, 0]  # a counter of zero stays
    assert wires.repetitions(sent, from_host=True).tolist() == [2, 0, 1, 0]
    assert wires.transmit_errors.tolist() == [0, 20]  # 15, 14, 21, 20
    wires.repetitions(sent, from_host=False)  # a motor's errors are its own
    assert wires.transmit_errors.tolist() == [0, 20]
    rare = FaultyWires(WireFaults(destroyed=0.1, seed=1), 2)
    rare.repetitions(np.ones(400, np.intp), from_host=True)
    assert rare.fault(("a", "b")) == ""


def test_too_many_errors_end_in_bus_off() -> None:
    wires = SimulatedWires(("a", "b"), host_queue=1000, faults=WireFaults(destroyed=0.8))
    faults = []
    for tick in range(30):
        wires.send(Side.HOST, frames(1), tick * 100_000)
        faults.append(wires.fault())
    assert faults[0] == ""
    assert "bus b is error-passive" in " ".join(faults)
    assert faults[-1].startswith("bus b is bus-off")
    count = wires.sent(Side.HOST).tolist()
    wires.send(Side.HOST, frames(0, 1), 10**7)
    assert (wires.sent(Side.HOST) - count).tolist() == [1, 0]


def test_a_controller_that_is_alone_is_error_passive() -> None:
    wires = SimulatedWires(("a", "b"), faults=WireFaults(unplugged=(1,)))
    wires.send(Side.HOST, frames(0, 1), 0)
    wires.send(Side.ROBOT, frames(0, 1), 0)
    assert [batch.channel.tolist() for batch in wires.receive(Side.ROBOT, 1000)] == [[0]]
    assert [batch.channel.tolist() for batch in wires.receive(Side.HOST, 1000)] == [[0]]
    assert wires.fault().startswith("bus b is error-passive")


@pytest.mark.parametrize("name", ["lost", "corrupted", "destroyed"])
def test_a_share_below_0_or_of_1_and_more_is_refused(name: str) -> None:
    for share in (-0.1, 1.0, math.nan):
        with pytest.raises(ValueError, match=f"{name} is"):
            WireFaults(**{name: share})


def test_a_guards_thread_and_the_loops_take_turns() -> None:
    """Without turns, both would step one simulation at once."""
    inside, at_once = [0], []

    def act(*_: object) -> list[Frames]:
        inside[0] += 1
        at_once.append(inside[0])
        time.sleep(0.01)
        inside[0] -= 1
        return []

    bus = SimulatedBus(SimpleNamespace(send=act, receive=act), SimpleNamespace(advance=act))  # type: ignore[arg-type]
    with ThreadPoolExecutor(3) as threads:
        for each in (bus.receive, bus.receive, partial(bus.send, None)):  # type: ignore[arg-type]
            threads.submit(each, 0)
    assert at_once == [1, 1, 1, 1, 1]


def test_jitter_never_shows_an_older_moment_after_a_newer_one() -> None:
    sample = Sample(observation_delay_s=np.array(0.002), observation_jitter_s=np.array(0.012))
    delay_line, shown = DelayLine[int](sample, 0.001, seed=3), []
    for step in range(600):
        delay_line.push(step)
        shown.append(delay_line.delayed())
    assert (np.diff(shown) >= 0).all()
    late = set((np.arange(600) - shown)[20:])
    assert late <= set(range(2, 15))
    assert len(late) > 8


def replies(robot: Robot, sample: Sample) -> np.ndarray:
    """Frames of the motors and of the IMU that arrive while 500 commands are sent to enabled motors, (2,)."""
    wiring = wiring_of(robot)
    wires, driver = SimulatedWires(wiring.buses), open_driver(wiring)
    body = SimulatedRobot(robot, wiring, wires, PlantConfig(sample=sample))
    zeros = np.zeros_like(robot.default_pose)
    hold = driver.command(np.stack([robot.default_pose, zeros, robot.kp, robot.kd, zeros]))
    arrived = np.zeros(2)
    for now_us in range(0, 1_000_000, 2000):
        wires.send(Side.HOST, hold if now_us else driver.enable(), now_us)
        body.advance(now_us + 2000)
        for batch in wires.receive(Side.HOST, now_us + 2000):
            of_imu = np.isin(batch.id, (0x300, 0x301, 0x302))
            arrived += (~of_imu).sum(), of_imu.sum()
    return arrived


def test_the_declared_shares_of_commands_and_replies_never_arrive(go1: Robot) -> None:
    """A motor replies to each command that reaches it; the IMU sends by itself."""
    sample = {"lost_commands": np.array(0.2), "lost_replies": np.array(0.25)}
    assert replies(go1, sample) / replies(go1, {}) == pytest.approx([0.8 * 0.75, 0.75], abs=0.03)


def test_a_robot_with_a_loose_cable_is_stopped_with_the_reason(go1: Robot) -> None:
    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and 0.3 < loop.walking_s < 0.3021:
            body._connection._wires.set_faults(WireFaults(unplugged=(2,)))

    trace = run_episode(go1, Hold(go1), short_episode(), watch)
    assert trace.final_state == "ESTOP"
    assert trace.faults[0].startswith("bus can2 is error-passive")
