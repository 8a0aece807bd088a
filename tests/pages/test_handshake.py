"""Access to the watch page's server, and the page that it serves."""

import http.client
from collections.abc import Iterator

import pytest
from ports import free_port

pytest.importorskip("viser")

from viser import __version__
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from footfall.pages.handshake import refusal
from footfall.pages.page import serving


@pytest.fixture
def page() -> Iterator[int]:
    """The port of a page."""
    port = free_port()
    with serving("localhost", port, "test"):
        yield port


def answer(port: int, origin: str | None) -> int:
    """HTTP status for a WebSocket client with this origin; 101 if viser accepts it and sends its content."""
    try:
        address, viser = f"ws://localhost:{port}", [f"viser-v{__version__}"]
        with connect(address, origin=origin, subprotocols=viser, max_size=None, proxy=None) as connection:
            assert len(connection.recv(timeout=20.0)) > 0
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def fetched(port: int, host: str, path: str = "/") -> tuple[int, str]:
    """Status and text served under this host name.

    Content-Length occurs once and is right: a browser would wait for more, or drop the rest.
    """
    connection = http.client.HTTPConnection("localhost", port, timeout=20.0)
    connection.request("GET", path, headers={"Host": host, "Accept-Encoding": "gzip"})
    response = connection.getresponse()
    content = response.read()
    assert response.headers.get_all("Content-Length") == [str(len(content))]
    return response.status, content.decode()


def test_only_its_own_origin_and_programs_may_connect(page: int) -> None:
    for origin, status in (
        (f"http://localhost:{page}", 101),
        (None, 101),  # no browser: a user who can run programs here does not need the page
        ("http://evil.example", 403),
        (f"http://localhost:{page}.evil.example", 403),
        (f"http://evil-localhost:{page}", 403),
        ("http://localhost:1", 403),
        ("null", 403),  # a sandboxed frame, or a file
    ):
        assert answer(page, origin) == status, origin


def test_a_foreign_host_name_is_refused(page: int) -> None:
    status, text = fetched(page, f"evil.example:{page}")
    assert status == 403
    assert "--host evil.example" in text


def test_the_page_is_footfalls(page: int) -> None:
    for path in ("/", "/index.html", "/?initialCameraPosition=1,2,3"):
        status, text = fetched(page, f"localhost:{page}", path)
        assert status == 200
        assert "<title>footfall</title>" in text
        assert "<title>Viser</title>" not in text


def test_names_of_the_server() -> None:
    for host, served_at, allowed in (
        ("localhost:8080", "localhost", True),
        ("127.0.0.1:8080", "localhost", True),
        ("[::1]:8080", "localhost", True),
        ("192.168.1.7", "0.0.0.0", True),
        ("localhost:8080", "0.0.0.0", True),
        ("lab.example:8080", "lab.example", True),
        ("Lab.example:8080", "lab.Example", True),
        ("lab.example:8080", "0.0.0.0", False),
        (None, "localhost", False),
    ):
        assert (refusal(host, None, served_at) is None) is allowed, host
