"""A run's part in ROS 2: its telemetry goes out, commands come in."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.ros2.bridge_process import Backend, Ros2Options, bridge
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket

OPERATOR = "ros2"


@contextmanager
def steered_by_ros2(
    backend: Backend,
    options: Ros2Options,
    feed: Path,
    inbox: Inbox,
    abilities: Callable[[str], Abilities],
) -> Iterator[PathSource]:
    """The command source of a run that ROS 2 steers.

    Args:
        backend: see `find_backend`.
        options: of ROS.
        feed: socket of the run's telemetry, in a folder of its own; the run makes it.
        inbox: of the run; others may put requests there, too.
        abilities: of a policy of the run, by its name.

    Raises:
        UserError: the bridge does not start.
    """
    source = PathSource(inbox, OPERATOR, abilities)
    steer = feed.with_name("steer")
    steering = SteeringSocket(steer, inbox, source, OPERATOR)
    try:
        with bridge(backend, feed, steer, options):
            yield source
    finally:
        steering.close()
