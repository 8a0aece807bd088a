"""Summary at the end of `footfall deploy`."""

import math
from typing import Any


def show(figures: dict[str, Any]) -> None:
    """Print a summary for the user."""
    from rich.console import Console
    from rich.table import Table

    timing = figures["timing"]
    forward, leftward, _ = figures["mean_velocity_m_s"]
    measured = math.isfinite(forward)
    distance = f"{figures['distance_m']:.2f} m in " if measured else ""
    rows = [
        ("final state", figures["final_state"]),
        ("walked", f"{distance}{figures['walked_s']:.1f} s"),
        *([("mean velocity", f"{forward:.2f} m/s forward, {leftward:.2f} m/s left")] if measured else []),
        ("speed", f"{figures['run_s'] / max(figures['wall_s'], 1e-9):.1f} x real time"),
        ("tick", f"{timing['tick_us_p50']:.0f} us p50, {timing['tick_us_p99']:.0f} us p99"),
        ("policy step", f"{timing['policy_ms_p50']:.2f} ms p50, {timing['policy_ms_p99']:.2f} ms p99"),
    ]
    if timing["lateness_us_max"]:
        lateness = "{lateness_us_p50:.0f} us p50, {lateness_us_p99:.0f} us p99"
        overruns = "{overruns:.0f} of {ticks:.0f} ticks, {ticks_skipped:.0f} were skipped"
        rows += [("lateness", lateness.format(**timing)), ("overran", overruns.format(**timing))]
    loads = [f"{bus['name']} {bus['load']:.0%}" for bus in figures["buses"] if bus["load"] is not None]
    if loads:
        rows.append(("bus load", ", ".join(loads)))
    if mission := figures.get("mission"):
        position_error = "" if math.isnan(mission["error_m"]) else f", off by {mission['error_m']:.2f} m"
        rows.append(("mission", f"{mission['outcome'] or 'not done'}{position_error}"))
    rows += [("fault", fault) for fault in figures["faults"]]
    rows += [("fell", figures["fall_reason"])] if figures["fell"] else []
    rows += [("note", note) for note in figures["notes"]]
    table = Table(show_header=False, box=None, title=f"{figures['policy']} on {figures['robot']}")
    for row in rows:
        table.add_row(*row)
    Console().print(table, highlight=False)
