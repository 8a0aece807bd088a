"""What the command line calls: evaluate one policy, or compare several."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from footfall.common.config import unstructure
from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, is_device, write_json, write_text
from footfall.common.versions import versions
from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.provenance import PACKAGES, machine, origin
from footfall.evaluate.scenarios import ScenarioFile, load_scenarios
from footfall.evaluate.suite import Setup, run_course, run_suite
from footfall.evaluate.table import print_results
from footfall.policies.policy import Policy
from footfall.policies.registry import changed_settings, load_policy, load_settings
from footfall.robots.description import Robot, load_robot
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
    scenario_file: Path | None = None,
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
        scenario_file: scenarios of the user's, beside ours.
        console: where to print.

    Returns:
        {"policy", "robot", "seed", ..., "scenarios": {name: figures}}; episodes that raised are counted in a
        scenario's "failed_episodes" and score nothing.

    Raises:
        UserError: something named does not exist or does not fit, or the output cannot be written.
    """
    console = console or Console()
    setup = Setup(robot_spec, tuple(scenarios), seed, episodes, plant, ground_truth, workers, scenario_file)
    robot, file, policies = _load(setup, [policy_spec])
    check_outputs(json_path)
    (result,) = _score(robot, file, policies, setup, console).values()
    print_results({result["policy"]: result}, console)
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
    scenario_file: Path | None = None,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run several policies through the same scenarios and the test course; table, JSON, HTML report.

    Args as for `evaluate_policy`; `html_path` is where the report goes, which needs the extra `report`.

    Returns:
        {policy: as `evaluate_policy` returns it, with "compute_ms": {"p50", "p99"} on the course, alone}

    Raises:
        UserError: something named does not exist, is named twice or does not fit, a library is missing, or an
            output cannot be written.
    """
    console = console or Console()
    setup = Setup(robot_spec, tuple(scenarios), seed, episodes, plant, ground_truth, workers, scenario_file)
    robot, file, policies = _load(setup, policy_specs)
    if html_path is not None:
        from footfall.evaluate.report.extra import check_installed

        check_installed()
        if is_device(html_path):
            raise UserError(f"cannot write the report to {html_path}: give a file name")
    check_outputs(json_path, html_path)

    results = _score(robot, file, policies, setup, console)
    with console.status("timing each policy alone"):
        walks = run_course(list(policies), setup, file)
    for spec, walk in walks.items():
        results[spec] |= walk.compute
    compared = [
        PolicyResult(
            results[spec]["policy"],
            spec,
            results[spec]["about"],
            1e3 / policy.rate_hz,
            results[spec],
            walks[spec],
        )
        for spec, policy in policies.items()
    ]
    comparison = Comparison(robot, setup, file, compared, versions(PACKAGES))
    by_name = {policy.name: policy.result for policy in compared}
    print_results(by_name, console)
    write_json(json_path, by_name)
    if html_path is not None:
        from footfall.evaluate.report.films import films_of
        from footfall.evaluate.report.page import render

        with console.status("filming the course"):
            films = films_of(comparison)
        write_text(html_path, render(comparison, films))
        console.print(f"report: {html_path}", markup=False, highlight=False, soft_wrap=True)
    return by_name


def _load(setup: Setup, specs: Sequence[str]) -> tuple[Robot, ScenarioFile, dict[str, Policy]]:
    """Everything that is named, so that what does not exist or fit is known before the long run."""
    if not specs:
        raise UserError("nothing to compare: name at least one policy")
    twice = next((spec for spec in specs if specs.count(spec) > 1), None)
    if twice is not None:
        raise UserError(f"policy '{twice}' is named twice: name each policy once")
    if setup.episodes is not None and setup.episodes < 1:
        raise UserError(f"episodes is {setup.episodes}: it must be 1 or more")
    robot = load_robot(setup.robot)
    file = load_scenarios(robot, setup.scenario_file)
    file.select(setup.scenarios)
    policies = {spec: load_policy(spec, robot) for spec in specs}
    if setup.plant is not None:
        read_plant(robot, setup.plant)
    return robot, file, policies


def _score(
    robot: Robot, file: ScenarioFile, policies: Mapping[str, Policy], setup: Setup, console: Console
) -> dict[str, dict[str, Any]]:
    """Run all episodes; the JSON of each policy by spec."""
    with _progress(console) as done:
        figures = run_suite(list(policies), setup, file, done)
    names = policy_names(policies)
    settings = {spec: unstructure(load_settings(spec, robot)) for spec in policies}
    shared = {
        "robot": robot.name,
        "seed": setup.seed,
        "ground_truth": setup.ground_truth,
        "plant": str(setup.plant) if setup.plant else None,
        "versions": versions(PACKAGES),
        "machine": machine(),
    }
    return {
        spec: {
            "policy": names[spec],
            **shared,
            "about": origin(policy, changed_settings(spec)),
            "settings": settings[spec],
            "scenarios": figures[spec],
        }
        for spec, policy in policies.items()
    }


def policy_names(policies: Mapping[str, Policy]) -> dict[str, str]:
    """A name for each spec: the policy's own, or what the user typed where two share one.

    A file's name may hold bytes that are no UTF-8, which neither JSON nor a page can hold.
    """
    own = [policy.name for policy in policies.values()]
    names = {spec: policy.name if own.count(policy.name) == 1 else spec for spec, policy in policies.items()}
    return {spec: name.encode(errors="replace").decode() for spec, name in names.items()}


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """A bar on a terminal, nothing elsewhere; gives what `run_suite` reports to."""
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("episodes", total=None)
        yield lambda finished, total: bar.update(task, completed=finished, total=total)
