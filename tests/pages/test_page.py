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
from shell import Shell

from footfall.common.errors import UserError
from footfall.pages import page
from footfall.pages.page import check_page
from footfall.policies.registry import ZOO

HERE = ("::1", "127.0.0.1")


FREE, TAKEN, NOT_OURS, NO_IPV6 = 0, errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT


def checked(monkeypatch: pytest.MonkeyPatch, *found: int) -> None:
    """Check a host name with two addresses, each in a given state."""
    answers = iter(found)
    addresses = [
        (socket.AF_INET6, socket.SOCK_STREAM, 6, "", (HERE[0], 80, 0, 0)),
        (socket.AF_INET, socket.SOCK_STREAM, 6, "", (HERE[1], 80)),
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
    assert str(caught.value) == (
        f"cannot serve a page at lab:80: {os.strerror(reason)}; give another --host or --port"
    )


POLICY = ZOO / "go1-flat" / "policy.onnx"


FOOTFALL = [sys.executable, "-m", "footfall"]


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture
def port() -> int:
    """An address without a listener."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("localhost", port)) == 0


def wait_until(condition, limit_s: float = 120.0) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


class TestCommand:
    def test_a_port_that_was_just_closed_is_free(self) -> None:
        """The system holds it for a while after a connection that the server ended."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
            with socket.create_connection(("127.0.0.1", port)) as visitor:
                server.accept()[0].close()
                assert visitor.recv(1) == b""
        check_page("127.0.0.1", port)

    def test_viser_is_an_extra(self, shell: Shell, finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "viser", None)
        assert "[watch]'" in shell.refuses("watch", finished)
        assert "[watch]'" in shell.refuses("train", "--watch")

    def test_a_policy_of_another_robot_is_reported(self, shell: Shell, begun: Path, port: int) -> None:
        onnx = pytest.importorskip("onnx")
        model = onnx.load(POLICY)
        (entry,) = (entry for entry in model.metadata_props if entry.key == "footfall.contract")
        entry.value = entry.value.replace('"robot": "go1"', '"robot": "other"')
        onnx.save(model, begun / "policy.onnx")
        outcome = shell("watch", begun, "--port", str(port))
        assert outcome.status == 2
        assert outcome.err.count("\n") == 1
        assert "does not fit" in outcome.err

    # Early, packages are imported that swallow a KeyboardInterrupt; later, a robot walks.
    @pytest.mark.parametrize(("number", "delay_s"), [(signal.SIGINT, 0.1), (signal.SIGTERM, 2.0)])
    def test_it_ends_quietly(self, finished: Path, port: int, number: signal.Signals, delay_s: float) -> None:
        process = subprocess.Popen(
            [*FOOTFALL, "watch", finished, "--port", str(port)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            wait_until(lambda: listens(port))
            time.sleep(delay_s)
            process.send_signal(number)
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
        assert (process.returncode, err) == (0, "")
        assert out.count("\n") == 1
        assert f"http://localhost:{port}" in out

    def test_beside_a_training_it_lasts_as_long_as_the_training(self, begun: Path, port: int) -> None:
        from footfall.pages.beside import watched

        with watched(begun, "localhost", port):
            wait_until(lambda: listens(port))
        assert not listens(port)

    def test_it_does_not_outlive_a_training_that_is_killed(self, begun: Path, port: int) -> None:
        code = (
            "import sys, time; from pathlib import Path; from footfall.pages.beside import watched\n"
            "if __name__ == '__main__':\n"
            "    with watched(Path(sys.argv[1]), 'localhost', int(sys.argv[2])): time.sleep(60)\n"
        )
        script = begun.parent / "training.py"
        script.write_text(code)
        process = subprocess.Popen([sys.executable, script, begun, str(port)])
        wait_until(lambda: listens(port))
        process.kill()
        process.wait()
        wait_until(lambda: not listens(port))
