"""A command source whose run operators watch; they can stop the robot."""

from footfall.deploy.command_source import CommandSource, Request, Status, Stop
from footfall.operate.inbox import Inbox


class Accompanied:
    """Forwards its source's requests. The inbox gets the status; of its content, only a stop is used."""

    def __init__(self, source: CommandSource, inbox: Inbox) -> None:
        """`source` gives the commands; operators write to `inbox`."""
        self._source, self._inbox = source, inbox

    @property
    def stopped(self) -> Stop | None:
        """A stop by the source or by an operator; None if there was none."""
        return self._source.stopped or self._inbox.stopped

    def poll(self, status: Status) -> Request:
        """The source's request."""
        self._inbox.poll(status)
        return self._source.poll(status)
