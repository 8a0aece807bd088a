"""From a scenario to episodes: the commands, pushes and conditions of each."""

import math
import zlib
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from footfall.common.errors import UserError
from footfall.evaluate.scenarios import (
    COMMAND_AXES,
    MAX_EPISODES,
    DrawnCommands,
    Range,
    Scenario,
    Waypoint,
    at_level,
)
from footfall.plant.episode import Push
from footfall.terrain.declaration import GroundConfig

Command = tuple[float, float, float]
Levels = dict[str, float]


@dataclass(frozen=True)
class CommandSchedule:
    """Commands (forward m/s, leftward m/s, yaw rad/s) and the times from which they apply."""

    from_s: tuple[float, ...]  # rising, the first is 0
    commands: tuple[Command, ...]

    def __call__(self, time_s: float) -> np.ndarray:
        """The command at a time, shape (3,)."""
        index = int(np.searchsorted(self.from_s, time_s + 1e-9, side="right")) - 1
        return np.array(self.commands[max(index, 0)])


@dataclass(frozen=True)
class EpisodePlan:
    """All that distinguishes one episode from another; plain data that can be sent to another process."""

    scenario: str
    index: int
    seed: int
    duration_s: float
    schedule: CommandSchedule
    pushes: tuple[Push, ...]
    levels: Levels
    randomised: bool
    ground: GroundConfig | None = None  # None is level
    mission: dict[str, Any] | None = None  # steers instead of the schedule


def plan_episodes(name: str, scenario: Scenario, seed: int, episodes: int | None = None) -> list[EpisodePlan]:
    """The episodes of a scenario. Episode i does not depend on the number of episodes.

    Args:
        name: the scenario's name; other scenarios draw other numbers from the same seed.
        scenario: its definition.
        seed: seed of all random draws.
        episodes: number of episodes; None: the scenario's own.

    Raises:
        UserError: there are more than `MAX_EPISODES`.
    """
    count = episodes or scenario.episodes
    if count > MAX_EPISODES:
        raise UserError(f"{count} episodes of {name}: {MAX_EPISODES:,} at most")
    name_seed = zlib.crc32(name.encode())
    levels = spread_levels(scenario.levels, count, np.random.default_rng((seed, name_seed)))
    plans = []
    for index, level in enumerate(levels):
        rng = np.random.default_rng((seed, name_seed, index))
        plans.append(
            EpisodePlan(
                scenario=name,
                index=index,
                seed=int(rng.integers(2**31)),
                duration_s=scenario.duration_s,
                schedule=_schedule(scenario, level, rng),
                pushes=(*scenario.pushes, *_drawn_push(level, scenario.push_between_s, rng)),
                levels=level,
                randomised=scenario.randomised,
                ground=None if scenario.ground is None else at_level(scenario.ground, level),
                mission=scenario.mission,
            )
        )
    return plans


def spread_levels(
    levels: dict[str, tuple[float, ...]], episodes: int, rng: np.random.Generator
) -> list[Levels]:
    """A level of each factor for each episode.

    The levels of the first factor alternate, so that any number of episodes covers them evenly. Each level
    meets every combination of the other factors, in random order, before one repeats.
    """
    if not levels:
        return [{} for _ in range(episodes)]
    (first_name, first_values), *others = levels.items()
    rest = list(product(*(values for _, values in others)))  # combinations of the other factors
    first_order = rng.permutation(len(first_values))
    rest_orders = [rng.permutation(len(rest)) for _ in first_values]
    names = (first_name, *(name for name, _ in others))
    levels_by_episode = []
    for episode in range(episodes):
        repetition, position = divmod(episode, len(first_values))
        index = first_order[position]
        combination = rest[rest_orders[index][repetition % len(rest)]]
        levels_by_episode.append(dict(zip(names, (first_values[index], *combination), strict=True)))
    return levels_by_episode


def _schedule(scenario: Scenario, level: Levels, rng: np.random.Generator) -> CommandSchedule:
    if scenario.commands is not None:
        return _draw_commands(scenario.commands, scenario.duration_s, rng)
    script = scenario.script or (Waypoint(0.0),)
    commands = [
        tuple(level.get(axis, getattr(waypoint, axis)) for axis in COMMAND_AXES) for waypoint in script
    ]
    return CommandSchedule(tuple(w.at_s for w in script), tuple(commands))


def _draw_commands(commands: DrawnCommands, duration_s: float, rng: np.random.Generator) -> CommandSchedule:
    times, values, time_s = [], [], 0.0
    while time_s < duration_s:
        value = tuple(float(rng.uniform(*getattr(commands, axis))) for axis in COMMAND_AXES)
        stands = rng.random() < commands.standing_share
        times.append(time_s)
        values.append((0.0, 0.0, 0.0) if stands else value)
        time_s += float(rng.uniform(*commands.hold_s))
    return CommandSchedule(tuple(times), tuple(values))  # type: ignore[arg-type]


def _drawn_push(level: Levels, between_s: Range | None, rng: np.random.Generator) -> tuple[Push, ...]:
    """The push of the push levels, at a random time, and so at any phase of the gait."""
    if between_s is None or "push_m_s" not in level:
        return ()
    angle = math.radians(level.get("push_direction_deg", 0.0))
    size = level["push_m_s"]
    return (Push(float(rng.uniform(*between_s)), (size * math.cos(angle), size * math.sin(angle), 0.0)),)
