"""The bridge process: `python -m footfall.operate.ros2.cyclone_bridge --feed SOCKET [--steer SOCKET]`."""

import sys
import threading
from collections.abc import Sequence

from footfall.operate.ros2.arguments import parse
from footfall.operate.ros2.cyclone_bridge.domain import configure
from footfall.operate.ros2.reading import Reading

POLL_S = 0.01


def main(arguments: Sequence[str]) -> None:
    """Run until the end of the run or of the parent process."""
    domain = configure()  # before cyclonedds is imported
    from cyclonedds.domain import DomainParticipant

    from footfall.operate.ros2.cyclone_bridge.commands import Commands
    from footfall.operate.ros2.cyclone_bridge.publishing import Publishing

    options, _ = parse("cyclone_bridge", arguments)
    participant = DomainParticipant(domain)
    publishing = Publishing(participant)
    commands = None if options.steer is None else Commands(participant, options.steer, options.stamped)
    ended = threading.Event()
    Reading(options, publishing.pass_on, ended.set)
    while not ended.wait(POLL_S):
        if commands is not None:
            commands.take()


if __name__ == "__main__":
    main(sys.argv[1:])
