"""Requirements on figures of an evaluation, such as `nominal.falls <= 0`, and their outcome as JUnit XML."""

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.evaluate.figures import Figure, figures, value
from footfall.evaluate.own_metrics import SECTION, name_of

Results = Mapping[str, Mapping[str, Any]]  # by policy, as `evaluate_policy` returns them
COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt, "==": operator.eq,
}  # fmt: skip
FORM = re.compile(r"\s*(?:([\w-]+)\.)?([\w.]+?)\s*(<=|>=|==|<|>)\s*(\S+)\s*")


@dataclass(frozen=True)
class Requirement:
    """A figure's limit in some scenarios."""

    text: str  # as the user wrote it
    scenarios: tuple[str, ...]
    figure: Figure
    comparison: str
    limit: float

    def met(self, number: float | None) -> bool:
        """Whether a figure meets the requirement; a figure that was not measured does not."""
        return number is not None and COMPARISONS[self.comparison](number, self.limit)


@dataclass(frozen=True)
class Outcome:
    """A policy's figure in a scenario, compared with its requirement."""

    policy: str
    scenario: str
    requirement: Requirement
    number: float | None  # None if not measured

    @property
    def met(self) -> bool:
        return self.requirement.met(self.number)

    @property
    def line(self) -> str:
        """The outcome in one line."""
        reached = "was not measured" if self.number is None else f"is {self.number:.4g}"
        required = f"{self.requirement.comparison} {self.requirement.limit:g}"
        return f"{self.policy}: {self.scenario}.{self.requirement.figure.key} {reached}, required {required}"


def parse_requirements(
    texts: Iterable[str], scenarios: Sequence[str], metrics: Iterable[str] = ()
) -> list[Requirement]:
    """Parse requirements, before anything is run.

    Args:
        texts: SCENARIO.FIGURE, a comparison and a number each; without SCENARIO, for all scenarios.
        scenarios: names of the scenarios that are run.
        metrics: the user's own metrics, MODULE:NAME each.

    Raises:
        UserError: a text has another form, or names an unknown scenario or figure.
    """
    own = {
        f"{SECTION}.{name_of(import_path)}": Figure(f"{SECTION}.{name_of(import_path)}", "", "")
        for import_path in metrics
    }
    return [_parse(text, tuple(scenarios), figures() | own) for text in texts]


def _parse(text: str, scenarios: tuple[str, ...], known: Mapping[str, Figure]) -> Requirement:
    form = FORM.fullmatch(text)
    if form is None:
        raise UserError(f"--require '{text}': expected SCENARIO.FIGURE <= NUMBER, such as nominal.falls <= 0")
    scenario, key, comparison, number = form.groups()
    if scenario is not None and scenario not in scenarios and f"{scenario}.{key}" in known:
        scenario, key = None, f"{scenario}.{key}"  # a figure whose own name has a dot
    if scenario is not None and scenario not in scenarios:
        names = ", ".join(scenarios)
        raise UserError(f"--require '{text}': scenario '{scenario}' is not run, only {names} (--scenarios)")
    if key not in known:
        raise UserError(f"--require '{text}': no figure '{key}'{did_you_mean(key, known)}")
    try:
        limit = float(number)
    except ValueError:
        limit = math.nan
    if not math.isfinite(limit):
        raise UserError(f"--require '{text}': '{number}' is not a finite number")
    return Requirement(text, scenarios if scenario is None else (scenario,), known[key], comparison, limit)


def outcomes_of(requirements: Iterable[Requirement], results: Results) -> list[Outcome]:
    """Outcome of each requirement, for each policy and scenario."""
    return [
        Outcome(policy, scenario, requirement, value(requirement.figure, result["scenarios"][scenario]))
        for requirement in requirements
        for policy, result in results.items()
        for scenario in requirement.scenarios
    ]


def junit_xml(outcomes: Sequence[Outcome]) -> str:
    """JUnit XML with a test case for each outcome, for continuous integration."""
    unmet = sum(not outcome.met for outcome in outcomes)
    suite = ElementTree.Element(
        "testsuite", name="footfall", tests=str(len(outcomes)), failures=str(unmet), errors="0"
    )
    for outcome in outcomes:
        case = ElementTree.SubElement(
            suite, "testcase", classname=f"{outcome.policy}.{outcome.scenario}", name=outcome.requirement.text
        )
        if not outcome.met:
            ElementTree.SubElement(case, "failure", message=outcome.line)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
