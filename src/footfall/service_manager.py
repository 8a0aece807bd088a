"""Notifications to systemd: ready, alive, state, stopping (sd_notify(3)).

With `Type=notify` and `WatchdogSec`, systemd ends a process whose loop does not tick any more.
Without a service manager this module does nothing.
"""

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from footfall.deploy.loop import ControlLoop

STATUS_EVERY_S = 1.0
SHARES_OF_WATCHDOG = 4  # notifications per watchdog period
OLDEST_TICK_S = 0.5  # age of the last tick up to which a loop is alive


@contextmanager
def notifying_service_manager(loop: ControlLoop) -> Iterator[None]:
    """Notify the service manager from a separate thread while the context is open."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        yield
        return
    watchdog_us = int(os.environ.get("WATCHDOG_USEC", "0"))
    period_s = min(STATUS_EVERY_S, watchdog_us * 1e-6 / SHARES_OF_WATCHDOG or STATUS_EVERY_S)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.setblocking(False)
        if address.startswith("@"):  # abstract socket name
            address = "\0" + address[1:]

        def notify(*lines: str) -> None:
            with suppress(OSError):  # a failure must not stop the robot
                manager.sendto("\n".join(lines).encode(), address)

        def notify_periodically() -> None:
            while not ended.wait(period_s):
                alive = time.perf_counter() - loop.heartbeat_s < OLDEST_TICK_S
                notify(_status(loop), *["WATCHDOG=1"] * alive)

        ended = threading.Event()
        thread = threading.Thread(target=notify_periodically, name="service manager", daemon=True)
        notify("READY=1", _status(loop))
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()
            notify("STOPPING=1", _status(loop))


def _status(loop: ControlLoop) -> str:
    state = loop.state
    battery = f"battery {loop.battery.charge:.0%}" if loop.battery.known else ""
    return "STATUS=" + ", ".join(filter(None, [state.mode.value, battery, *state.faults[-1:]]))
