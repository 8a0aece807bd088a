"""Published figures of well-known actuators, by name, to complete a model file."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

from footfall.common.config import read_yaml, require_positive, structure
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.robots.importer.motors import ByJoint

TABLE = Path(__file__).with_name("actuators.yaml")


@dataclass(frozen=True)
class Actuator:
    """A row of `actuators.yaml`."""

    peak_torque_nm: float
    no_load_speed_rad_s: float
    gear_ratio: float
    source: str
    rated_torque_nm: float | None = None
    rotor_inertia_kg_m2: float | None = None
    reflected_inertia_kg_m2: float | None = None

    def __post_init__(self) -> None:
        require_positive(self, "peak_torque_nm", "no_load_speed_rad_s", "gear_ratio")

    @property
    def armature(self) -> float | None:
        """Inertia at the output, kg m^2; None if the maker does not publish it."""
        if self.reflected_inertia_kg_m2 is not None or self.rotor_inertia_kg_m2 is None:
            return self.reflected_inertia_kg_m2
        return self.rotor_inertia_kg_m2 * self.gear_ratio**2


class Figures(NamedTuple):
    """Figures by part of a joint's name."""

    peak_torque_nm: ByJoint
    speed_rad_s: ByJoint
    armature: ByJoint
    gear_ratio: ByJoint
    rated_torque_nm: ByJoint
    sources: tuple[str, ...]  # one line for each actuator


@cache
def actuators() -> dict[str, Actuator]:
    """The rows of the table, by name."""
    return {name: structure(row, Actuator, f"{TABLE}: {name}") for name, row in read_yaml(TABLE).items()}


def figures_of(chosen: Mapping[str, str]) -> Figures:
    """Figures of chosen actuators.

    Args:
        chosen: name of an actuator by part of the joints' names.

    Raises:
        UserError: there is no such actuator.
    """
    known = actuators()
    for name in chosen.values():
        if name not in known:
            raise UserError(
                f"--actuator: no actuator '{name}': there are {', '.join(known)}{did_you_mean(name, known)}"
            )
    rows = {part: known[name] for part, name in chosen.items()}
    return Figures(
        {part: row.peak_torque_nm for part, row in rows.items()},
        {part: row.no_load_speed_rad_s for part, row in rows.items()},
        {part: row.armature for part, row in rows.items() if row.armature is not None},
        {part: row.gear_ratio for part, row in rows.items()},
        {part: row.rated_torque_nm for part, row in rows.items() if row.rated_torque_nm is not None},
        tuple(f"motors {name}: {known[name].source}" for name in dict.fromkeys(chosen.values())),
    )
