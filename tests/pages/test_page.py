"""The server of the page: address, ends, and the command that starts it."""

import errno
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ports import free_port, listens, wait_until_served
from shell import Shell

from footfall.common.errors import UserError
from footfall.pages import page

FREE, TAKEN, NOT_OURS, NO_IPV6 = 0, errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT


def checked(monkeypatch: pytest.MonkeyPatch, *found: int) -> None:
    """Check a host name with two addresses, each in a given state."""
    answers = iter(found)
    addresses = [
        (socket.AF_INET6, socket.SOCK_STREAM, 6, "", ("::1", 80, 0, 0)),
        (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", 80)),
    ]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: addresses[: len(found)])

    def refusal(*_: object) -> OSError | None:
        code = next(answers)
        return OSError(code, os.strerror(code)) if code else None

    monkeypatch.setattr(page, "_refusal", refusal)
    page.check_page("lab", 80)


@pytest.mark.parametrize("found", [(FREE,), (FREE, FREE), (NOT_OURS, FREE), (FREE, NO_IPV6), (NO_IPV6, FREE)])
def test_one_free_address_is_enough(monkeypatch: pytest.MonkeyPatch, found: tuple[int, ...]) -> None:
    checked(monkeypatch, *found)


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        ((TAKEN,), TAKEN),
        ((FREE, TAKEN), TAKEN),  # viser would quietly take another port for one of them
        ((TAKEN, FREE), TAKEN),
        ((NOT_OURS, TAKEN), TAKEN),
        ((NOT_OURS, NOT_OURS), NOT_OURS),
        ((NO_IPV6, NOT_OURS), NO_IPV6),
    ],
)
def test_taken_or_foreign_addresses_are_refused(
    monkeypatch: pytest.MonkeyPatch, found: tuple[int, ...], reason: int
) -> None:
    with pytest.raises(UserError) as caught:
        checked(monkeypatch, *found)
    assert f"lab:80: {os.strerror(reason)}" in str(caught.value)


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
    from footfall.pages.beside import watched

    port = free_port()
    with watched(begun, "localhost", port):
        wait_until_served(port)
    assert not listens(port)
