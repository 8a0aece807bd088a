"""The server of the page: address, ends, and the processes that serve it."""

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
from refused import refusal_of
from shell import Shell

from footfall.common.errors import UserError
from footfall.pages import beside, page

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
        ((TAKEN,), TAKEN),
        ((FREE, TAKEN), TAKEN),  # viser would quietly take another port for one of them
        ((TAKEN, FREE), TAKEN),
        ((NOT_OURS, TAKEN), TAKEN),
        ((NOT_OURS, NOT_OURS), NOT_OURS),
        ((NO_IPV6, NOT_OURS), NO_IPV6),
    ):
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
