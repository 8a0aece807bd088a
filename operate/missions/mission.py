"""Missions: autonomous runs described in a YAML file, which is checked before the start."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, NamedTuple

from footfall.common.config import read_yaml, require_between, structure, structure_value
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.common.limits import MAX_COMMAND
from footfall.deploy.command_source import Pose
from footfall.operate.abilities import Abilities, Limits
from footfall.operate.missions.follow import Tracking
from footfall.operate.missions.step import Scene, Step
from footfall.operate.missions.steps import STEPS, Jump, UsePolicy

HERE = Pose(0.0, 0.0, 0.0)
SPEED_SHARE = 0.5  # of the maximum forward command, if a mission gives no speed
MAX_STEPS = 1000


@dataclass(frozen=True)
class MissionSettings:
    """Settings of a whole mission."""

    about: str = ""
    speed_m_s: float | None = None  # along paths; default: half of the policy's maximum
    low_charge: float = 0.2  # charge below which the battery counts as low
    on_low_charge: Literal["home", "lie_down"] = "home"  # home: return to the start, then lie down
    tracking: Tracking = field(default_factory=Tracking)

    def __post_init__(self) -> None:
        require_between(self, 0.01, MAX_COMMAND, "speed_m_s")
        require_between(self, 0.0, 1.0, "low_charge")


class NamedStep(NamedTuple):
    """A step and its kind."""

    kind: str
    step: Step


@dataclass(frozen=True)
class Mission:
    """The content of a mission file."""

    source: str  # name of the file, for messages
    settings: MissionSettings
    steps: tuple[NamedStep, ...]

    def scene(self, limits: Limits) -> Scene:
        """Data for planning steps under a policy with these limits."""
        speed = self.settings.speed_m_s or SPEED_SHARE * limits.ranges.forward_m_s[1]
        return Scene(limits, self.settings.tracking, speed)

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the policies used by its steps."""
        steps = (each.step for each in self.steps)
        return tuple(dict.fromkeys(step.name for step in steps if isinstance(step, UsePolicy | Jump)))

    def planned_s(self, policy: str, abilities: Callable[[str], Abilities]) -> list[float]:
        """Plan all steps without a robot; returns the approximate duration of each.

        Args:
            policy: name of the policy in control at the start.
            abilities: returns a policy's abilities by its name.

        Raises:
            UserError: a step is impossible; the message names it.
        """
        durations_s, pose = [], HERE
        for number, (kind, step) in enumerate(self.steps, 1):
            limits, offer = abilities(policy)
            try:
                step.check(limits, offer)
                plan = step.plan(pose, self.scene(limits))
            except ValueError as error:
                raise UserError(f"{self.source}: step {number} ({kind}): {error}") from None
            pose = plan.end
            policy = step.name if isinstance(step, UsePolicy) else policy
            durations_s.append(plan.duration_s)
        return durations_s


def load_mission(path: Path) -> Mission:
    """Load a mission.

    Raises:
        UserError: the file is not a mission; the message names the step.
    """
    return mission_of(read_yaml(path), str(path))


def mission_of(data: Any, source: str) -> Mission:
    """Create a mission from plain data (see `load_mission`); `source` is the prefix of each message."""
    if not isinstance(data, dict) or not isinstance(data.get("steps"), list) or not data["steps"]:
        raise UserError(f"{source}: a mission has a list of steps, such as steps: [{{rectangle: 2x1}}]")
    if len(data["steps"]) > MAX_STEPS:
        raise UserError(f"{source}: {len(data['steps'])} steps are more than {MAX_STEPS}")
    settings = structure({k: v for k, v in data.items() if k != "steps"}, MissionSettings, source)
    steps = tuple(_step(each, f"{source}: step {number}") for number, each in enumerate(data["steps"], 1))
    if not_last := [number for number, each in enumerate(steps[:-1], 1) if each.kind == "lie_down"]:
        raise UserError(
            f"{source}: step {not_last[0]} (lie_down): it ends the run, so it has to be the last one"
        )
    return Mission(source, settings, steps)


def _step(data: Any, where: str) -> NamedStep:
    entry = {data: None} if isinstance(data, str) else data
    if not isinstance(entry, Mapping) or len(entry) != 1:
        raise UserError(f"{where}: a step has one key, its kind: {', '.join(STEPS)}")
    ((kind, value),) = entry.items()
    if kind not in STEPS:
        raise UserError(
            f"{where}: no step '{kind}': there are {', '.join(STEPS)}{did_you_mean(str(kind), STEPS)}"
        )
    cls = STEPS[kind]
    if value is None:
        content: Any = {}
    elif isinstance(value, Mapping):
        content = dict(value)
    else:
        first_field = next((each.name for each in fields(cls) if not each.kw_only), None)  # type: ignore[arg-type]
        if first_field is None:
            raise UserError(f"{where} ({kind}): it takes no value, not {value!r:.80}")
        content = {first_field: value}
    return NamedStep(kind, structure_value(content, cls, f"{where} ({kind})"))
