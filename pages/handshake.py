"""Additions to viser's web server: a check of the client, and a page with footfall's title and colour scheme.

viser 1.1 accepts a WebSocket from any page that the visitor has open, so that any web site could move the
robot on the page. It has no hook for its handshake and none for its page. Therefore this module replaces the
function with which viser starts its server. Remove it when viser compares Origin with Host (then
`tests/pages/test_page.py` passes without it) and has settings for title and colour scheme.
"""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

HEAD = Path(__file__).with_name("head.html")  # inserted in place of the page's title
PAGE = ("/", "/index.html")


def refusal(host: str | None, origin: str | None, served_at: str) -> str | None:
    """Why a request is refused; None if it is not.

    A page may connect only to the server that it came from. A program other than a browser sends no origin
    and is accepted. The server's name in the request must be one that no other machine can redirect here: an
    IP address, localhost, this machine's name, or `served_at`.

    Args:
        host: the request's Host header, NAME[:PORT].
        origin: its Origin header, if it has any.
        served_at: address at which the server listens.
    """
    try:
        name = urlsplit(f"//{host or ''}").hostname or ""
    except ValueError:  # such as an incomplete IPv6 address
        return "the request names no host"
    machine = socket.gethostname().lower()
    if not _is_address(name) and name not in {"localhost", served_at.lower(), machine, f"{machine}.local"}:
        return f"this page is not served as '{name}': start it with --host {name or 'NAME'}, or use localhost"
    if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
        return f"the page from {origin} may not connect to this server"
    return None


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


@contextmanager
def own_handshake(served_at: str) -> Iterator[None]:
    """Make a viser server that is started in this context check each request and serve footfall's page."""
    from websockets.asyncio import server

    serve = server.serve

    def start(*arguments: Any, process_request: Callable, **options: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            reason = refusal(request.headers.get("Host"), request.headers.get("Origin"), served_at)
            if reason is not None:
                return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
            if request.path.partition("?")[0] not in PAGE:
                return process_request(connection, request)
            request.headers.pop("Accept-Encoding", None)  # viser would send its compressed page
            response = process_request(connection, request)
            return response if response is None else _with_own_head(response)

        return serve(*arguments, process_request=process, **options)

    server.serve = start  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def _with_own_head(response: Any) -> Any:
    """The page with footfall's head."""
    response.body = response.body.replace(b"<title>Viser</title>", HEAD.read_bytes(), 1)
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    return response
