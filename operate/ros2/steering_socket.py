"""The run's end of a Unix socket for commands from a bridge: lines of JSON in both directions.

From the bridge, one request per line, each with some of these keys:

    {"id": 7, "velocity": [0.5, 0, 0], "behaviour": "walk", "gait": "trot", "settings": {"roll_rad": 0.1}}
    {"id": 8, "stop": "a service"}    {"id": 9, "take_over": true}    {"note": "for the run's notes"}
    {"id": 10, "path": [[1, 0], [1, 2]], "yaw_rad": 1.57, "goal": 3}    {"id": 11, "path": null}

To the bridge: for each request `{"id": 7, "refused": ""}` with the reason or nothing; and ten times a second
`{"status": {...}}`.

The inbox checks all values. Until the first request, the bridge counts as an operator who stands still; after
it, the rules for silence apply. When the bridge disconnects, it loses control.
"""

import json
import os
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from footfall.deploy.command_source import ZERO_COMMAND, Status
from footfall.operate.inbox import Inbox
from footfall.operate.request_fields import FIELDS, FORMER_FIELDS, request_fields
from footfall.operate.ros2.path_source import PathSource, PathState

STATUS_EVERY_S = 0.1
MAX_LINE_BYTES = 2**20  # bytes
OTHER_KEYS = ("stop", "take_over", "note", "path")


class SteeringSocket:
    """Serves one bridge at a time, in a separate thread."""

    def __init__(self, path: Path, inbox: Inbox, paths: PathSource, operator: str) -> None:
        """Listen; only this user can connect.

        Args:
            path: path of the socket, in a folder of this run.
            inbox: gets the bridge's requests.
            paths: walks along requested paths; the run's command source.
            operator: the bridge's name in the inbox.
        """
        self._inbox, self._paths, self._operator = inbox, paths, operator
        self._ended = threading.Event()
        self._requested = False  # whether there was any request
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(os.fspath(path))
        self._listener.listen(1)
        self._listener.settimeout(STATUS_EVERY_S)
        self._thread = threading.Thread(target=self._serve, name="steering socket", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect the bridge."""
        self._ended.set()
        self._thread.join(10 * STATUS_EVERY_S)
        self._listener.close()

    def _serve(self) -> None:
        while not self._ended.is_set():
            with suppress(TimeoutError):
                bridge, _ = self._listener.accept()
                with bridge, suppress(OSError):
                    bridge.settimeout(STATUS_EVERY_S)
                    self._converse(bridge)
                self._paths.leave()
                self._inbox.release(self._operator)
                if not self._ended.is_set():
                    self._inbox.note(f"{self._operator}: the bridge is gone")

    def _converse(self, bridge: socket.socket) -> None:
        """Serve one bridge until it disconnects."""
        received, notes_sent, due_s = bytearray(), 0, 0.0
        while not self._ended.is_set():
            status = self._inbox.status
            if time.monotonic() >= due_s and status is not None:
                status_fields = described(status, self._inbox.owner, self._paths.state, notes_sent)
                bridge.sendall(_line({"status": status_fields}))
                self._stand_until_first_request()
                notes_sent, due_s = len(status.notes), time.monotonic() + STATUS_EVERY_S
            try:
                content = bridge.recv(4096)
            except TimeoutError:
                continue
            if not content or len(received) > MAX_LINE_BYTES:
                return
            *lines, incomplete = (received + content).split(b"\n")
            received = bytearray(incomplete)
            for line in lines:
                bridge.sendall(self._answer(line))

    def _stand_until_first_request(self) -> None:
        """Send a zero velocity for the bridge, so that the user has time to start a publisher of commands."""
        if not self._requested and self._inbox.owner in ("", self._operator):
            self._inbox.put(self._operator, velocity=ZERO_COMMAND)

    def _answer(self, line: bytes | bytearray) -> bytes:
        try:
            request = json.loads(line)
        except (ValueError, RecursionError):
            request = None
        if not isinstance(request, dict):
            return _line({"refused": "a request is an object in JSON"})
        number = request.pop("id", None)
        return _line({"id": number, "refused": self._carry_out(request)})

    def _carry_out(self, request: dict[str, Any]) -> str:
        """Carry out a request; returns why it is refused, empty if it is accepted."""
        self._requested = self._requested or "note" not in request
        if "stop" in request:
            self._inbox.stop(self._operator, request["stop"])
            return ""
        if "take_over" in request:
            return self._inbox.take_over(self._operator)
        if "note" in request:
            self._inbox.note(request["note"])
            return ""
        if "path" in request:
            return self._path(**request)
        if unknown := sorted(set(request) - {*FIELDS, *FORMER_FIELDS}):
            return f"there is no request '{unknown[0]}': {', '.join((*FIELDS, *OTHER_KEYS))}"
        return self._paths.put(**request_fields(request))

    def _path(self, path: Any, yaw_rad: Any = None, goal: Any = 0) -> str:
        if path is None:
            self._paths.leave()
            return ""
        return self._paths.follow(path, yaw_rad, goal)


def described(status: Status, owner: str, path: PathState | None, notes_from: int = 0) -> dict[str, Any]:
    """A run's status as plain values for JSON, with its notes from index `notes_from` on."""
    offer = status.offer
    return {
        "mode": status.mode,
        "walking_s": status.walking_s,
        "policy": status.policy,
        "command": status.command.tolist(),
        "velocity": status.velocity.tolist(),
        "height_m": status.height_m,
        "pose": list(status.pose),
        "charge": status.charge,
        "faults": list(status.faults),
        "notes": list(status.notes[notes_from:]),
        "owner": owner,
        "path": None if path is None else path._asdict(),
        "policies": list(offer.policies),
        "gaits": list(offer.gaits),
        "settings": {name: list(span) for name, span in offer.settings.items()},
    }


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode() + b"\n"
