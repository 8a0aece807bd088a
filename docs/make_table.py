"""Writes the headline figures of a comparison into a Markdown file, between two markers.

Usage: footfall compare ... --json compare.json && python docs/make_table.py compare.json README.md
"""

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from footfall.evaluate.figures import figures, interval_text, measured, text

BEGIN, END = "<!-- comparison -->", "<!-- /comparison -->"


def contenders_of(results: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The parts of a comparison that are about a policy."""
    return {name: part for name, part in results.items() if isinstance(part, dict) and "scenarios" in part}


def table(results: Mapping[str, Any]) -> str:
    """Headline figures in rows, contenders in columns, scenario by scenario, as Markdown."""
    contenders = contenders_of(results)
    lines = ["| | " + " | ".join(contenders) + " |", "| --- |" + " ---: |" * len(contenders)]
    for scenario in next(iter(contenders.values()))["scenarios"]:
        summaries = [part["scenarios"][scenario] for part in contenders.values()]
        lines.append(f"| **{scenario}** |" + " |" * len(summaries))
        for figure in figures().values():
            if not (figure.headline and measured(figure, summaries)):
                continue
            cells = [_cell(text(figure, each), interval_text(figure, each)) for each in summaries]
            lines.append(f"| {figure.title} | " + " | ".join(cells) + " |")
    steps = [part.get("compute_ms", {}) for part in contenders.values()]
    if all(step.get("p50") is not None for step in steps):
        cells = [f"{step['p50']:.2f} / {step['p99']:.2f}" for step in steps]
        lines.append("| Time per policy step, p50 / p99 (ms) | " + " | ".join(cells) + " |")
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
