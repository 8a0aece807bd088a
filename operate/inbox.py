"""Passes requests of operators to the loop: the newest one of the owner, and a stop of any operator.

A page, a keyboard or a network has its own threads, which put requests into the inbox; the loop polls it. One
operator at a time owns the control of the robot. Another one has to take over explicitly. Anyone may stop.
Times are arrival times by this computer's monotonic clock; senders' clocks are not used. While the owner is
silent, its last request becomes too old: first the velocity becomes zero, later the robot lies down.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from footfall.common.config import require_between
from footfall.deploy.command_source import ZERO_COMMAND, Behaviour, Request, Status, Stop
from footfall.deploy.modes import Mode
from footfall.deploy.steering import NO_GET_UP
from footfall.operate.request_fields import (
    MAX_NAME_CHARS,
    checked_behaviour,
    checked_name,
    checked_settings,
    checked_velocity,
    name_refusal,
)
from footfall.policies.live_settings import DECLARED, Access

MAX_NOTE_CHARS = 200  # maximum length


@dataclass(frozen=True)
class InboxConfig:
    """Limits of an owner's silence."""

    still_after_s: float = 0.45  # until the velocity is zero: within 0.5 s, including a policy step
    lie_down_after_s: float = 10.0  # until the robot stops and lies down, and the run ends

    def __post_init__(self) -> None:
        require_between(self, 0.05, 60.0, "still_after_s")
        require_between(self, 0.05, 3600.0, "lie_down_after_s")
        if self.lie_down_after_s < self.still_after_s:
            raise ValueError("lie_down_after_s must be at least still_after_s")


class _Latest(NamedTuple):
    """The newest request and its times."""

    request: Request
    received_s: float  # arrival of the owner's last message
    velocity_s: float  # arrival of the owner's last velocity


class Inbox:
    """A command source that operators can write to from any thread."""

    def __init__(
        self, config: InboxConfig | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Start without an owner. `clock` returns local time, s."""
        self._config, self._clock = config or InboxConfig(), clock
        self._lock = threading.Lock()
        self._owner = ""
        self._latest = _Latest(Request(ZERO_COMMAND), clock(), clock())
        self._still_request: Request | None = None  # replaces a request whose velocity is too old
        self._stop: Stop | None = None
        self._status: Status | None = None
        self._walking_since_s = clock()  # the owner's silence counts only while the robot walks
        self._last_request: Request | None = None  # ends the run, even if the owner sends again

    def set_longest_silence(self, longest_s: float) -> None:
        """Set the silence, s, that ends the run; call it before the start of the run."""
        self._config = replace(self._config, lie_down_after_s=longest_s)

    # -- called by operators, from any thread --------------------------------------------------------

    @property
    def owner(self) -> str:
        """Name of the operator in control; empty if there is none."""
        return self._owner

    @property
    def status(self) -> Status | None:
        """Status at the latest poll; None before the first one."""
        return self._status

    def take_over(self, operator: str) -> str:
        """Take control, whoever has it. The robot stands until the new owner's first request.

        Returns:
            Why it is refused, in one line; empty if it is accepted.
        """
        if refusal := name_refusal(operator):
            return refusal
        with self._lock:
            if self._owner != operator:
                self._owner, self._still_request = operator, None
                now_s = self._clock()
                request = self._latest.request._replace(velocity=ZERO_COMMAND, owner=operator)
                self._latest = _Latest(request, now_s, now_s)
        return ""

    def release(self, operator: str) -> str:
        """Give up control: the robot stands, and later lies down. Returns the same as `take_over`."""
        with self._lock:
            if self._owner != operator:
                return self._not_owner(operator)
            self._owner, self._still_request = "", None
            request = self._latest.request._replace(velocity=ZERO_COMMAND, owner="")
            self._latest = self._latest._replace(request=request)
        return ""

    def put(
        self,
        operator: str,
        velocity: Any = None,
        behaviour: Any = None,
        policy: Any = None,
        gait: Any = None,
        settings: Any = None,
    ) -> str:
        """Send a request; omitted parts stay unchanged. The first operator to send one gets control.

        A velocity ages separately: other requests of its owner do not renew it.

        Arguments may have any type. A wrong type or shape, a number that is not finite or a name that is
        unknown in the run is refused; the whole request then has no effect.

        Args:
            operator: name of the sender.
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s, body frame.
            behaviour: a `Behaviour` or its text.
            policy, gait: names.
            settings: live settings by name.

        Returns:
            Why it is refused, in one line; empty if it is accepted.
        """
        offer = None if self._status is None else self._status.offer
        changes: dict[str, Any] = {}
        try:
            if velocity is not None:
                changes["velocity"] = checked_velocity(velocity)
            if behaviour is not None:
                changes["behaviour"] = checked_behaviour(behaviour)
            if changes.get("behaviour") is Behaviour.GET_UP and offer is not None and not offer.get_up:
                return NO_GET_UP
            if policy is not None:
                changes["policy"] = checked_name("policy", policy, offer and offer.policies)
            if gait is not None:
                changes["gait"] = checked_name("gait", gait, offer and offer.gaits)
            if settings is not None:
                changes["settings"] = checked_settings(settings, offer)
        except ValueError as error:
            return str(error)
        refusal = name_refusal(operator)
        with self._lock:
            if not refusal and self._owner not in ("", operator):
                refusal = self._permission(operator, changes)
            if refusal:
                return refusal
            before, now_s = self._latest.request, self._clock()
            if "settings" in changes:
                changes["settings"] = {**before.settings, **changes["settings"]}
            request = before._replace(**changes)
            if self._owner in ("", operator):
                self._owner = operator
                velocity_s = now_s if "velocity" in changes else self._latest.velocity_s
                request = request._replace(owner=operator, settings_by="")
                self._latest = _Latest(request, now_s, velocity_s)
            else:
                self._latest = self._latest._replace(request=request._replace(settings_by=operator))
            self._still_request = None
        return ""

    def stop(self, operator: str, reason: str = "", damp: bool = False) -> None:
        """Stop the robot, whoever has control. The stop is latched until a new run.

        A second stop, while the robot lies down, damps it at once.

        Args:
            operator: name of the sender.
            reason: reason for the stop.
            damp: damp the joints at once; otherwise the robot lies down if it can.
        """
        by = str(operator)[:MAX_NAME_CHARS] or "an operator"
        suffix = f": {str(reason)[:MAX_NAME_CHARS]}" if reason else ""
        with self._lock:
            again = self._stop is not None
            self._stop = Stop(" ".join(f"stopped by {by}{suffix}".split()), damp or again, by)

    def note(self, text: Any) -> None:
        """Add a line to the run's notes."""
        line = " ".join(str(text).split())[:MAX_NOTE_CHARS]
        with self._lock:
            self._latest = self._latest._replace(request=self._latest.request._replace(note=line))
            self._still_request = None

    # -- called by the loop --------------------------------------------------------------------------

    @property
    def stopped(self) -> Stop | None:
        """The requested stop; None if there was none."""
        return self._stop

    def poll(self, status: Status) -> Request:
        """The owner's newest request, without its outdated parts."""
        self._status = status
        with self._lock:
            request, received_s, velocity_s = self._latest
            if self._last_request is not None:
                return self._last_request
            if status.mode is not Mode.WALKING:  # the robot is not under command yet
                self._walking_since_s = self._clock()
                return request
            if request.behaviour is Behaviour.GET_UP:
                # The robot stands again: after another fall, getting up needs a new request.
                request = request._replace(behaviour=Behaviour.WALK)
                self._latest = self._latest._replace(request=request)
            now_s = self._clock()
            if now_s - max(received_s, self._walking_since_s) >= self._config.lie_down_after_s:
                silent = f"'{self._owner}', who has control," if self._owner else "every operator"
                note = f"{silent} was silent for {self._config.lie_down_after_s:g} s: the robot lies down"
                request = request._replace(velocity=ZERO_COMMAND, behaviour=Behaviour.LIE_DOWN)
                self._last_request = request._replace(note=note, owner="")
                return self._last_request
            if now_s - velocity_s < self._config.still_after_s:
                return request
            if self._still_request is None:
                self._still_request = request._replace(velocity=ZERO_COMMAND)
            return self._still_request

    def _not_owner(self, operator: str) -> str:
        return f"{self._owner or 'nobody'} has control, not {operator}: take over first"

    def _permission(self, operator: str, changes: Mapping[str, Any]) -> str:
        """Why an operator without control may not change this; empty if anyone may."""
        settings = changes.get("settings", {})
        if set(changes) == {"settings"} and all(DECLARED[n].access is Access.ANYONE for n in settings):
            return ""
        return self._not_owner(operator)
