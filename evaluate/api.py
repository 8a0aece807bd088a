"""Evaluate one policy or compare several; the command line calls these functions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from footfall.common.config import unstructure
from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, is_device, write_json, write_text
from footfall.common.versions import versions
from footfall.deploy.fit import check_get_up
from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.config import DEFAULT_EVALUATION, EvaluationConfig
from footfall.evaluate.missions import make_mission, scenario_of
from footfall.evaluate.own_metrics import check_metrics
from footfall.evaluate.provenance import PACKAGES, machine, policy_description
from footfall.evaluate.scenarios import ScenarioFile, load_scenarios
from footfall.evaluate.suite import CourseWalk, run_course, run_grounds, run_suite
from footfall.evaluate.table import print_results, weakest_table
from footfall.evaluate.weakest import weakest
from footfall.policies.policy import Policy
from footfall.policies.registry import changed_settings, load_policy, load_settings
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import read_plant


def evaluate_policy(
    policy_spec: str,
    config: EvaluationConfig = DEFAULT_EVALUATION,
    *,
    json_path: Path | None = None,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run a policy through scenarios, print the table, write the JSON.

    Args:
        policy_spec: policy, as for `footfall.policies.registry.load_policy`.
        config: robot, scenarios, seed and other settings of the evaluation.
        json_path: file for the results.
        console: console for the table and the progress bar; None: the terminal.

    Returns:
        {"policy", "robot", "seed", ..., "scenarios": {name: figures}}; episodes that raised are counted in a
        scenario's "failed_episodes" and score nothing.

    Raises:
        UserError: a named item does not exist or does not fit, or the output cannot be written.
    """
    console = console or Console()
    robot, file, policies = _load(config, [policy_spec])
    check_outputs(json_path, inputs=[policy_spec, config.scenario_file, config.plant])
    (result,) = _score(robot, file, policies, config, console).values()
    print_results({result["policy"]: result}, console)
    write_json(json_path, result)
    return result


def weakest_of(
    policy_spec: str,
    names: Sequence[str],
    config: EvaluationConfig = DEFAULT_EVALUATION,
    *,
    json_path: Path | None = None,
    console: Console | None = None,
) -> dict[str, Any]:
    """Find the smallest disturbances that make a policy fall, print them, write the JSON.

    Arguments as for `evaluate_policy`; `names` are those of `footfall.evaluate.weakest.DISTURBANCES`.

    Raises:
        UserError: as `evaluate_policy` and `footfall.evaluate.weakest.weakest`.
    """
    console = console or Console()
    robot, file, policies = _load(config, [policy_spec])
    check_outputs(json_path, inputs=[policy_spec, config.scenario_file, config.plant])
    with console.status("searching"):
        disturbances = weakest(policy_spec, config, file, names)
    (name,) = policy_names(policies).values()
    result = {"policy": name, "robot": robot.name, "seed": config.seed, "weakest": disturbances}
    console.print(weakest_table(name, disturbances))
    write_json(json_path, result)
    return result


def compare_policies(
    policy_specs: Sequence[str],
    config: EvaluationConfig = DEFAULT_EVALUATION,
    *,
    json_path: Path | None = None,
    html_path: Path | None = None,
    console: Console | None = None,
) -> dict[str, Any]:
    """Run several policies through the same scenarios and the test course; write table, JSON, HTML report.

    Arguments as for `evaluate_policy`. `html_path`: file for the report, which needs the extra `report`.

    Returns:
        {policy: as `evaluate_policy` returns it, with "compute_ms": {"p50", "p99"} on the course, alone}

    Raises:
        UserError: a named item does not exist, is named twice or does not fit, a library is missing, or an
            output cannot be written.
    """
    console = console or Console()
    robot, file, policies = _load(config, policy_specs)
    if html_path is not None:
        from footfall.evaluate.report.extra import check_display, check_installed

        check_installed()
        check_display()
        if is_device(html_path):
            raise UserError(f"cannot write the report to {html_path}: give a file name")
    check_outputs(json_path, html_path, inputs=[*policy_specs, config.scenario_file, config.plant])

    results = _score(robot, file, policies, config, console)
    with console.status("timing each policy alone"):
        walks = run_course(list(policies), config, file)
    on_grounds: dict[str, dict[str, CourseWalk]] = {spec: {} for spec in policies}
    if html_path is not None:
        with console.status("recording walks on the scenarios' grounds"):
            on_grounds = run_grounds(list(policies), config, file)
    for spec, walk in walks.items():
        results[spec] |= walk.compute
    policy_results = [
        PolicyResult(
            results[spec]["policy"],
            spec,
            results[spec]["about"],
            1e3 / policy.rate_hz,
            results[spec],
            walks[spec],
            on_grounds[spec],
        )
        for spec, policy in policies.items()
    ]
    comparison = Comparison(robot, config, file, policy_results, versions(PACKAGES))
    by_name = {policy.name: policy.result for policy in policy_results}
    print_results(by_name, console)
    write_json(json_path, by_name)
    if html_path is not None:
        from footfall.evaluate.report.films import films_of, films_on_grounds
        from footfall.evaluate.report.page import render

        with console.status("filming the course"):
            films, ground_films = films_of(comparison), films_on_grounds(comparison)
        write_text(html_path, render(comparison, films, ground_films))
        console.print(f"report: {html_path}", markup=False, highlight=False, soft_wrap=True)
    return by_name


def _load(config: EvaluationConfig, specs: Sequence[str]) -> tuple[Robot, ScenarioFile, dict[str, Policy]]:
    """Load every named item, so that errors appear before the long run."""
    if isinstance(specs, str):
        raise UserError(f"expected a list of policies, such as ['{specs}'], found '{specs}'")
    if not specs:
        raise UserError("nothing to compare: name at least one policy")
    repeated = next((spec for spec in specs if specs.count(spec) > 1), None)
    if repeated is not None:
        raise UserError(f"policy '{repeated}' is named twice: name each policy once")
    if config.episodes is not None and config.episodes < 1:
        raise UserError(f"episodes is {config.episodes}: it must be 1 or more")
    if config.seed < 0:
        raise UserError(f"seed is {config.seed}: it must be 0 or more")
    robot = load_robot(config.robot)
    file = load_scenarios(robot, config.scenario_file)
    file = replace(file, scenarios=file.scenarios | {n: scenario_of(p) for n, p in config.missions.items()})
    chosen = file.select(config.scenarios)
    check_metrics(config.metrics)
    policies = {spec: load_policy(spec, robot) for spec in specs}
    for spec, policy in policies.items():
        for name, scenario in chosen.items():
            if scenario.mission is not None:
                make_mission(config.mission_run, scenario.mission, name, spec, policy, robot)
    if config.get_up is not None:
        check_get_up(load_policy(config.get_up, robot), robot)
    if config.plant is not None:
        read_plant(robot, config.plant)
    return robot, file, policies


def _score(
    robot: Robot,
    file: ScenarioFile,
    policies: Mapping[str, Policy],
    config: EvaluationConfig,
    console: Console,
) -> dict[str, dict[str, Any]]:
    """Run all episodes; the JSON of each policy by spec."""
    with _progress(console) as on_progress:
        figures = run_suite(list(policies), config, file, on_progress)
    names = policy_names(policies)
    settings = {spec: unstructure(load_settings(spec, robot)) for spec in policies}
    shared = {
        "robot": robot.name,
        "seed": config.seed,
        "ground_truth": config.ground_truth,
        "plant": str(config.plant) if config.plant else None,
        "engine": config.engine,
        "get_up": config.get_up,
        "versions": versions(PACKAGES),
        "machine": machine(),
    }
    return {
        spec: {
            "policy": names[spec],
            **shared,
            "about": policy_description(policy, changed_settings(spec)),
            "settings": settings[spec],
            "scenarios": figures[spec],
        }
        for spec, policy in policies.items()
    }


def policy_names(policies: Mapping[str, Policy]) -> dict[str, str]:
    """A name for each spec: the policy's own, or the text that the user typed if two policies share a name.

    Bytes of a file name that are not UTF-8 are replaced, since neither JSON nor a page can contain them.
    """
    own_names = [policy.name for policy in policies.values()]
    names = {
        spec: policy.name if own_names.count(policy.name) == 1 else spec for spec, policy in policies.items()
    }
    return {spec: name.encode(errors="replace").decode() for spec, name in names.items()}


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on a terminal, nothing elsewhere; yields the callback for `run_suite`."""
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("episodes", total=None)
        yield lambda finished, total: bar.update(task, completed=finished, total=total)
