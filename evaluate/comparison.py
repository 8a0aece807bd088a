"""Results of a comparison: policies with their figures and their walk over the test course."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from footfall.common.engines import DEFAULT_ENGINE
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.figures import Summary
from footfall.evaluate.scenarios import ScenarioFile
from footfall.evaluate.suite import CourseWalk
from footfall.robots.description import Robot


@dataclass(frozen=True)
class PolicyResult:
    """One policy of a comparison."""

    name: str
    spec: str  # the text that the user typed
    origin: str  # trainer or controller, one sentence
    period_ms: float
    result: Mapping[str, Any]  # as in the JSON
    course: CourseWalk
    on_grounds: Mapping[str, CourseWalk] = field(default_factory=dict)  # by scenario, on its highest level


@dataclass(frozen=True)
class Comparison:
    """The content of a report, without the films."""

    robot: Robot
    config: EvaluationConfig
    file: ScenarioFile
    policies: Sequence[PolicyResult]
    versions: Mapping[str, str]

    def summaries(self, scenario: str) -> dict[str, Summary]:
        """Figures of one scenario by policy."""
        return {policy.name: policy.result["scenarios"][scenario] for policy in self.policies}

    @property
    def push_scenario(self) -> str | None:
        """The first scenario that measures the median survivable push; None without one."""
        chosen = self.config.scenarios
        return next((name for name in chosen if "push_m_s" in self.file.scenarios[name].levels), None)


def command_line(comparison: Comparison) -> str:
    """The command that reproduces the figures."""
    config = comparison.config
    scenarios = ",".join(str(config.missions.get(name, name)) for name in config.scenarios)
    options = ["--robot", config.robot, "--scenarios", scenarios, "--seed", str(config.seed)]
    if config.episodes is not None:
        options += ["--episodes", str(config.episodes)]
    if config.scenario_file is not None:
        options += ["--scenario-file", str(config.scenario_file)]
    if config.plant is not None:
        options += ["--plant", str(config.plant)]
    if config.engine != DEFAULT_ENGINE:
        options += ["--engine", config.engine]
    if config.metrics:
        options += ["--metrics", ",".join(config.metrics)]
    if config.get_up is not None:
        options += ["--get-up", config.get_up]
    if config.ground_truth:
        options.append("--ground-truth")
    specs = [policy.spec for policy in comparison.policies]
    return shlex.join(["footfall", "compare", *specs, *options, "--html", "report.html"])
