"""Writes a comparison's headline figures into a Markdown file, between two markers.

Scenarios in which a policy fell often have no rows for errors and effort: a robot that falls early collects
little of either.

Usage: footfall compare ... --json compare.json && python tools/make_table.py compare.json README.md
"""

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from footfall.evaluate.figures import figures, interval_text, measured, text

MAX_FALL_RATE = 0.05  # errors and effort are shown up to this fall rate
BEGIN, END = "<!-- comparison -->", "<!-- /comparison -->"


def policies_of(results: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The results of each policy, without a comparison's other keys."""
    return {name: part for name, part in results.items() if isinstance(part, dict) and "scenarios" in part}


def table(results: Mapping[str, Any]) -> str:
    """Headline figures in rows, policies in columns, scenario by scenario, as Markdown."""
    policies = policies_of(results)
    lines = ["| | " + " | ".join(policies) + " |", "| --- |" + " ---: |" * len(policies)]
    for scenario in next(iter(policies.values()))["scenarios"]:
        summaries = [part["scenarios"][scenario] for part in policies.values()]
        often_fell = any(summary["fall_rate"] > MAX_FALL_RATE for summary in summaries)
        for figure in figures().values():
            if not (figure.is_headline and measured(figure, summaries)) or (
                figure.blocked_by_falls and often_fell
            ):
                continue
            cells = [_cell(text(figure, each), interval_text(figure, each)) for each in summaries]
            lines.append(
                f"| {scenario.capitalize()}: {figure.title[0].lower()}{figure.title[1:]} | "
                + " | ".join(cells)
                + " |"
            )
    return "\n".join(lines)


def _cell(number: str, interval: str) -> str:
    return f"{number} [{interval}]" if interval else number


def insert(document: str, content: str) -> str:
    """The document with new content between the markers."""
    pattern = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    if not pattern.search(document):
        raise SystemExit(f"no '{BEGIN}' and '{END}' in the document")
    return pattern.sub(lambda _: f"{BEGIN}\n{content}\n{END}", document)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("document", type=Path)
    options = parser.parse_args()
    results = json.loads(options.results.read_text(encoding="utf-8"))
    document = options.document.read_text(encoding="utf-8")
    options.document.write_text(insert(document, table(results)), encoding="utf-8")


if __name__ == "__main__":
    main()
