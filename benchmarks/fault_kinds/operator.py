"""Operators who stop sending, and external stops."""

from fault_kinds.kind import FaultKind
from footfall.deploy.command_source import Request, Status, Stop
from footfall.operate.inbox import Inbox, InboxConfig
from footfall.plant.injection import FaultInjector

SILENCE = InboxConfig(still_after_s=0.5, lie_down_after_s=1.5)
ORDERLY = "intended: the robot stands after 0.5 s and lies down later; a note gives the reason"


class _Silent:
    """An operator's inbox that gets one request and no other, in the run's time."""

    stopped = None

    def __init__(self, injector: FaultInjector) -> None:
        self._now_s, self._velocity = 0.0, injector.command_source.value
        self._inbox: Inbox | None = None

    def poll(self, status: Status) -> Request:
        self._now_s = status.now_s
        if self._inbox is None:
            self._inbox = Inbox(SILENCE, lambda: self._now_s)
            self._inbox.put("operator", velocity=self._velocity)
        return self._inbox.poll(status)


def _silent(injector: FaultInjector) -> None:
    injector.command_source.other = _Silent(injector)


def _stopped(damp: bool) -> Stop:
    return Stop("stopped by hand", damp)


def _stop(injector: FaultInjector) -> None:
    injector.command_source.stopped = _stopped(damp=False)


def _damp(injector: FaultInjector) -> None:
    injector.command_source.stopped = _stopped(damp=True)


OPERATOR = (
    FaultKind("the operator falls silent", _silent, None, ORDERLY, main=True, observed_s=6.0),
    FaultKind("external stop", _stop, 0.01, main=True),
    FaultKind("external stop with damping", _damp, 0.01, main=True),
)
