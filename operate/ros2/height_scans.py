"""Height scans from a ROS 2 topic."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from footfall.common.config import load
from footfall.operate.datagrams import answered_datagrams
from footfall.operate.height_scan_udp import UdpScans
from footfall.operate.ros2.bridge_process import Ros2Config, find_backend, network_note, scan_bridge
from footfall.operate.udp_client import MAX_DATAGRAM_BYTES

OPTION = "--height-scan ros2"
SEND = "send it height scans"


@contextmanager
def scans_by_ros2(settings: str = "") -> Iterator[tuple[UdpScans, str]]:
    """Receive height scans while the context is open. A scan's age counts from its arrival.

    A separate bridge process forwards them to this process by UDP on this computer.

    Args:
        settings: YAML file of `Ros2Config`; empty for the defaults.

    Yields:
        The source, and a warning, empty if there is none.

    Raises:
        UserError: this computer has no ROS 2, or the bridge does not start.
    """
    config = load(Path(settings), Ros2Config) if settings else Ros2Config()
    backend, token = find_backend(config), secrets.token_hex(16)
    scans = UdpScans(token)
    with (
        answered_datagrams(("127.0.0.1", 0), MAX_DATAGRAM_BYTES, scans.answer, OPTION) as port,
        scan_bridge(backend, port, token, config),
    ):
        yield scans, network_note(SEND)
