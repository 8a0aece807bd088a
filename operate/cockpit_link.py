"""Connects the control loop to the cockpit: a thread forwards a page's commands to the inbox, and the state
back.

The page is served by another process, to keep its work out of the loop's process. If it stalls or ends, the
inbox gets nothing any more, and applies its rules for a silent operator.
"""

import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from footfall.deploy.command_source import Status
from footfall.operate.inbox import Inbox
from footfall.policies.live_settings import DECLARED

STATE_INTERVAL_S = 0.1  # interval between states
MAX_MESSAGE_BYTES = 4096  # maximum message size
JOIN_TIMEOUT_S = 1.0  # maximum wait for a process that does not read


class CockpitLink:
    """Connects a page's process to an inbox."""

    def __init__(
        self, inbox: Inbox, connection: Connection, extra_state: Callable[[], Mapping[str, Any]] = dict
    ) -> None:
        """Start the thread.

        Args:
            inbox: gets the commands.
            connection: connection to the process that serves the page.
            extra_state: returns further facts about the run, for JSON; called from the link's thread.
        """
        self._inbox, self._connection, self._extra_state = inbox, connection, extra_state
        self._steered, self._ended = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="cockpit", daemon=True)
        self._thread.start()

    def wait_until_steered(self, timeout_s: float | None = None) -> bool:
        """Wait until an operator has taken control; False after the timeout."""
        return self._steered.wait(timeout_s)

    def close(self) -> None:
        """Send a last state and end the thread."""
        self._ended.set()
        self._thread.join(JOIN_TIMEOUT_S)

    def _run(self) -> None:
        next_s = time.monotonic()
        with suppress(OSError, EOFError):  # if the other process is gone, the inbox notices the silence
            while not self._ended.is_set():
                if self._connection.poll(max(0.0, next_s - time.monotonic())):
                    self._handle(self._connection.recv_bytes(MAX_MESSAGE_BYTES))
                if time.monotonic() >= next_s:
                    next_s = time.monotonic() + STATE_INTERVAL_S
                    self._send({"run": self._state()})
            self._send({"run": self._state() | {"ended": True}})

    def _handle(self, content: bytes) -> None:
        message = json.loads(content)
        operator = message.pop("operator")
        try:
            refusal = self._carry_out(operator, **message)
        except Exception as error:  # a bad message must not end this thread
            refusal = f"{type(error).__name__}: {error}"[:200]
        if refusal:
            self._send({"to": operator, "refused": refusal})

    def _carry_out(self, operator: str, do: str, **fields: Any) -> str:
        """Carry out an operator's request; returns why it is refused, or an empty string."""
        match do:
            case "take":
                refusal = self._inbox.take_over(operator)
                if not refusal:
                    self._steered.set()
                return refusal
            case "release":
                return self._inbox.release(operator)
            case "stop":
                damp = fields.get("damp") is True
                if damp or self._inbox.stopped is None:  # a page repeats a stop until it sees the effect
                    self._inbox.stop(operator, damp=damp)
                return ""
            case "put" if self._inbox.owner == operator:
                return self._inbox.put(operator, **fields)
        return "take control first" if do == "put" else f"there is no '{do}'"

    def _send(self, message: Mapping[str, Any]) -> None:
        self._connection.send_bytes(json.dumps(message).encode())

    def _state(self) -> dict[str, Any]:
        """State of the run, for JSON."""
        status, stop = self._inbox.status, self._inbox.stopped
        state = {"owner": self._inbox.owner, "stopped": None if stop is None else stop.reason}
        try:
            return state | ({} if status is None else described(status)) | dict(self._extra_state())
        except Exception as error:  # commands and stops must still work
            return state | {"notes": [f"the state cannot be shown: {type(error).__name__}: {error}"[:200]]}


def described(status: Status) -> dict[str, Any]:
    """A run's status for JSON; None for unknown values."""
    offer = status.offer
    return {
        "now_s": round(status.now_s, 3),
        "walking_s": round(status.walking_s, 3),
        "mode": status.mode.value,
        "policy": status.policy,
        "command": _numbers(status.command),
        "velocity": _numbers(status.velocity),
        "height_m": _number(status.height_m),
        "pose": _numbers(status.pose),
        "faults": list(status.faults),
        "notes": list(status.notes)[-20:],
        "charge": _number(status.charge),
        "policies": list(offer.policies),
        "get_up": offer.get_up,
        "gaits": list(offer.gaits),
        "gait": status.applied.gait,
        "applied": {name: _number(value) for name, value in status.applied.settings.items()},
        "ranges": None if offer.commands is None else [list(each) for each in vars(offer.commands).values()],
        "settings": [
            {"name": name, "about": DECLARED[name].about, "unit": DECLARED[name].unit, **span._asdict()}
            for name, span in offer.settings.items()
        ],
    }


def _numbers(values: Any) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None
