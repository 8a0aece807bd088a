"""A run's part in ROS 2: its telemetry goes out, commands come in."""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.opened import Opened
from footfall.operate.ros2.bridge_process import Ros2Config, bridge, find_backend, network_note
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket

OPERATOR = "ros2"


@contextmanager
def steered_by_ros2(
    inbox: Inbox, abilities: Callable[[str], Abilities], config: Ros2Config
) -> Iterator[Opened]:
    """ROS 2 puts requests into the inbox, and hears how the run is, for as long as the context lasts.

    Raises:
        UserError: this computer has no ROS 2, or the bridge to it does not start.
    """
    backend, source = find_backend(config), PathSource(inbox, OPERATOR, abilities)
    with tempfile.TemporaryDirectory(prefix="footfall-ros2-") as folder:
        feed, steer = Path(folder) / "feed", Path(folder) / "steer"
        steering = SteeringSocket(steer, inbox, source, OPERATOR)
        try:
            with bridge(backend, feed, steer, config):
                about = (f"{backend.about}; domain {os.environ.get('ROS_DOMAIN_ID') or 0}", network_note())
                yield Opened(source, lambda: inbox.owner, tuple(filter(None, about)), True, feed)
        finally:
            steering.close()
