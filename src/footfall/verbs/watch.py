"""`footfall watch`."""

from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from footfall.options import Port


@Parameter(name="*")
@dataclass(frozen=True)
class PageOptions:
    """Address of the page."""

    host: str = "localhost"
    """Host name or address of the server; 0.0.0.0 allows other machines to connect and to move the robot."""
    port: Port = 8080

    @property
    def address(self) -> str:
        return f"http://{self.host}:{self.port}"


LOCAL_PAGE = PageOptions()


def watch(run: Path, /, *, page: PageOptions = LOCAL_PAGE) -> None:
    """Show a run's newest policy walking next to the run's curves, on a web page, until Ctrl-C.

    Parameters
    ----------
    run
        A run folder of a finished or running `footfall train`, or the name of a zoo policy.
    """
    from footfall.policies.registry import ZOO, zoo_names
    from footfall.train.runs.stop import StopRequest

    with StopRequest() as stop:
        from footfall.pages.walk import watch as serve

        shipped = not run.exists() and str(run) in zoo_names()
        serve(ZOO / run if shipped else run, page.host, page.port, stop)
