"""What a comparison found: the contenders with their figures, their walk over the course and its film."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from footfall.evaluate.figures import Summary
from footfall.evaluate.pool import Outcome
from footfall.evaluate.scenarios import ScenarioFile
from footfall.evaluate.suite import Setup, Showing
from footfall.evaluate.video import Film
from footfall.robots.description import Robot


@dataclass(frozen=True)
class Contender:
    """One policy of a comparison."""

    name: str
    kind: str  # how it came about, one sentence
    period_ms: float
    result: Mapping[str, Any]  # as it stands in the JSON
    showing: Showing
    film: Outcome[Film]


@dataclass(frozen=True)
class Comparison:
    """All that a report tells."""

    robot: Robot
    setup: Setup
    file: ScenarioFile
    contenders: Sequence[Contender]
    versions: Mapping[str, str]

    def summaries(self, scenario: str) -> dict[str, Summary]:
        """Figures of one scenario by contender."""
        return {c.name: c.result["scenarios"][scenario] for c in self.contenders}

    @property
    def push_scenario(self) -> str | None:
        """The first scenario that looks for the push that half survive."""
        chosen = self.setup.scenarios
        return next((name for name in chosen if "push_m_s" in self.file.scenarios[name].levels), None)
