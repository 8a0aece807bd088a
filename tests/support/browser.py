"""A headless Chromium that draws WebGL in software, driven through its DevTools protocol.

By itself it takes a picture of a page: python tests/support/browser.py URL FILE.png [SECONDS]
"""

import base64
import itertools
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import urlopen

FLAGS = (
    *("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--hide-scrollbars"),
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",  # some containers have little shared memory
    *("--disable-quic", "--no-first-run", "--disable-sync", "--disable-background-networking"),
    *("--disable-component-update", "--remote-debugging-port=0"),
)
START_S = 60.0


def chromium() -> str | None:
    """The browser's program, if this machine has it."""
    return shutil.which("chromium")


class Tab:
    """One page; collects the errors that it reports and the addresses that it requests."""

    def __init__(self, connection: Any) -> None:
        self._connection, self._numbers = connection, itertools.count(1)
        self.errors: list[str] = []
        self.requested: list[str] = []
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol; returns its result."""
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._connection.recv(timeout=90.0))
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def go(self, address: str) -> None:
        self.ask("Page.navigate", url=address)

    def value(self, expression: str) -> Any:
        """Value of a JavaScript expression."""
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    @property
    def text(self) -> str:
        return str(self.value("document.body ? document.body.innerText : ''"))

    def wait_for(self, condition: "Callable[[Tab], bool]") -> None:
        """Wait until a condition holds; after 90 s an AssertionError shows the page's content instead."""
        end = time.monotonic() + 90.0
        while not condition(self):
            assert time.monotonic() < end, f"{self.text!r}, errors: {self.errors}"
            time.sleep(0.2)

    def picture(self, path: Path) -> None:
        """Save a screenshot as PNG."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))

    def _note(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.errors.append(json.dumps(parameters["exceptionDetails"])[:500])
            case "Runtime.consoleAPICalled" if parameters["type"] in {"error", "assert"}:
                self.errors.append(json.dumps(parameters["args"])[:500])
            case "Log.entryAdded" if parameters["entry"]["level"] == "error":
                self.errors.append(parameters["entry"]["text"])
            case "Network.requestWillBeSent":
                self.requested.append(parameters["request"]["url"])


@contextmanager
def tab(profile: Path, width: int = 1400, height: int = 900) -> Iterator[Tab]:
    """An empty page in its own browser, whose files are in the folder `profile`."""
    from websockets.sync.client import connect

    program = chromium()
    assert program is not None
    options = (f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank")
    silent = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
    process = subprocess.Popen([program, *FLAGS, *options], **silent)
    try:
        address = _page_address(profile / "DevToolsActivePort")
        with connect(address, max_size=None, proxy=None, ping_interval=None) as connection:  # slow machines
            yield Tab(connection)
    finally:
        process.terminate()
        process.wait(timeout=60)


def _page_address(port_file: Path) -> str:
    end = time.monotonic() + START_S
    while not (port_file.is_file() and port_file.read_text().count("\n")):
        assert time.monotonic() < end, "Chromium did not start"
        time.sleep(0.1)
    port = port_file.read_text().splitlines()[0]
    while True:
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=10) as answer:
            pages = [page for page in json.load(answer) if page["type"] == "page"]
        if pages:
            return str(pages[0]["webSocketDebuggerUrl"])
        assert time.monotonic() < end, "Chromium opened no page"
        time.sleep(0.1)


def main(address: str, file: str, wait_s: str = "20") -> None:
    """Save what a page shows after a while."""
    with tempfile.TemporaryDirectory() as profile, tab(Path(profile)) as page:
        page.go(address)
        time.sleep(float(wait_s))
        page.value("document.querySelector('.mantine-Notification-closeButton')?.click()")
        time.sleep(1.0)
        page.picture(Path(file))


if __name__ == "__main__":
    main(*sys.argv[1:])
