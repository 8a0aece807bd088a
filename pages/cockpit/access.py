"""Access to the cockpit: a token in the printed address, and connections from this server's pages only."""

import secrets
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from footfall.pages.handshake import refusal

NO_TOKEN = "open the whole address that 'footfall deploy --cockpit' has printed"


class Access:
    """Checks requests. The token is first in the address, later in a cookie that scripts cannot read."""

    def __init__(self, served_at: str, port: int, token: str | None = None) -> None:
        """A new token unless one is given; `served_at` is the name or address at which the server listens."""
        self._served_at = served_at
        self.token = token or secrets.token_urlsafe(24)
        self._cookie = f"footfall_cockpit_{port}"  # cookies do not distinguish ports

    def refusal(self, path: str, headers: Mapping[str, str], socket: bool) -> str | None:
        """Why a request is refused; None if it is not.

        Args:
            path: requested path, with its query.
            headers: headers of the request.
            socket: whether it opens a WebSocket, which must come from a page of this server.
        """
        host, origin = headers.get("Host"), headers.get("Origin")
        if reason := refusal(host, origin, self._served_at):
            return reason
        if socket and origin is None:
            return "a connection must come from this server's page"
        tokens = [
            *parse_qs(urlsplit(path).query).get("token", []),
            self._cookie_token(headers.get("Cookie", "")),
        ]
        # As bytes: text with characters beyond ASCII would raise TypeError.
        if any(secrets.compare_digest(each.encode(), self.token.encode()) for each in tokens):
            return None
        return NO_TOKEN

    @property
    def set_cookie(self) -> str:
        """The header with which the browser keeps the token for this server's pages."""
        return f"{self._cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def _cookie_token(self, cookies: str) -> str:
        try:
            found = SimpleCookie(cookies).get(self._cookie)
        except CookieError:
            return ""
        return found.value if found is not None else ""
