"""Raw CDR over cyclonedds: sends and receives encoded bytes.

The Python API of cyclonedds has no public function for this. Only two private ones are used here; the version
is pinned in pyproject.toml, and `benchmarks/ros2` tests sending to rclpy.
"""

from types import new_class

from cyclonedds._clayer import ddspy_take, ddspy_write
from cyclonedds.core import DDSException, InstanceState, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import uint8
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

ANY = SampleState.Any | ViewState.Any | InstanceState.Any
WRITE_TIMEOUT = duration(milliseconds=10)  # maximum time of a write if a subscriber is slow


def quality_of_service(reliable: bool, latched: bool, depth: int) -> Qos:
    """Quality of service, with ROS's terms."""
    return Qos(
        Policy.Reliability.Reliable(WRITE_TIMEOUT) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
    )


def dds_topic(participant: DomainParticipant, name: str, kind: str) -> Topic:
    """A topic with ROS's names for topic and type.

    Its structure is a placeholder: it is not used for encoding, and peers ignore it on request.

    Args:
        participant: participant in the domain.
        name: absolute name, such as `/imu/data`.
        kind: type, such as `sensor_msgs/msg/Imu`.
    """
    package, part, message = kind.split("/")
    typename = f"{package}.{part}.dds_.{message}_"
    stand_in = {"__annotations__": {"stand_in": uint8}}
    structure = new_class(
        f"{message}_", (IdlStruct,), {"typename": typename}, lambda body: body.update(stand_in)
    )
    return Topic(participant, f"rt{name}", structure)


class RawWriter:
    """Publishes encoded messages."""

    def __init__(self, participant: DomainParticipant, name: str, kind: str, qos: Qos) -> None:
        self._writer = DataWriter(participant, dds_topic(participant, name, kind), qos)

    def write(self, message: bytes) -> None:
        """Publish a message, given with its CDR header.

        Raises:
            DDSException: it cannot be sent, for example because a subscriber is too slow.
        """
        padded = message + bytes(-len(message) % 4)
        if (status := ddspy_write(self._writer._ref, padded)) < 0:
            raise DDSException(status, "a message was not sent")


class RawReader:
    """Receives encoded messages."""

    def __init__(self, participant: DomainParticipant, name: str, kind: str, qos: Qos) -> None:
        self._reader = DataReader(participant, dds_topic(participant, name, kind), qos)

    def take(self) -> list[bytes]:
        """Messages received since the last call, at most a hundred."""
        found = ddspy_take(self._reader._ref, ANY, 100)
        if isinstance(found, int):
            raise DDSException(found, "messages cannot be taken")
        return [data for data, about in found if about.valid_data]
