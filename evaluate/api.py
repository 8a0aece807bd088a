"""What the command line calls: evaluate one policy, or hold several against each other."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, is_device, write_json, write_text
from footfall.common.versions import versions
from footfall.evaluate.comparison import Comparison, Contender
from footfall.evaluate.pool import Outcome
from footfall.evaluate.provenance import PACKAGES, kind, machine
from footfall.evaluate.report import render
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.suite import Setup, Showing, run_course, run_suite
from footfall.evaluate.table import print_results
from footfall.evaluate.video import Film, FilmTask, render_films
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot
from footfall.robots.model import read_plant

DEFAULT_SCENARIOS = ("nominal", "push")


def evaluate_policy(
    policy_spec: str,
    robot_spec: str,
    scenarios: Sequence[str] = DEFAULT_SCENARIOS,
    episodes: int | None = None,
    seed: int = 0,
    plant: Path | None = None,
    json_path: Path | None = None,
    workers: int | None = None,
    ground_truth: bool = False,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run a policy through scenarios, print the table, write the JSON.

    Args:
        policy_spec: as `footfall.policies.registry.load_policy` takes it.
        robot_spec: a robot's name or folder.
        scenarios: names in `scenarios.yaml`.
        episodes: of each scenario; its own number if None.
        seed: of everything drawn.
        plant: another MJCF than the robot's own.
        json_path: where results go as well.
        workers: processes; one for each core if None.
        ground_truth: hand the policy the true base velocity.
        console: where to print.

    Returns:
        {"policy", "robot", "seed", ..., "scenarios": {name: figures}}

    Raises:
        UserError: something named does not exist or does not fit, or the output cannot be written.
    """
    setup = Setup(robot_spec, tuple(scenarios), seed, episodes, plant, ground_truth, workers)
    results, _ = _run([policy_spec], setup, console or Console(), [json_path], with_course=False)
    (result,) = results.values()
    write_json(json_path, result)
    return result


def compare_policies(
    policy_specs: Sequence[str],
    robot_spec: str,
    scenarios: Sequence[str] = DEFAULT_SCENARIOS,
    episodes: int | None = None,
    seed: int = 0,
    plant: Path | None = None,
    json_path: Path | None = None,
    html_path: Path | None = None,
    workers: int | None = None,
    ground_truth: bool = False,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run several policies through the same scenarios and the course; table, JSON, HTML report.

    Args as for `evaluate_policy`; `html_path` is where the report goes.

    Returns:
        {policy: as `evaluate_policy` returns it, with "compute_ms": {"p50", "p99"} on the course, alone}

    Raises:
        UserError: something named does not exist or does not fit, or an output cannot be written.
    """
    if not policy_specs:
        raise UserError("nothing to compare: name at least one policy")
    if html_path is not None and is_device(html_path):
        raise UserError(f"cannot write the report to {html_path}: give a file name")
    console = console or Console()
    setup = Setup(robot_spec, tuple(scenarios), seed, episodes, plant, ground_truth, workers)
    specs = list(dict.fromkeys(policy_specs))
    results, comparison = _run(specs, setup, console, [json_path, html_path], with_course=True)
    write_json(json_path, results)
    if html_path is not None:
        assert comparison is not None
        with console.status("filming the course"):
            comparison = _filmed(comparison)
        write_text(html_path, render(comparison))
        console.print(f"report: {html_path}")
    return results


def _run(
    specs: Sequence[str],
    setup: Setup,
    console: Console,
    outputs: Sequence[Path | None],
    with_course: bool,
) -> tuple[dict[str, Any], Comparison | None]:
    """Check everything that can be checked before the long run, run, print."""
    if setup.episodes is not None and setup.episodes < 1:
        raise UserError(f"episodes is {setup.episodes}: it must be 1 or more")
    robot = load_robot(setup.robot)
    file = load_scenarios()
    file.select(setup.scenarios)
    policies = {spec: load_policy(spec, robot) for spec in specs}
    if setup.plant is not None:
        read_plant(robot, setup.plant)
    check_outputs(*outputs)

    with _progress(console) as done:
        figures = run_suite(specs, setup, file, done)
    names = contender_names(policies)
    facts = {"robot": robot.name, "seed": setup.seed, "ground_truth": setup.ground_truth}
    facts |= {"plant": str(setup.plant) if setup.plant else None}
    facts |= {"versions": versions(PACKAGES), "machine": machine()}
    results: dict[str, Any] = {
        names[spec]: {
            "policy": names[spec],
            **facts,
            "about": kind(policies[spec]),
            "scenarios": figures[spec],
        }
        for spec in specs
    }
    comparison = None
    if with_course:
        with console.status("timing each contender alone"):
            showings = run_course(specs, setup, file)
        for spec in specs:
            results[names[spec]] |= showings[spec].compute
        contenders = [_contender(names[s], policies[s], results[names[s]], showings[s]) for s in specs]
        comparison = Comparison(robot, setup, file, contenders, versions(PACKAGES))
    print_results(results, console)
    return results, comparison


def contender_names(policies: Mapping[str, Policy]) -> dict[str, str]:
    """A name for each spec: the policy's own, or what the user typed where two share one."""
    own = [policy.name for policy in policies.values()]
    return {spec: policy.name if own.count(policy.name) == 1 else spec for spec, policy in policies.items()}


def _contender(name: str, policy: Policy, result: Mapping[str, Any], showing: Showing) -> Contender:
    return Contender(name, kind(policy), 1e3 / policy.rate_hz, result, showing, Outcome(None, "not filmed"))


def _filmed(comparison: Comparison) -> Comparison:
    """The same with films of those contenders that walked the course."""
    walked = [c for c in comparison.contenders if c.showing.trace is not None and len(c.showing.trace.time_s)]
    tasks = [
        FilmTask(comparison.setup.robot, comparison.setup.plant, c.showing.trace, c.showing.plan.pushes)
        for c in walked
        if c.showing.trace is not None
    ]
    films: dict[str, Outcome[Film]] = dict(
        zip((c.name for c in walked), render_films(tasks, comparison.setup.workers), strict=True)
    )
    contenders = [replace(c, film=films.get(c.name, c.film)) for c in comparison.contenders]
    return replace(comparison, contenders=contenders)


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """A bar on a terminal, nothing elsewhere; gives what `run_suite` reports to."""
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("episodes", total=None)
        yield lambda finished, total: bar.update(task, completed=finished, total=total)
