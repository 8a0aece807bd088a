"""Named gaits: duty factor and phase of each foot, for any robot with the same number of feet
(`gaits.yaml`)."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from footfall.common.arrays import library
from footfall.common.config import read_yaml, require_between, structure
from footfall.common.errors import UserError
from footfall.robots.description import Robot

GAITS = Path(__file__).parent / "gaits.yaml"
# Feet within this distance of the median plane count as in it: the default pose is rounded to 0.1 mrad.
MIDDLE_M = 5e-4

Array = Any


@dataclass(frozen=True)
class GaitEntry:
    """A gait in `gaits.yaml`: its phases for each side, from front to back."""

    duty: float
    left: tuple[float, ...] = ()
    right: tuple[float, ...] = ()
    middle: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require_duty(self.duty)
        require_between(self, 0.0, 1.0, "left", "right", "middle")


class GaitPattern(NamedTuple):
    """A gait without its period."""

    duty: float  # share of the cycle in stance
    phase: np.ndarray  # (feet,) phase of each foot at clock 0, in the robot's order


def require_duty(duty: float | None) -> None:
    """Raise ValueError unless the duty factor leaves both stance and swing."""
    if duty is not None and not 0.0 < duty < 1.0:
        raise ValueError(f"duty must be above 0 and below 1, not {duty}")


def find_gait(name: str, robot: Robot) -> GaitPattern:
    """A named gait on a robot: phases are assigned by side, from front to back.

    Raises:
        UserError: there is no such gait for a robot with these numbers of feet on each side.
    """
    sides = _sides(robot)
    gaits = dict(_gaits_for(len(robot.description.feet)))
    if name not in gaits:
        known = ", ".join(gaits) or "none"
        count = len(robot.description.feet)
        raise UserError(f"no gait '{name}' for {count} feet of robot '{robot.name}': there are {known}")
    entry = gaits[name]
    phase = np.zeros(len(robot.description.feet))
    for feet, phases, side in zip(
        sides, (entry.left, entry.right, entry.middle), ("left", "right", "middle"), strict=True
    ):
        if len(feet) != len(phases):
            raise UserError(
                f"gait '{name}' has {len(phases)} feet on the {side}, robot '{robot.name}' has {len(feet)}"
            )
        phase[feet] = phases
    return GaitPattern(entry.duty, phase)


def gait_names() -> list[str]:
    """Names of all gaits, as `gaits.yaml` lists them."""
    return list(dict.fromkeys(name for gaits in _gaits_by_feet().values() for name in gaits))


def gaits_of(robot: Robot) -> list[str]:
    """Names of the gaits that fit the robot's feet on each side, in the order of `gaits.yaml`."""
    feet = tuple(map(len, _sides(robot)))
    return [
        name
        for name, entry in _gaits_for(sum(feet))
        if feet == (len(entry.left), len(entry.right), len(entry.middle))
    ]


def planned_lift(clock: Array, phase: Array, duty: float) -> Array:
    """Planned height of the feet: a half sine over the swing, 0 in stance, 1 at mid-swing.

    Here a cycle begins with the swing, as a contract's clock does.

    Args:
        clock: gait clock in cycles, shape (..., 1).
        phase: (feet,) or (joints,) phase at clock 0, an array of the same library.
        duty: share of the cycle in stance.
    """
    xp = library(clock)
    progress = (clock + phase) % 1.0 / (1.0 - duty)  # of the swing; above 1 in stance
    return xp.where(progress < 1.0, xp.sin(xp.pi * progress), xp.zeros_like(progress))


def _sides(robot: Robot) -> tuple[list[int], list[int], list[int]]:
    """Feet on the left, on the right and in the middle, each from front to back."""
    positions = robot.foot_positions
    order = np.argsort(-positions[:, 0], kind="stable").tolist()
    leftward = {foot: positions[foot, 1] for foot in order}
    return (
        [foot for foot in order if leftward[foot] > MIDDLE_M],
        [foot for foot in order if leftward[foot] < -MIDDLE_M],
        [foot for foot in order if abs(leftward[foot]) <= MIDDLE_M],
    )


def _gaits_for(feet: int) -> Iterator[tuple[str, GaitEntry]]:
    for name, entry in _gaits_by_feet().get(feet, {}).items():
        yield name, structure(entry, GaitEntry, f"{GAITS}: {feet}: {name}")


@cache
def _gaits_by_feet() -> dict[int, dict[str, Any]]:
    return read_yaml(GAITS)
