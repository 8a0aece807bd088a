"""Who is on a robot's buses: ids and makers, found without switching anything on.

First comes listening alone: an ODrive has a heartbeat. Then each id is sent the frame that switches a motor
off, which makers in MIT mode answer, and RobStride's of 29 bits. Identifiers of an ODrive that was heard are
left out: there the same frame would mean something else.
"""

from typing import NamedTuple

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock, WallClock
from footfall.deploy.drivers import damiao, imu, mit, mit_driver, odrive, robstride
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, Frames

EVERYTHING: tuple[CanFilter, ...] = tuple(
    {"can_id": 0, "can_mask": 0, "extended": extended} for extended in (False, True)
)
PERIOD_US = 10_000
LISTENING_TICKS = 25  # two heartbeats
ROUNDS = 2  # that each id is asked: a frame may be lost
LATE_TICKS = 30  # for answers that are late
AT_ONCE = 8  # ids that are asked in a tick: an interface queues ten frames

MIT, DAMIAO, ROBSTRIDE, ODRIVE = "MIT mode", "Damiao", "RobStride", "ODrive"
MAKERS = {
    **dict.fromkeys(mit.RANGES, MIT),
    **dict.fromkeys(damiao.RANGES, DAMIAO),
    **dict.fromkeys(robstride.RANGES, ROBSTRIDE),
    odrive.MODEL: ODRIVE,
}


class Found(NamedTuple):
    """A motor on a bus."""

    channel: int
    id: int
    maker: str


def scan(bus: Bus, buses: int, clock: Clock | None = None) -> set[Found]:
    """All motors that are heard on a number of buses, which have to be open for `EVERYTHING`."""
    clock = clock or WallClock(PERIOD_US)
    found: set[Found] = set()
    now_us = clock.next_tick()
    for _ in range(LISTENING_TICKS):
        for frames in bus.receive(now_us):
            found |= _heartbeats(frames)
        now_us = clock.next_tick()
    odrives = {(each.channel, identifier) for each in found for identifier in odrive.identifiers(each.id)}
    nothing = Frames(*np.zeros((4, 0), np.intp))
    for frames in [*_questions(buses, odrives) * ROUNDS, *[nothing] * LATE_TICKS]:
        bus.send(frames, now_us)
        now_us = clock.next_tick()
        for answer in bus.receive(now_us):
            found |= _answers(answer, odrives)
    return found


def _heartbeats(frames: Frames) -> set[Found]:
    rows = (frames.id < 0x800) & (frames.id & 0x1F == odrive.HEARTBEAT) & (frames.length == 8)
    rows &= ~np.isin(frames.id, imu.IDS) & np.isin(frames.id >> 5, odrive.NODES)
    return {
        Found(channel, identifier >> 5, ODRIVE)
        for channel, identifier in zip(frames.channel[rows].tolist(), frames.id[rows].tolist(), strict=True)
    }


def _questions(buses: int, odrives: set[tuple[int, int]]) -> list[Frames]:
    """Frames that switch off, some ids in each batch: in MIT mode, and RobStride's."""
    stop = int(robstride.identifier_of(robstride.STOP, robstride.HOST, 0))
    ids, batches = mit_driver.MOTOR_IDS, []
    for first in range(0, len(ids), AT_ONCE):
        places = [(channel, motor) for channel in range(buses) for motor in ids[first : first + AT_ONCE]]
        plain = [place for place in places if place not in odrives]
        batches += [_to(plain, 0, mit.EXIT), _to(places, stop, 0)]
    return batches


def _to(places: list[tuple[int, int]], flags: int, word: int) -> Frames:
    """One frame for each place (bus and motor id), with a word for content."""
    channel = np.array([place[0] for place in places], np.intp)
    identifier = np.array([flags | place[1] for place in places], np.intp)
    return Frames(channel, identifier, mit.special(word, len(places)), np.full(len(places), 8))


def _answers(frames: Frames, odrives: set[tuple[int, int]]) -> set[Found]:
    found = set()
    columns = frames.channel, frames.id, frames.length, frames.data[:, 0]
    for channel, identifier, length, first in zip(*(part.tolist() for part in columns), strict=True):
        if (channel, identifier) in odrives:
            continue
        motor = identifier & 0x7F
        if identifier >= EXTENDED:
            if identifier >> 24 & 0x1F == robstride.FEEDBACK and identifier & 0xFF == robstride.HOST:
                found.add(Found(channel, identifier >> 8 & 0xFF, ROBSTRIDE))
        elif identifier == mit_driver.SHARED_REPLY_ID and length >= 6 and first in mit_driver.MOTOR_IDS:
            found.add(Found(channel, first, MIT))
        elif identifier & ~0x7F == mit_driver.REPLY_ID and length >= 6 and first == motor:
            found.add(Found(channel, motor, MIT))
        elif identifier & ~0x7F == damiao.REPLY_ID and length == 8 and first & 0xF == motor & 0xF:
            found.add(Found(channel, motor, DAMIAO))
    return found
