"""`footfall doctor`."""


def doctor() -> None:
    """Say what this machine can do: accelerator, rendering, CAN, real-time scheduling, missing packages."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from footfall.common.machine import findings

    table = Table("", "what", box=None)
    for wide in ("found", "advice"):
        table.add_column(wide, overflow="fold")
    for finding in findings():
        mark = Text("yes", "green") if finding.good else Text("no", "yellow")
        table.add_row(mark, finding.what, Text(finding.found), Text(finding.advice, "dim"))
    Console().print(table)
