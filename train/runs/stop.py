"""Stopping a training between iterations, never inside one."""

import signal
import threading
from types import FrameType, TracebackType


class StopRequest:
    """Turns the first SIGINT, SIGTERM or SIGHUP into a flag; a second one raises KeyboardInterrupt.

    A second SIGHUP does not: a lost connection sends two, from kernel and shell. `nohup` ignores both.
    Only the main thread receives signals: in any other thread `requested` stays False.
    """

    def __init__(self) -> None:
        self.requested = False
        self._previous: dict[int, signal._HANDLER] = {}

    def __enter__(self) -> "StopRequest":
        is_main_thread = threading.current_thread() is threading.main_thread()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if is_main_thread else ():
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                self._previous[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested and number != signal.SIGHUP:
            raise KeyboardInterrupt
        self.requested = True
