"""Merges results of `footfall evaluate --json` into one JSON, and renders the page that `compare` writes.

python tools/make_report.py a.json b.json --json docs/comparison.json --html report.html
python tools/make_report.py docs/comparison.json --html report.html

Policies keep the names of their results. Each walks the test course once here, for the page's plots of
velocities, gait and time per step. The page has no films.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from footfall.common.engines import DEFAULT_ENGINE
from footfall.common.errors import UserError
from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report.page import render
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.suite import run_course
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

SHARED = ("robot", "seed", "ground_truth", "plant", "engine")


def merge(files: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """The merged results by policy, in the order of the files, with the scenarios that all policies have.

    Raises:
        UserError: results differ in robot, seed, ground truth, plant, engine or number of episodes.
    """
    merged: dict[str, dict[str, Any]] = {}
    for file in files:
        content = json.loads(file.read_text(encoding="utf-8"))
        for result in [content] if "scenarios" in content else content.values():
            merged_result = merged.setdefault(result["policy"], {**result, "scenarios": {}})
            merged_result["scenarios"] |= result["scenarios"]
    for key in SHARED:
        if len({json.dumps(result.get(key)) for result in merged.values()}) > 1:
            raise UserError(f"the results differ in '{key}'")
    first: dict[str, Any] = next(iter(merged.values()))["scenarios"]
    common = [name for name in first if all(name in each["scenarios"] for each in merged.values())]
    for name in common:
        if len({each["scenarios"][name]["episodes"] for each in merged.values()}) > 1:
            raise UserError(f"the results differ in the number of episodes of '{name}'")
    for result in merged.values():
        result["scenarios"] = {name: result["scenarios"][name] for name in common}
    return merged


def page(results: dict[str, dict[str, Any]]) -> str:
    """The page of results from `merge`, as HTML; runs each policy's test course."""
    first = next(iter(results.values()))
    config = EvaluationConfig(
        first["robot"],
        tuple(first["scenarios"]),
        first["seed"],
        next(iter(first["scenarios"].values()))["episodes"],
        Path(first["plant"]) if first["plant"] else None,
        first.get("engine", DEFAULT_ENGINE),
        first["ground_truth"],
    )
    robot = load_robot(config.robot)
    file = load_scenarios(robot)
    walks = run_course(list(results), config, file)
    compared = [
        PolicyResult(
            name,
            name,
            result["about"],
            1e3 / load_policy(name, robot).rate_hz,
            {**result, **walks[name].compute},
            walks[name],
        )
        for name, result in results.items()
    ]
    not_filmed = {name: TaskResult(None, "not filmed") for name in results}
    return render(Comparison(robot, config, file, compared, first["versions"]), not_filmed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, nargs="+")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--html", type=Path)
    options = parser.parse_args()
    try:
        results = merge(options.results)
        if options.json:
            options.json.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
        if options.html:
            options.html.write_text(page(results), encoding="utf-8")
    except UserError as error:
        sys.exit(f"make_report: {error}")


if __name__ == "__main__":
    main()
