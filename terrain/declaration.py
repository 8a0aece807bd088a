"""Grounds as data: a shape and its parameters, or a height map in a file."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from footfall.common.config import read_yaml, require_between, structure, takes_other_keys
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.common.terms import bind, parameters
from footfall.terrain.ground import MAX_CELLS, Ground
from footfall.terrain.shapes import RIM_M, SHAPES, Positions

NAMED = Path(__file__).parent / "grounds.yaml"


@takes_other_keys("settings")
@dataclass(frozen=True)
class GroundConfig:
    """A shape and its parameters, as written in YAML."""

    shape: str
    _: KW_ONLY
    size_m: float = 10.0  # side of the piece; beyond it the ground continues at the rim's height
    cell_m: float = 0.05
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            known = f"there are {', '.join(SHAPES)}{did_you_mean(self.shape, SHAPES)}"
            raise ValueError(f"no shape '{self.shape}': {known}")
        require_between(self, 2.0 * RIM_M, 100.0, "size_m")
        require_between(self, 0.01, 0.5, "cell_m")
        cells = round(self.size_m / self.cell_m)
        if cells > MAX_CELLS:
            raise ValueError(f"size_m / cell_m must be {MAX_CELLS} at most, not {cells}")


def parameters_of_shapes() -> list[str]:
    """Names of the parameters of all shapes, each once."""
    return list(dict.fromkeys(name for shape in SHAPES.values() for name in parameters(shape.heights)))


def check_ground(config: GroundConfig, where: str = "ground") -> None:
    """Raise UserError if a parameter of the shape is unknown or wrong."""
    bind(SHAPES[config.shape].heights, config.settings, where)


def make_ground(config: GroundConfig, seed: int, where: str = "ground") -> Ground:
    """The ground of a declaration, one piece; the seed determines its random heights.

    Raises:
        UserError: as `check_ground`; the message begins with `where`.
    """
    shape = SHAPES[config.shape]
    heights = bind(shape.heights, config.settings, where)
    cells = round(config.size_m / config.cell_m)
    half_m = 0.5 * cells * config.cell_m
    coordinates = np.arange(cells + 1) * config.cell_m - half_m
    if shape.stepped:  # heights at cell centres; the last one is a copy that no point reads
        coordinates = np.minimum(coordinates, coordinates[-2]) + 0.5 * config.cell_m
    x, y = np.meshgrid(coordinates, coordinates, indexing="ij")
    values = heights(Positions(x, y, half_m), np.random.default_rng(seed))
    return Ground(values[None], np.array([shape.stepped]), config.cell_m)


def at_difficulty(config: GroundConfig, difficulty: float) -> GroundConfig:
    """A ground with each parameter [easiest, hardest] interpolated: 0 is easiest, 1 hardest."""

    def interpolated(value: Any) -> Any:
        is_range = isinstance(value, list) and len(value) == 2
        return value[0] + difficulty * (value[1] - value[0]) if is_range else value

    return replace(config, settings={name: interpolated(value) for name, value in config.settings.items()})


def pieces(configs: Sequence[GroundConfig], levels: int, seed: int, where: str) -> Ground:
    """Grounds at rising levels of difficulty: piece `kind * levels + level`.

    Raises:
        UserError: as `check_ground`; the message begins with `where` and the entry.
    """
    grounds = [
        make_ground(at_difficulty(config, level / max(1, levels - 1)), seed + level, f"{where}[{kind}]")
        for kind, config in enumerate(configs)
        for level in range(levels)
    ]
    heights, stepped = (
        np.concatenate([getattr(ground, part) for ground in grounds]) for part in ("heights", "stepped")
    )
    return Ground(heights, stepped, grounds[0].cell_m)


@cache
def named_grounds() -> Mapping[str, GroundConfig]:
    """The grounds that ship, by name."""
    return structure(read_yaml(NAMED), dict[str, GroundConfig], str(NAMED))


def load_ground(spec: str, seed: int = 0) -> Ground:
    """The ground that a user names: a shipped ground, with changes, or a height map in a file.

    Args:
        spec: `stairs`, `stairs,step_m=0.1`, or the path of a .npy or .png file (see `height_map`).
        seed: seed of random heights.

    Raises:
        UserError: there is no such ground, or a change is wrong.
    """
    name, *changes = spec.split(",")
    known = named_grounds()
    if name in known:
        settings = {**vars(known[name]), "settings": {**known[name].settings, **_values(changes, spec)}}
        return make_ground(GroundConfig(**settings), seed, f"ground '{spec}'")
    if Path(name).suffix.lower() in (".npy", ".png"):
        from footfall.terrain.height_map import read_height_map

        return read_height_map(Path(name), **_values(changes, spec))
    raise UserError(
        f"no ground '{name}': give one of {', '.join(known)}, or a .npy or .png file"
        f"{did_you_mean(name, known)}"
    )


def _values(changes: list[str], spec: str) -> dict[str, float]:
    """KEY=VALUE items as numbers."""
    values = {}
    for change in changes:
        key, equals, text = change.partition("=")
        try:
            values[key] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise UserError(f"ground '{spec}': '{change}' is not KEY=NUMBER")
    return values
