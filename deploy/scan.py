"""Scan for the motors on a robot's buses, without enabling any: ids and makers.

First the scan only listens, because some motors broadcast their state. Then it sends each id the frames to
which disabled motors of each protocol reply (`MotorDriver.probes`). Identifiers of a motor that was found
before are skipped, because the same frame would have another meaning there. CAN FD frames are sent only on
buses that have such a motor in robot.yaml: nodes without CAN FD would destroy them.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock, WallClock
from footfall.deploy.drivers.choice import DRIVERS, driver_class, imu_driver_class
from footfall.deploy.drivers.driver import CanFilter, MotorDriver
from footfall.deploy.drivers.polled import MOTOR_IDS
from footfall.deploy.frames import FD, MAX_FD_BYTES, Frames, no_frames, takes_fd
from footfall.deploy.wiring import Wiring

PERIOD_US = 10_000
LISTENING_TICKS = 25  # two heartbeats
ROUNDS = 2  # probes of each id, because a frame may be lost
MAX_ROUNDS = 5  # while a motor of robot.yaml is missing: a busy machine can lose the frames of a whole round
LATE_TICKS = 30  # ticks for late replies
IDS_PER_TICK = 8  # ids probed per tick: an interface queues ten frames

Drivers = Sequence[type[MotorDriver]]
Probe = tuple[int, int, bytes]  # bus, identifier, data


class FoundMotor(NamedTuple):
    """A motor on a bus."""

    channel: int
    id: int
    maker: str


def accept_all(wiring: Wiring) -> tuple[CanFilter, ...]:
    """Filters that all frames pass, including CAN FD frames if robot.yaml has motors that send them."""
    fd = bool(_fd_channels(wiring))
    return tuple({"can_id": 0, "can_mask": 0, "extended": extended, "fd": fd} for extended in (False, True))


def _fd_channels(wiring: Wiring) -> set[int]:
    """Buses with a CAN FD motor."""
    channels = zip(wiring.channel.tolist(), wiring.models, strict=True)
    return {channel for channel, model in channels if takes_fd(driver_class(model).filters)}


def expected(wiring: Wiring) -> dict[FoundMotor, str]:
    """Motors of robot.yaml, each with its joint."""
    rows = zip(
        wiring.channel.tolist(), wiring.motor_id.tolist(), wiring.models, wiring.joint_names, strict=True
    )
    return {
        FoundMotor(channel, motor, driver_class(model).maker): joint for channel, motor, model, joint in rows
    }


def scan(bus: Bus, wiring: Wiring, clock: Clock | None = None) -> set[FoundMotor]:
    """All motors on a robot's buses, which must be open with the filters of `everything`.

    Motors of robot.yaml without a reply are probed again, up to `MAX_ROUNDS` times.
    """
    clock = clock or WallClock(PERIOD_US)
    drivers = dict.fromkeys([*DRIVERS, *map(driver_class, wiring.models)])
    answering = [driver for driver in drivers if driver.probes(MOTOR_IDS[0])]
    broadcasting = [driver for driver in drivers if driver not in answering]
    imu_identifiers = np.array(imu_driver_class(wiring.imu_protocol).identifiers)
    found: set[FoundMotor] = set()
    now_us = clock.next_tick()
    for _ in range(LISTENING_TICKS):
        for frames in bus.receive(now_us):
            found |= _senders(frames.take(~np.isin(frames.id, imu_identifiers)), broadcasting)
        now_us = clock.next_tick()
    identifiers = {driver.maker: driver.identifiers for driver in broadcasting}
    taken = {(each.channel, identifier) for each in found for identifier in identifiers[each.maker](each.id)}

    def is_free(channel: int, identifier: int) -> bool:
        return (channel, identifier) not in taken

    needed = {motor for motor in expected(wiring) if motor.maker not in identifiers}
    fd_channels, channels = _fd_channels(wiring), range(len(wiring.buses))
    batches = _probes(channels, [each for each in answering if not takes_fd(each.filters)], is_free)
    batches += _probes(sorted(fd_channels), [each for each in answering if takes_fd(each.filters)], is_free)
    for done in range(MAX_ROUNDS):
        if done >= ROUNDS and needed <= found:
            break
        for frames in [*batches, *[no_frames()] * LATE_TICKS]:
            bus.send(frames, now_us)
            now_us = clock.next_tick()
            for answer in bus.receive(now_us):
                addresses = zip(answer.channel.tolist(), answer.id.tolist(), strict=True)
                free = [is_free(*address) for address in addresses]
                found |= _senders(answer.take(np.array(free, bool)), answering)
    return found


def _senders(frames: Frames, drivers: Drivers) -> set[FoundMotor]:
    """Motors of some protocols that sent frames."""
    found = set()
    for driver in drivers:
        own = frames.fd_frames() if takes_fd(driver.filters) else frames.can_frames()
        ids = driver.senders(own)
        rows = ids >= 0
        pairs = zip(own.channel[rows].tolist(), ids[rows].tolist(), strict=True)
        found |= {FoundMotor(channel, motor, driver.maker) for channel, motor in pairs}
    return found


def _probes(channels: Sequence[int], drivers: Drivers, is_free: Callable[[int, int], bool]) -> list[Frames]:
    """Probes of all motor ids on some buses; each batch has those of one protocol for some ids."""
    batches: dict[tuple[Probe, ...], Frames] = {}  # protocols with the same probes share a batch
    for first in range(0, len(MOTOR_IDS), IDS_PER_TICK):
        for driver in drivers:
            probes: tuple[Probe, ...] = tuple(
                (channel, *probe)
                for channel in channels
                for motor in MOTOR_IDS[first : first + IDS_PER_TICK]
                for probe in driver.probes(motor)
                if is_free(channel, probe[0])
            )
            if probes:
                batches.setdefault(probes, _batch(probes))
    return list(batches.values())


def _batch(probes: tuple[Probe, ...]) -> Frames:
    channel, identifier, content = zip(*probes, strict=True)
    width = MAX_FD_BYTES if identifier[0] & FD else 8
    rows = b"".join(each.ljust(width, b"\0") for each in content)
    data = np.frombuffer(rows, np.uint8).reshape(-1, width)
    return Frames(np.array(channel), np.array(identifier), data, np.array([len(each) for each in content]))
