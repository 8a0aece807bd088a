"""A command source beside which operators look on, and may stop the robot."""

from footfall.deploy.command_source import CommandSource, Request, Status, Stop
from footfall.operate.inbox import Inbox


class Accompanied:
    """Steers as its source does. The inbox learns of the run, and a stop in it counts, but nothing else."""

    def __init__(self, source: CommandSource, inbox: Inbox) -> None:
        """`source` steers; operators write to `inbox`."""
        self._source, self._inbox = source, inbox

    @property
    def stopped(self) -> Stop | None:
        """A stop by the source or in the inbox; None without one."""
        return self._source.stopped or self._inbox.stopped

    def poll(self, status: Status) -> Request:
        """The source's request."""
        self._inbox.poll(status)
        return self._source.poll(status)
