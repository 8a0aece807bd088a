"""Where a page can be served, and what is said where it cannot."""

import errno
import os
import socket

import pytest

pytest.importorskip("viser")

from footfall.common.errors import UserError
from footfall.pages import page

HERE = ("::1", "127.0.0.1")
FREE, TAKEN, NOT_OURS, NO_IPV6 = 0, errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT


def checked(monkeypatch: pytest.MonkeyPatch, *found: int) -> None:
    """Check a name that stands for two addresses, of which each is as it is said here."""
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
    page._check_address("lab", 80)


@pytest.mark.parametrize("found", [(FREE,), (FREE, FREE), (NOT_OURS, FREE), (FREE, NO_IPV6), (NO_IPV6, FREE)])
def test_one_address_that_is_ours_and_free_is_enough(
    monkeypatch: pytest.MonkeyPatch, found: tuple[int, ...]
) -> None:
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
def test_an_address_that_is_taken_or_none_that_is_ours_is_told(
    monkeypatch: pytest.MonkeyPatch, found: tuple[int, ...], reason: int
) -> None:
    with pytest.raises(UserError) as caught:
        checked(monkeypatch, *found)
    assert str(caught.value) == (
        f"cannot serve a page at lab:80: {os.strerror(reason)}; give another --host or --port"
    )


def test_a_name_that_is_none_is_told() -> None:
    with pytest.raises(UserError, match=r"at \.\.:80: no host can have this name; give another"):
        page._check_address("..", 80)


def test_a_port_that_somebody_listens_at_is_taken_and_free_when_he_has_gone() -> None:
    """A connection that was just closed lingers, and does not count."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
        arguments = (socket.AF_INET, socket.SOCK_STREAM, 0, address)
        error = page._refusal(*arguments)
        assert error is not None
        assert error.errno == TAKEN
        with socket.create_connection(address):
            server.accept()[0].close()  # who closes first has the lingering end
    assert page._refusal(*arguments) is None


def test_a_taken_port_is_told_before_viser_looks_for_another() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with (
            pytest.raises(UserError, match=f"cannot serve a page at 127.0.0.1:{port}"),
            page.serving("127.0.0.1", port, "x"),
        ):
            pytest.fail("it is served")
