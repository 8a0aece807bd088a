"""The bridge's end of a run's steering socket (`steering_socket.py`). Uses only the standard library."""

import itertools
import json
import queue
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

MAX_REFUSALS = 100  # maximum number of different refusals reported, each once
ANSWER_TIMEOUT_S = 1.0  # maximum wait for an answer
SILENT = "the run does not answer"


class Link:
    """Sends requests to a run and receives its status."""

    def __init__(
        self, path: str, on_status: Callable[[dict[str, Any]], None], on_refused: Callable[[str], None]
    ) -> None:
        """Connect. Both functions are called from another thread.

        Args:
            path: path of the socket.
            on_status: called with each status of the run.
            on_refused: called with the reason if something sent with `post` is refused.

        Raises:
            OSError: no process listens on the socket.
        """
        self._on_status, self._on_refused = on_status, on_refused
        self._refusals: set[str] = set()
        self._numbers = itertools.count()
        self._answers: dict[int, queue.SimpleQueue[str]] = {}
        self._sending = threading.Lock()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(path)
        self.closed = threading.Event()
        threading.Thread(target=self._read, name="run's steering", daemon=True).start()

    def request(self, **content: Any) -> str:
        """Send a request and wait for the answer: why it is refused; empty if it is accepted."""
        number = next(self._numbers)
        answer = self._answers[number] = queue.SimpleQueue()
        try:
            self._send({"id": number, **content})
            return answer.get(timeout=ANSWER_TIMEOUT_S)
        except (OSError, queue.Empty):
            return SILENT
        finally:
            del self._answers[number]

    def post(self, **content: Any) -> None:
        """Send a request without waiting."""
        try:
            self._send(content)
        except OSError:
            self.closed.set()

    def _send(self, message: dict[str, Any]) -> None:
        with self._sending:
            self._socket.sendall(json.dumps(message).encode() + b"\n")

    def _read(self) -> None:
        try:
            with suppress(OSError, ValueError), self._socket.makefile("rb") as lines:
                for line in lines:
                    message = json.loads(line)
                    if "status" in message:
                        self._on_status(message["status"])
                    elif (answer := self._answers.get(message.get("id"))) is not None:
                        answer.put(message["refused"])
                    elif (why := message["refused"]) and len(self._refusals) < MAX_REFUSALS:
                        if why not in self._refusals:
                            self._on_refused(why)
                        self._refusals.add(why)
        finally:  # a bridge that no longer hears the run has to end
            self.closed.set()
