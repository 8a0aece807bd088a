"""The server of the page: its address, who may connect, its end, and the processes that serve it."""

import errno
import http.client
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ports import free_port, listens, wait_until_served
from refused import refusal_of
from shell import Shell

from footfall.common.errors import UserError
from footfall.pages import beside, page
from footfall.pages.handshake import refusal

FREE, TAKEN, NOT_OURS, NO_IPV6 = 0, errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT
ADDRESSES = [
    (socket.AF_INET6, socket.SOCK_STREAM, 6, "", ("::1", 80, 0, 0)),
    (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", 80)),
]


def check(monkeypatch: pytest.MonkeyPatch, *found: int) -> None:
    """Check a host name of one or two addresses, each in a given state."""
    refusals = [OSError(code, os.strerror(code)) if code else None for code in found]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: ADDRESSES[: len(found)])
    monkeypatch.setattr(page, "_refusal", lambda *_: refusals.pop(0))
    page.check_page("lab", 80)


def test_one_free_address_is_enough_unless_another_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    for found in ((FREE,), (FREE, FREE), (NOT_OURS, FREE), (FREE, NO_IPV6), (NO_IPV6, FREE)):
        check(monkeypatch, *found)
    for found, reason in (
        ((FREE, TAKEN), TAKEN),  # viser would quietly take another port for one of them
        ((TAKEN,), TAKEN), ((TAKEN, FREE), TAKEN), ((NOT_OURS, TAKEN), TAKEN),
        ((NOT_OURS, NOT_OURS), NOT_OURS), ((NO_IPV6, NOT_OURS), NO_IPV6),
    ):  # fmt: skip
        assert f"lab:80: {os.strerror(reason)}" in refusal_of(check, monkeypatch, *found)


def test_viser_is_an_extra(shell: Shell, finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "[watch]'" in shell.refuses("watch", finished)
    assert "[watch]'" in shell.refuses("train", "--watch")


# Early, packages are imported that swallow a KeyboardInterrupt; later, a robot walks.
@pytest.mark.parametrize(("number", "delay_s"), [(signal.SIGINT, 0.1), (signal.SIGTERM, 2.0)])
def test_a_page_ends_quietly(finished: Path, number: signal.Signals, delay_s: float) -> None:
    port = free_port()
    command = [sys.executable, "-m", "footfall", "watch", finished, "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        wait_until_served(port)
        time.sleep(delay_s)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, err) == (0, "")
    assert out.count("\n") == 1
    assert f"http://localhost:{port}" in out


def test_beside_a_training_it_lasts_as_long_as_the_training(begun: Path) -> None:
    port = free_port()
    with beside.watched(begun, "localhost", port):
        wait_until_served(port)
    assert not listens(port)


def test_the_reason_for_the_pages_end_is_reported_although_its_output_is_discarded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def watch(*_: object) -> None:
        print("a library's greeting")
        raise UserError("port 8080 is taken")

    monkeypatch.setattr("footfall.pages.walk.watch", watch)
    monkeypatch.setattr(beside, "end_with_parent", lambda: None)
    monkeypatch.setattr(os, "nice", lambda _: 0)
    beside._serve(tmp_path, "localhost", 8080)
    assert capsys.readouterr() == ("", "footfall: the page ended: port 8080 is taken\n")


RUN = """
import sys, time
from pathlib import Path
from footfall.pages.run_page import viewed
from footfall.robots.description import load_robot

if __name__ == "__main__":
    with viewed(load_robot("go1"), Path(sys.argv[1]), "localhost", int(sys.argv[2])):
        time.sleep(600.0)
"""


def test_a_killed_run_takes_its_page_with_it_so_that_the_next_run_has_the_port(tmp_path: Path) -> None:
    port, script = free_port(), tmp_path / "run.py"
    script.write_text(RUN)
    run = subprocess.Popen([sys.executable, script, tmp_path / "feed", str(port)])
    try:
        wait_until_served(port)
        run.kill()
        wait_until_served(port, False)
    finally:
        run.kill()
        run.wait()


@pytest.fixture
def served() -> Iterator[int]:
    """The port of a page."""
    port = free_port()
    with page.serving("localhost", port, "test"):
        yield port


def answer(port: int, origin: str | None) -> int:
    """HTTP status for a WebSocket client with this origin; 101 if viser accepts it and sends its content."""
    from viser import __version__
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

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


def test_only_its_own_origin_and_programs_may_connect(served: int) -> None:
    for origin, status in (
        (f"http://localhost:{served}", 101),
        (None, 101),  # no browser: a user who can run programs here does not need the page
        ("http://evil.example", 403), (f"http://localhost:{served}.evil.example", 403),
        (f"http://evil-localhost:{served}", 403), ("http://localhost:1", 403),
        ("null", 403),  # a sandboxed frame, or a file
    ):  # fmt: skip
        assert answer(served, origin) == status, origin


def test_the_page_is_footfalls_and_not_for_a_foreign_host_name(served: int) -> None:
    status, text = fetched(served, f"evil.example:{served}")
    assert status == 403
    assert "--host evil.example" in text
    for path in ("/", "/index.html", "/?initialCameraPosition=1,2,3"):
        status, text = fetched(served, f"localhost:{served}", path)
        assert status == 200
        assert "<title>footfall</title>" in text
        assert "<title>Viser</title>" not in text


def test_names_of_the_server() -> None:
    for host, served_at, allowed in (
        ("localhost:8080", "localhost", True), ("127.0.0.1:8080", "localhost", True),
        ("[::1]:8080", "localhost", True), ("192.168.1.7", "0.0.0.0", True),
        ("localhost:8080", "0.0.0.0", True), ("lab.example:8080", "lab.example", True),
        ("Lab.example:8080", "lab.Example", True), ("lab.example:8080", "0.0.0.0", False),
        (None, "localhost", False),
    ):  # fmt: skip
        assert (refusal(host, None, served_at) is None) is allowed, host
