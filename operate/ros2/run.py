"""A run's connection to ROS 2: telemetry out, commands in."""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.open_source import OpenSource
from footfall.operate.ros2.bridge_process import Backend, Ros2Config, bridge, find_backend, network_note
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket

OPERATOR = "ros2"


@contextmanager
def published_to_ros2(feed: Path) -> Iterator[tuple[str, ...]]:
    """Publish the run's telemetry to ROS 2 while the context is open, whoever controls the robot.

    Args:
        feed: socket of the run's telemetry; it may be created later.

    Yields:
        Lines for the operator.

    Raises:
        UserError: this computer has no ROS 2, or the bridge does not start.
    """
    config = Ros2Config()
    backend = find_backend(config)
    with bridge(backend, feed, None, config):
        yield _about(backend)


@contextmanager
def steered_by_ros2(
    inbox: Inbox, abilities: Callable[[str], Abilities], config: Ros2Config
) -> Iterator[OpenSource]:
    """Control by ROS 2 through the inbox, with telemetry, while the context is open.

    Raises:
        UserError: this computer has no ROS 2, or the bridge does not start.
    """
    backend, source = find_backend(config), PathSource(inbox, OPERATOR, abilities)
    inbox.set_longest_silence(config.lie_down_after_s)
    with tempfile.TemporaryDirectory(prefix="footfall-ros2-") as folder:
        feed, steer = Path(folder) / "feed", Path(folder) / "steer"
        steering = SteeringSocket(steer, inbox, source, OPERATOR)
        try:
            with bridge(backend, feed, steer, config):
                yield OpenSource(source, lambda: inbox.owner, _about(backend), True, feed)
        finally:
            steering.close()


def _about(backend: Backend) -> tuple[str, ...]:
    domain = f"{backend.about}; domain {os.environ.get('ROS_DOMAIN_ID') or 0}"
    return tuple(filter(None, (domain, network_note())))
