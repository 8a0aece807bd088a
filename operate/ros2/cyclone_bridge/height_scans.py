"""The bridge process for height scans: `python -m footfall.operate.ros2.cyclone_bridge.height_scans PORT`."""

import sys
import threading
from collections.abc import Sequence
from contextlib import suppress

from footfall.operate.ros2.cyclone_bridge.decode import decode
from footfall.operate.ros2.cyclone_bridge.domain import configure
from footfall.operate.ros2.reading import report_ready
from footfall.operate.ros2.scan_sender import scan_sender
from footfall.operate.ros2.table import HEIGHT_SCAN, absolute

POLL_S = 0.005


def main(arguments: Sequence[str]) -> None:
    """Forward scans until the parent process ends this one; the argument is a port."""
    domain = configure()  # before cyclonedds is imported
    from cyclonedds.domain import DomainParticipant

    from footfall.operate.ros2.cyclone_bridge.raw import RawReader, quality_of_service

    name, kind = absolute(HEIGHT_SCAN.name), HEIGHT_SCAN.kind
    participant = DomainParticipant(domain)
    reader = RawReader(participant, name, kind, quality_of_service(HEIGHT_SCAN.reliable, False, 1))
    ended = threading.Event()
    with scan_sender(int(arguments[0])) as send:
        report_ready(ended.set)
        while not ended.wait(POLL_S):
            for message in reader.take():
                with suppress(ValueError):
                    send(decode(kind, message))


if __name__ == "__main__":
    main(sys.argv[1:])
