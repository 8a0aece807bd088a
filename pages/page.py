"""The page's server: where it listens, and viser's page made ours."""

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

NOT_HERE = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
BRAND = (224, 112, 26)


@contextmanager
def serving(host: str, port: int, label: str) -> "Iterator[ViserServer]":
    """An empty page, served for as long as the context lasts.

    Raises:
        UserError: viser is not installed, or the address cannot be had.
    """
    check_page(host, port)
    from viser import ViserServer

    # A browser that hangs up early, as browsers do, would cost a traceback.
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
    """Raises UserError if no page can be served there, or none at all."""
    _check_viser()
    check_address(host, port)


def _check_viser() -> None:
    """Raises UserError if the extra is not installed."""
    with needs_extra("watch", "watching needs"):
        import viser  # noqa: F401


def check_address(host: str, port: int) -> None:
    """Raises UserError if something cannot listen there; viser would quietly take another port.

    A name may stand for several addresses, and viser takes them all, but for those that this machine does
    not have (IPv6 where it is off).
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except UnicodeError:
        raise _no_page(host, port, "no host can have this name") from None
    except OSError as error:
        raise _no_page(host, port, error.strerror) from None
    refusals = [_refusal(family, kind, protocol, address) for family, kind, protocol, _, address in found]
    errors = [error for error in refusals if error is not None]
    taken = [error for error in errors if error.errno not in NOT_HERE]
    if taken or None not in refusals:
        raise _no_page(host, port, (taken or errors)[0].strerror)


def _refusal(family: int, kind: int, protocol: int, address: tuple) -> OSError | None:
    """Why nothing can listen at one address; None if something can."""
    try:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:  # as a server has it that listens for IPv4 besides
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            probe.bind(address)
    except OSError as error:
        return error
    return None


def _no_page(host: str, port: int, reason: str | None) -> UserError:
    return UserError(f"cannot serve a page at {host}:{port}: {reason}; give another --host or --port")


def _quietly() -> "redirect_stdout[io.StringIO]":
    """Silence viser's own messages; footfall prints the address."""
    return redirect_stdout(io.StringIO())
