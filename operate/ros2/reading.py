"""Reads the run's feed in a bridge process, and notices its end. Needs the standard library alone."""

import sys
import threading
from collections.abc import Callable

from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.operate.ros2.arguments import READY, BridgeArguments

RETRY_S = 0.1


def ready(end: Callable[[], object]) -> None:
    """Tell whoever started this process that it works; `end` is called once the standard input ends."""

    def wait() -> None:
        while sys.stdin.buffer.read(4096):
            pass
        end()

    threading.Thread(target=wait, name="parent", daemon=True).start()
    print(READY, flush=True)


class Reading:
    """Passes on each message of the feed from a thread of its own."""

    def __init__(
        self, arguments: BridgeArguments, pass_on: Callable[[FeedMessage], None], end: Callable[[], object]
    ) -> None:
        """Begin.

        Args:
            arguments: of the bridge.
            pass_on: takes each message.
            end: is called once the run, or whoever started the bridge, has ended.
        """
        self._pass_on, self._end = pass_on, end
        self._ended = threading.Event()
        threading.Thread(target=self._read, args=(arguments.feed,), name="feed", daemon=True).start()
        if arguments.child:
            ready(self._end_now)
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
