"""The fault table of the reference pages, from its data."""

import html
import json
from pathlib import Path
from typing import Any

FAULTS = Path(__file__).parents[1] / "docs" / "faults.json"
FAULT_COLUMNS = {
    "policy": "policy",
    "group": "part",
    "fault": "fault",
    "noticed": "noticed",
    "median_ms": "median, ms",
    "longest_ms": "longest",
    "limit_ms": "limit",
    "ends": "final state",
    "as_expected": "as expected",
    "reason": "reason",
}


def faults() -> str:
    """The fault table as HTML, which a script of the page sorts and filters."""
    rows = json.loads(FAULTS.read_text(encoding="utf-8"))["rows"]
    rows = [row | {"noticed": f"{row['noticed']} of {row['runs']}"} for row in rows]
    head = "".join(f"<th>{html.escape(title)}</th>" for title in FAULT_COLUMNS.values())
    body = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(_cell_text(row[key]))}</td>" for key in FAULT_COLUMNS) + "</tr>"
        for row in rows
    )
    table = f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"
    return f'<div id="faults" markdown="0">\n{table}\n</div>'


def _cell_text(value: Any) -> str:
    match value:
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case dict():
            return ", ".join(f"{state} {count}" for state, count in value.items())
    return str(value)
