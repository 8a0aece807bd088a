"""Reads the run's feed in a bridge process, and notices its end. Uses only the standard library."""

import sys
import threading
from collections.abc import Callable

from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.operate.ros2.arguments import READY, BridgeArguments

RETRY_S = 0.1


def report_ready(end: Callable[[], object]) -> None:
    """Report to the parent process that this one is ready; `end` is called when the standard input ends."""

    def wait() -> None:
        while sys.stdin.buffer.read(4096):
            pass
        end()

    threading.Thread(target=wait, name="parent", daemon=True).start()
    print(READY, flush=True)


class Reading:
    """Calls a function with each message of the feed, from a separate thread."""

    def __init__(
        self, arguments: BridgeArguments, pass_on: Callable[[FeedMessage], None], end: Callable[[], object]
    ) -> None:
        """Start the thread.

        Args:
            arguments: arguments of the bridge.
            pass_on: called with each message.
            end: called when the run or the parent process has ended.
        """
        self._pass_on, self._end = pass_on, end
        self._ended = threading.Event()
        threading.Thread(target=self._read, args=(arguments.feed,), name="feed", daemon=True).start()
        if arguments.child:
            report_ready(self._end_now)
        else:
            print(READY, flush=True)

    def _read(self, path: str) -> None:
        try:
            while not self._ended.wait(RETRY_S):
                try:
                    feed = FeedReader(path)
                except OSError:
                    continue
                for message in feed:
                    self._pass_on(message)
                return
        finally:
            self._end()

    def _end_now(self) -> None:
        self._ended.set()
        self._end()
