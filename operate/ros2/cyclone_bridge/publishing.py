"""Publishes a run's feed."""

from contextlib import suppress

from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant

from footfall.deploy.telemetry.feed_reader import FeedMessage
from footfall.deploy.telemetry.topics import TOPICS
from footfall.operate.ros2.cyclone_bridge.raw import RawWriter, quality_of_service
from footfall.operate.ros2.table import PUBLISHED, absolute
from footfall.operate.ros2.throttle import Throttle


class Publishing:
    """Writers for all topics of the table."""

    def __init__(self, participant: DomainParticipant) -> None:
        self._writers: dict[str, tuple[RawWriter, Throttle]] = {}
        for each in PUBLISHED:
            topic = TOPICS[each.feed]
            qos = quality_of_service(True, topic.latched, 1 if topic.latched else topic.depth)
            writer = RawWriter(participant, absolute(each.name), topic.kind, qos)
            self._writers[each.feed] = writer, Throttle(each.rate_hz)

    def pass_on(self, message: FeedMessage) -> None:
        """Publish a message of the feed if its topic is in the table."""
        found = self._writers.get(message.channel.topic)
        if found is not None and found[1].due(message.time_ns):
            with suppress(DDSException):  # a subscriber is too slow
                found[0].write(message.data)
