"""Where the height scans of a run come from."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from footfall.common.errors import UserError

if TYPE_CHECKING:
    from footfall.deploy.height_scan import HeightScanSource

AUTO, OFF, UDP = "auto", "off", "udp"


@contextmanager
def height_scan_source(chosen: str) -> "Iterator[HeightScanSource | None]":
    """The source that `--height-scan` names; None for the simulated robot's own.

    Raises:
        UserError: there is no such source, or it cannot be opened.
    """
    kind, _, argument = chosen.partition(":")
    if chosen == AUTO:
        yield None
    elif chosen == OFF:
        from footfall.deploy.height_scan import NoScans

        yield NoScans()
    elif kind == UDP:
        from footfall.operate.height_scan_udp import scans_by_udp

        with scans_by_udp(argument) as scans:
            yield scans
    else:
        raise UserError(f"--height-scan {chosen}: give {AUTO}, {OFF}, {UDP} or {UDP}:HOST:PORT")
