"""`footfall doctor`."""


def doctor() -> None:
    """Check this machine: accelerator, rendering, CAN, real-time scheduling, missing packages."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from footfall.machine import findings

    console = Console()
    table = Table(box=None, show_header=False)
    table.add_column()
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    found = list(findings())
    for finding in found:
        table.add_row(
            Text("ok", "green") if finding.good else Text("--", "yellow"), finding.name, Text(finding.result)
        )
    console.print(table)
    for finding in found:  # not wrapped, so that a command can be copied
        if finding.advice:
            console.print(Text(f"{finding.name}: {finding.advice}"), soft_wrap=True)
