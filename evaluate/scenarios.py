"""Scenarios as data, read from `scenarios.yaml`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from footfall.common.config import (
    read_yaml,
    require_between,
    require_not_negative,
    require_ordered,
    structure,
    with_changes,
)
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.common.limits import MAX_COMMAND, MAX_DURATION_S
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import QUANTITIES, randomisation_of
from footfall.plant.episode import Push
from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec
from footfall.terrain.declaration import GroundConfig, check_ground, parameters_of_shapes

DEFAULT = Path(__file__).parent / "scenarios.yaml"
COMMAND_AXES = ("forward_m_s", "leftward_m_s", "yaw_rad_s")
SHARES = {  # keys in a file that are shares, and the quantities they scale
    "forward_share": "forward_m_s",
    "leftward_share": "leftward_m_s",
    "yaw_share": "yaw_rad_s",
    "payload_share": "payload_kg",
    "step_share": "step_m",
    "roughness_share": "roughness_m",
    "block_share": "block_m",
    "tread_share": "tread_m",
}
GROUND_LENGTHS = ("step_m", "tread_m", "roughness_m", "block_m")  # shares are of the standing height
PUSH_LEVELS = ("push_m_s", "push_direction_deg")
GROUND_LEVELS = tuple(parameters_of_shapes())
LEVEL_NAMES = (*COMMAND_AXES, *PUSH_LEVELS, *QUANTITIES, *GROUND_LEVELS)
LEVEL_LIMITS = {
    **dict.fromkeys(COMMAND_AXES, (-MAX_COMMAND, MAX_COMMAND)),
    "push_m_s": (0.0, MAX_COMMAND),
    **{name: (each.lower, each.upper) for name, each in QUANTITIES.items()},
}
MAX_EPISODES = 100_000  # of one scenario; more would run for weeks
MIN_HOLD_S = 0.01  # shorter than the period of any policy

Range = tuple[float, float]


@dataclass(frozen=True)
class DrawnCommands:
    """Commands drawn uniformly, each held for a while."""

    forward_m_s: Range
    leftward_m_s: Range
    yaw_rad_s: Range
    hold_s: Range
    standing_share: float = 0.0  # of commands to stand still

    def __post_init__(self) -> None:
        require_ordered(self, *COMMAND_AXES, "hold_s")
        require_between(self, -MAX_COMMAND, MAX_COMMAND, *COMMAND_AXES)
        require_between(self, MIN_HOLD_S, MAX_DURATION_S, "hold_s")
        require_between(self, 0.0, 1.0, "standing_share")


@dataclass(frozen=True)
class Waypoint:
    """A command that applies from a given time."""

    at_s: float
    forward_m_s: float = 0.0
    leftward_m_s: float = 0.0
    yaw_rad_s: float = 0.0

    def __post_init__(self) -> None:
        require_between(self, -MAX_COMMAND, MAX_COMMAND, *COMMAND_AXES)


@dataclass(frozen=True)
class Scenario:
    """One kind of episode. Commands are drawn, or scripted, or among the levels."""

    about: str
    episodes: int  # default number
    duration_s: float
    commands: DrawnCommands | None = None
    script: tuple[Waypoint, ...] = ()
    pushes: tuple[Push, ...] = ()
    levels: dict[str, tuple[float, ...]] = field(default_factory=dict)
    push_between_s: Range | None = None  # time range of the push of the push levels
    ground: GroundConfig | None = None  # parameters that are levels may be left out; None is level
    randomised: bool = False  # whether the robot is randomised by domain_rand
    rows: tuple[str, ...] = ()  # levels for which results are also listed separately
    mission: dict[str, Any] | None = None  # steers instead of commands, for duration_s at most

    def __post_init__(self) -> None:
        unknown = [name for name in self.levels if name not in LEVEL_NAMES]
        if unknown:
            raise ValueError(f"no level {unknown[0]} (there are {', '.join(LEVEL_NAMES)})")
        absent = [name for name in self.rows if name not in self.levels]
        if absent:
            raise ValueError(f"rows names {absent[0]}, which is not one of its levels")
        if self.episodes < 1 or self.duration_s <= 0.0:
            raise ValueError("episodes and duration_s must be above 0")
        require_between(self, 1, MAX_EPISODES, "episodes")
        require_between(self, 0.0, MAX_DURATION_S, "duration_s")
        self._check_commands()
        self._check_levels()
        self._check_pushes()
        self._check_ground()

    def _check_commands(self) -> None:
        axes = [axis for axis in COMMAND_AXES if axis in self.levels]
        if self.mission is not None and (self.commands is not None or self.script or axes):
            raise ValueError("a mission steers by itself: leave commands, script and levels of commands out")
        if self.commands is not None and (self.script or axes):
            raise ValueError(f"give commands or {axes[0] if axes else 'a script'}, not both")
        times = [waypoint.at_s for waypoint in self.script]
        if times and (times[0] != 0.0 or sorted(set(times)) != times):
            raise ValueError(f"script: at_s must rise from 0, not {times}")

    def _check_levels(self) -> None:
        if any(not values for values in self.levels.values()):
            raise ValueError("each level needs at least one value")
        if math.prod(map(len, self.levels.values())) > MAX_EPISODES:
            raise ValueError(f"levels have more than {MAX_EPISODES:,} combinations")
        for name, values in self.levels.items():
            low, high = LEVEL_LIMITS.get(name, (-math.inf, math.inf))
            for value in values:
                if not low <= value <= high:
                    raise ValueError(f"level {name} must be from {low:g} to {high:g}, not {value:g}")

    def _check_ground(self) -> None:
        ground_levels = {name: self.levels[name] for name in GROUND_LEVELS if name in self.levels}
        if ground_levels and self.ground is None:
            raise ValueError(f"level {next(iter(ground_levels))} needs a ground")
        if self.ground is not None:
            counts = {len(values) for values in ground_levels.values()}
            for index in range(max(counts, default=1)):
                level = {name: values[min(index, len(values) - 1)] for name, values in ground_levels.items()}
                check_ground(at_level(self.ground, level))

    def _check_pushes(self) -> None:
        if "push_m_s" in self.levels and self.push_between_s is None:
            raise ValueError("push levels need push_between_s")
        require_ordered(self, "push_between_s")
        require_not_negative(self, "push_between_s")
        for push in self.pushes:
            require_not_negative(push, "time_s")
            require_between(push, -MAX_COMMAND, MAX_COMMAND, "delta_v_m_s")


def at_level(ground: GroundConfig, levels: Mapping[str, float]) -> GroundConfig:
    """A ground with the parameters that are among these levels."""
    chosen = {name: value for name, value in levels.items() if name in GROUND_LEVELS}
    return replace(ground, settings={**ground.settings, **chosen})


@dataclass(frozen=True)
class ScenarioFile:
    """The content of `scenarios.yaml`."""

    noise: Noise  # of the readings, for all scenarios
    scenarios: dict[str, Scenario]
    # Errors of the height scan, for all scenarios.
    height_scan_errors: HeightScanErrors = field(default_factory=HeightScanErrors)

    def select(self, names: Sequence[str]) -> dict[str, Scenario]:
        """The named scenarios, in the order given.

        Raises:
            UserError: one of them does not exist or is named twice, or none is named.
        """
        known = ", ".join(self.scenarios)
        if not names:
            raise UserError(f"no scenario given: choose from {known}")
        for name in names:
            if name not in self.scenarios:
                raise UserError(
                    f"no scenario '{name}': there are {known}{did_you_mean(name, self.scenarios)}"
                )
            if names.count(name) > 1:
                raise UserError(f"scenario '{name}' is named twice: name each once")
        return {name: self.scenarios[name] for name in names}


def shipped_scenarios() -> dict[str, Scenario]:
    """The shipped scenarios by name; commands, loads and lengths of the ground are shares."""
    shares = dict.fromkeys(SHARES.values(), (-1.0, 1.0))
    return structure(_in_units(read_yaml(DEFAULT), shares), ScenarioFile, str(DEFAULT)).scenarios


def load_scenarios(robot: Robot, user_file: Path | None = None) -> ScenarioFile:
    """The scenarios for a robot: commands in m/s and rad/s, loads in kg, lengths of the ground in m.

    Args:
        robot: the file's commands and loads are shares of its ranges, lengths of its standing height.
        user_file: its scenarios come after those of footfall, or replace those of the same name.

    Raises:
        UserError: a file is malformed, or a negative payload exceeds the mass of the robot's base.
    """
    default = read_yaml(DEFAULT)
    data = default if user_file is None else with_changes(default, user_file)
    source = str(user_file or DEFAULT)
    file = structure(_in_units(data, _ranges(robot)), ScenarioFile, source)
    _check_loads(file, robot, source)
    return replace(
        file, scenarios={name: _with_ranges(scenario) for name, scenario in file.scenarios.items()}
    )


def _ranges(robot: Robot) -> dict[str, Range]:
    """The ranges that shares refer to: the robot's commands, its randomised payload, its height."""
    load = randomisation_of(robot).payload_kg
    height_m = robot.description.standing_height_m
    return {
        **vars(robot.description.commands),
        **dict.fromkeys(GROUND_LENGTHS, (-height_m, height_m)),
        "payload_kg": (0.0, 0.0) if load is None else (load.low, load.high),
    }


def _check_loads(file: ScenarioFile, robot: Robot, source: str) -> None:
    loads = {name: min(each.levels.get("payload_kg", (0.0,))) for name, each in file.scenarios.items()}
    if not any(load < 0.0 for load in loads.values()):
        return
    mass = load_spec(robot.xml_path).compile().body(robot.description.base).mass.item()
    for name, load in loads.items():
        if load <= -mass:
            raise UserError(
                f"{source}: scenarios['{name}']: level payload_kg must be above {-mass:.3g}, not {load:g}:"
                f" the base of {robot.name} weighs {mass:.3g} kg"
            )


def _in_units(data: Any, ranges: Mapping[str, Range]) -> Any:
    """Plain data with shares of the robot's ranges converted to units."""
    if isinstance(data, list):
        return [SHARES.get(item, item) if isinstance(item, str) else _in_units(item, ranges) for item in data]
    if not isinstance(data, dict):
        return data
    return {
        SHARES.get(key, key): _scaled(value, ranges[SHARES[key]])
        if key in SHARES
        else _in_units(value, ranges)
        for key, value in data.items()
    }


def _scaled(share: Any, limits: Range) -> Any:
    """A share of a range, or each of a list, in units; anything else than a number is unchanged."""
    if isinstance(share, list):
        return [_scaled(item, limits) for item in share]
    if not isinstance(share, int | float):
        return share
    return share * limits[1] if share >= 0 else -share * limits[0]


def _with_ranges(scenario: Scenario) -> Scenario:
    """The scenario with the ranges of its drawn commands in its description."""
    drawn = scenario.commands
    if drawn is None:
        return scenario
    forward, leftward, yaw = (
        f"{low:g} to {high:g}" for low, high in (drawn.forward_m_s, drawn.leftward_m_s, drawn.yaw_rad_s)
    )
    return replace(
        scenario, about=f"{scenario.about} (forward {forward} m/s, leftward {leftward} m/s, yaw {yaw} rad/s)"
    )
