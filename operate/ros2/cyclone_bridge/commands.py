"""Forwards commands from topics to the run."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from cyclonedds.domain import DomainParticipant

from footfall.operate.ros2.cyclone_bridge.decode import decode
from footfall.operate.ros2.cyclone_bridge.raw import RawReader, quality_of_service
from footfall.operate.ros2.link import Link
from footfall.operate.ros2.table import (
    CHOSEN,
    CMD_VEL,
    SETTING,
    STOP,
    Subscribed,
    absolute,
    other_type,
    velocity_kinds,
)

DEPTH = 10


class Commands:
    """Readers of the topics with commands."""

    def __init__(self, participant: DomainParticipant, path: str, stamped: bool) -> None:
        """Connect to the run and start listening.

        Args:
            participant: participant in the domain.
            path: path of the run's steering socket.
            stamped: whether velocities are TwistStamped.
        """
        self._participant = participant
        self._offered: list[str] = []
        self._link = Link(path, self._receive_status, lambda why: self._link.post(note=f"refused: {why}"))
        self._kind, self._other = velocity_kinds(stamped)
        self._stopped = False
        self._readers: dict[str, tuple[RawReader, str, Callable[[Any], None]]] = {}
        self._listen(CMD_VEL._replace(kind=self._kind), lambda value: self._link.post(velocity=value))
        self._listen(CMD_VEL._replace(kind=self._other), self._wrong_type)
        self._listen(STOP, self._stop)
        for topic in CHOSEN:
            self._listen(topic, partial(self._choose, topic.key))

    def take(self) -> None:
        """Forward what has arrived since the last call."""
        for name in self._offered:
            topic = SETTING._replace(name=SETTING.name.format(name))
            self._listen(topic, partial(self._setting, name))
        for reader, kind, act in list(self._readers.values()):
            for message in reader.take():
                with suppress(ValueError):
                    act(decode(kind, message))

    def _receive_status(self, status: dict[str, Any]) -> None:
        self._offered = list(status["settings"])

    def _listen(self, topic: Subscribed, act: Callable[[Any], None]) -> None:
        """Listen to a topic unless this is done already."""
        name = absolute(topic.name)
        if (key := f"{name} {topic.kind}") not in self._readers:
            qos = quality_of_service(topic.reliable, False, 1 if topic.key == CMD_VEL.key else DEPTH)
            reader = RawReader(self._participant, name, topic.kind, qos)
            self._readers[key] = reader, topic.kind, act

    def _stop(self, _: None) -> None:
        """A repeated message is forwarded once: a second stop has a stronger effect on the run."""
        if not self._stopped:
            self._stopped = True
            self._link.post(stop=f"topic {absolute(STOP.name)}")

    def _choose(self, key: str, value: str) -> None:
        self._link.post(**{key: value})

    def _setting(self, name: str, value: float) -> None:
        self._link.post(settings={name: value})

    def _wrong_type(self, _: Any) -> None:
        self._link.post(note=other_type(absolute(CMD_VEL.name), self._kind, self._other))
