"""The newest messages of a run's feed, for pages beside it."""

import json
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.pages.moment import Moment
from footfall.robots.readings import Sensed

WAIT_S = 0.1  # between attempts to connect to a feed that does not exist yet
MAX_AGE_NS = 500_000_000  # older estimates and plans are ignored
ZEROS = np.zeros(3)


class RunFeed:
    """Keeps the newest message of each topic. A thread reads; messages are decoded on demand.

    Attributes:
        ended: whether the run or its process has ended.
    """

    def __init__(self, path: Path) -> None:
        """Start reading; the feed may appear later."""
        self.ended = False
        self._newest: dict[str, FeedMessage] = {}
        self._decode: dict[str, Callable[[bytes], Any]] = {}
        self._factory = DecoderFactory()
        self._reader: FeedReader | None = None
        self._path = path
        threading.Thread(target=self._read, name="feed", daemon=True).start()

    def fact(self, name: str) -> Any:
        """A fact of the run's metadata; None before the first message."""
        if self._reader is None or not self._newest:
            return None
        return json.loads(self._reader.metadata.get(name, "null"))

    def newest(self, topic: str, after_ns: int = 0) -> Any:
        """The newest message of a topic, decoded; None without one, or if it is older than a time."""
        message = self._newest.get(topic)
        if message is None or message.time_ns < after_ns:
            return None
        channel = message.channel
        if channel.kind not in self._decode:
            number, definition = len(self._decode) + 1, channel.definition.encode()
            schema = Schema(id=number, name=channel.kind, encoding="ros2msg", data=definition)
            decode = self._factory.decoder_for("cdr", schema)
            assert decode is not None
            self._decode[channel.kind] = decode
        return self._decode[channel.kind](message.data)

    @property
    def time_ns(self) -> int:
        """Time of the newest readings, ns; 0 without any."""
        message = self._newest.get("/joint_states")
        return 0 if message is None else message.time_ns

    def _read(self) -> None:
        while self._reader is None:
            with suppress(OSError):
                self._reader = FeedReader(self._path)
            time.sleep(WAIT_S)
        with suppress(OSError):
            for message in self._reader:
                self._newest[message.channel.topic] = message
        self.ended = True


def sensed(feed: RunFeed) -> Sensed | None:
    """The newest readings of a run; None before the first."""
    joints, imu = feed.newest("/joint_states"), feed.newest("/imu/data")
    if joints is None or imu is None:
        return None
    orientation = imu.orientation
    return Sensed(
        gyro=_vector(imu.angular_velocity),
        acceleration=_vector(imu.linear_acceleration),
        quaternion=np.array([orientation.w, orientation.x, orientation.y, orientation.z]),
        joint_position=np.array(joints.position),
        joint_velocity=np.array(joints.velocity),
        joint_torque=np.array(joints.effort),
    )


def newest_moment(feed: RunFeed, feet: int) -> Moment | None:
    """Estimated state of a robot with this number of feet; None before the first readings.

    Before the robot walks, its position is the origin and no foot stands. The origin of heights is arbitrary.
    """
    readings, since_ns = sensed(feed), feed.time_ns - MAX_AGE_NS
    if readings is None:
        return None
    command, footholds = feed.newest("/cmd_vel", since_ns), feed.newest("/footholds", since_ns)
    odometry, contacts = feed.newest("/odom"), feed.newest("/contacts", since_ns)
    twist = None if command is None else command.twist
    position, velocity, quaternion = ZEROS, ZEROS, readings.quaternion
    if odometry is not None:
        position, orientation = _vector(odometry.pose.pose.position), odometry.pose.pose.orientation
        if contacts is not None:
            velocity = _vector(odometry.twist.twist.linear)
            quaternion = np.array([orientation.w, orientation.x, orientation.y, orientation.z])
    return Moment(
        time_s=feed.time_ns * 1e-9,
        position=position,
        quaternion=quaternion,
        velocity=velocity,
        command=ZEROS if twist is None else np.array([twist.linear.x, twist.linear.y, twist.angular.z]),
        sensed=readings,
        contact=np.zeros(feet) if contacts is None else np.array(contacts.data),
        footholds=None if footholds is None else np.reshape(footholds.data, (feet, 3)),
    )


def _vector(message: Any) -> np.ndarray:
    return np.array([message.x, message.y, message.z])
