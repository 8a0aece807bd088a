"""`footfall watch`."""

from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from footfall.options import Port


@Parameter(name="*")
@dataclass(frozen=True)
class PageOptions:
    """Where to serve the page."""

    host: str = "localhost"
    """Name or address to listen at; 0.0.0.0 lets other machines connect and move the robot shown."""
    port: Port = 8080

    @property
    def address(self) -> str:
        return f"http://{self.host}:{self.port}"


LOCAL_PAGE = PageOptions()


def watch(run: Path, /, *, page: PageOptions = LOCAL_PAGE) -> None:
    """Show a run's newest policy walking beside the run's curves, on a web page, until Ctrl-C.

    Parameters
    ----------
    run
        A run folder that footfall train made, or is still filling, or the name of a policy in the zoo.
    """
    from footfall.policies.registry import ZOO, zoo_names
    from footfall.train.runs.stop import StopRequest

    with StopRequest() as stop:
        from footfall.pages.walk import watch as serve

        shipped = not run.exists() and str(run) in zoo_names()
        serve(ZOO / run if shipped else run, page.host, page.port, stop)
