"""The cockpit's server: one page, and a WebSocket for each visitor."""

import asyncio
import json
import logging
import secrets
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from footfall.pages.cockpit.access import Access
from footfall.pages.cockpit.freshness import Freshness

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

PAGE = Path(__file__).with_name("cockpit.html")
SOCKET = "/steer"
STATE_INTERVAL_S = 0.1  # between two messages with the run's state
MAX_MESSAGE_BYTES = 2048  # of a visitor's message
MAX_MESSAGES_PER_S = 100  # messages of one visitor
MAX_VISITORS = 8
# Commands that a visitor may send, and their values. No command resets a fault.
COMMANDS = {"take": (), "release": (), "put": ("velocity", "behaviour", "policy", "gait", "settings")}
HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'nonce-{0}'; style-src 'nonce-{0}'; connect-src 'self'; img-src data:;"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Cockpit:
    """Serves the page: forwards commands to the process of the loop, and that process's state to visitors."""

    def __init__(
        self, access: Access, link: Connection, extra_state: Callable[[], dict[str, Any]] = dict
    ) -> None:
        """`link` is connected to a `CockpitLink`; `extra_state` returns further facts about the run."""
        self._access, self._link, self._extra_state = access, link, extra_state
        self._state: dict[str, Any] = {}  # of the run, as last received
        self._visitors: dict[str, ServerConnection] = {}
        self._num_connections = 0
        self._ended = asyncio.Event()

    async def serve(self, host: str, port: int) -> None:
        """Serve until the process of the loop has ended. Sends it `serving` once the page is available."""
        from websockets.asyncio.server import serve

        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        loop = asyncio.get_running_loop()
        options: dict[str, Any] = {"max_size": MAX_MESSAGE_BYTES, "compression": None, "ping_interval": None}
        async with serve(self._serve_visitor, host, port, process_request=self._answer, **options):
            self._link.send_bytes(b'{"serving": true}')
            loop.add_reader(self._link.fileno(), self._receive)
            await self._ended.wait()
            loop.remove_reader(self._link.fileno())
            for visitor in list(self._visitors.values()):
                with suppress(Exception):
                    await asyncio.wait_for(visitor.send(self._message(None)), STATE_INTERVAL_S)

    def _answer(self, connection: "ServerConnection", request: "Request") -> "Response | None":
        """The page, an error, or None to continue with a WebSocket."""
        path = urlsplit(request.path).path
        reason = self._access.refusal(request.path, request.headers, socket=path != "/")
        if reason is not None:
            return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
        if path == SOCKET:
            if len(self._visitors) < MAX_VISITORS:
                return None
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many visitors\n")
        if path != "/":
            return connection.respond(HTTPStatus.NOT_FOUND, "there is no such page\n")
        nonce = secrets.token_urlsafe(16)
        response = connection.respond(HTTPStatus.OK, PAGE.read_text(encoding="utf-8").replace("NONCE", nonce))
        del response.headers["Content-Type"]
        for name, value in HEADERS.items():
            response.headers[name] = value
        response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY.format(nonce)
        response.headers["Set-Cookie"] = self._access.set_cookie
        return response

    async def _serve_visitor(self, connection: "ServerConnection") -> None:
        """Exchange messages with one visitor until the connection ends."""
        self._num_connections += 1
        name, freshness = f"page {self._num_connections}", Freshness()
        self._visitors[name] = connection
        sender = asyncio.create_task(self._send_states(name, connection, freshness))
        try:
            with suppress(Exception):  # any end of the connection
                await self._listen(name, connection, freshness)
        finally:
            sender.cancel()
            del self._visitors[name]
            # The state here may be older than the control: the inbox decides whether the visitor has it.
            self._pass_on(name, {"do": "put", "velocity": [0.0, 0.0, 0.0]})

    async def _send_states(self, name: str, connection: "ServerConnection", freshness: Freshness) -> None:
        with suppress(Exception):
            while True:
                await connection.send(self._message(name, freshness))
                await asyncio.sleep(STATE_INTERVAL_S)

    def _message(self, name: str | None, freshness: Freshness | None = None) -> str:
        """The state of the run for a visitor, with a challenge."""
        message: dict[str, Any] = {"you": name, "run": self._state}
        if freshness is not None:
            message |= {"challenge": freshness.challenge(), "round_trip_s": round(freshness.round_trip_s, 3)}
        return json.dumps(message)

    async def _listen(self, name: str, connection: "ServerConnection", freshness: Freshness) -> None:
        """Pass on a visitor's messages, until the visitor leaves or sends too many."""
        loop = asyncio.get_running_loop()
        current_s, count = 0, 0
        async for content in connection:
            now_s = int(loop.time())
            current_s, count = now_s, count + 1 if now_s == current_s else 1
            if count > MAX_MESSAGES_PER_S:
                return
            refusal = self._handle(name, content, freshness)
            if refusal:
                await connection.send(json.dumps({"refused": refusal}))

    def _handle(self, name: str, content: str | bytes, freshness: Freshness) -> str:
        """Pass a message on; returns why it is refused. A stop is never too old."""
        try:
            message = json.loads(content)
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            return "a message is a JSON object"
        do = message.get("do")
        if do == "stop":
            self._pass_on(name, {"do": "stop", "damp": message.get("damp") is True})
            return ""
        if not isinstance(do, str) or do not in COMMANDS:
            return "there is no such command"
        if refusal := freshness.refusal(message.get("number"), message.get("answer")):
            return refusal
        self._pass_on(name, {"do": do} | {key: message[key] for key in COMMANDS[do] if key in message})
        return ""

    def _pass_on(self, name: str, message: dict[str, Any]) -> None:
        try:
            self._link.send_bytes(json.dumps({"operator": name} | message).encode())
        except OSError:
            self._ended.set()

    def _receive(self) -> None:
        """Receive a message from the process of the loop."""
        try:
            message = json.loads(self._link.recv_bytes())
        except (OSError, EOFError):
            self._ended.set()
            return
        if "run" in message:
            self._state = message["run"] | self._extra_state()
            if self._state.get("ended"):
                self._ended.set()
        elif (visitor := self._visitors.get(message["to"])) is not None:
            task = asyncio.ensure_future(visitor.send(json.dumps({"refused": message["refused"]})))
            task.add_done_callback(lambda done: done.exception())
