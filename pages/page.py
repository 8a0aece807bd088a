"""The page's server: its address, and viser's page with footfall's look."""

import errno
import io
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.pages.handshake import own_handshake

if TYPE_CHECKING:
    from viser import ViserServer

NOT_AVAILABLE = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
BRAND = (224, 112, 26)


@contextmanager
def serving(host: str, port: int, label: str) -> "Iterator[ViserServer]":
    """An empty page, served while the context lasts.

    Raises:
        UserError: viser is not installed, or the address is not available.
    """
    check_page(host, port)
    from viser import ViserServer

    # A browser that closes a connection early would cause a traceback.
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    with _quietly(), own_handshake(host):
        server = ViserServer(host, port, label=label, verbose=False)
    try:
        server.gui.main_panel.dock_right()
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
        yield server
    finally:
        with _quietly():
            server.stop()


def check_page(host: str, port: int) -> None:
    """Raise UserError if viser is not installed or the address is not available."""
    _check_viser()
    check_address(host, port)


def _check_viser() -> None:
    """Raise UserError if the extra is not installed."""
    with needs_extra("watch", "watching needs"):
        import viser  # noqa: F401


def check_address(host: str, port: int) -> None:
    """Raise UserError if the address is not available; viser would silently take another port.

    A name may resolve to several addresses. viser listens at all of them, except those that this machine does
    not have (IPv6, if it is disabled).
    """
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except UnicodeError:
        raise _no_page(host, port, "no host can have this name") from None
    except OSError as error:
        raise _no_page(host, port, error.strerror) from None
    refusals = [_refusal(family, kind, protocol, address) for family, kind, protocol, _, address in addresses]
    errors = [error for error in refusals if error is not None]
    blocking = [error for error in errors if error.errno not in NOT_AVAILABLE]
    if blocking or None not in refusals:
        raise _no_page(host, port, (blocking or errors)[0].strerror)


def _refusal(family: int, kind: int, protocol: int, address: tuple) -> OSError | None:
    """The error of listening at one address; None if it is available."""
    try:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:  # as set by a server that also listens on IPv4
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            probe.bind(address)
    except OSError as error:
        return error
    return None


def _no_page(host: str, port: int, reason: str | None) -> UserError:
    return UserError(f"cannot serve a page at {host}:{port}: {reason}; give another host or port")


def _quietly() -> "redirect_stdout[io.StringIO]":
    """Silence viser's own messages; footfall prints the address."""
    return redirect_stdout(io.StringIO())
