"""Writes `controllers.yaml` for an imported robot: a shipped robot's settings, scaled to another size.

The settings come from the shipped robot with as many feet, or else with the next larger number. Each setting
has a unit. The ratios of mass m, of standing height l and of time sqrt(l) give its factor (dynamic
similarity, see `training_yaml.py`): a torque or a stiffness grows with m l, a speed with sqrt(l). Where feet
stand and how large they are is measured, not scaled by height.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np
import yaml

from footfall.common.config import read_yaml
from footfall.robots.description import available_robots, load_robot
from footfall.robots.importer.pose import lowest_height
from footfall.robots.mjcf import load_spec
from footfall.robots.stance import in_default_pose

DIGITS = 4
SMALLEST_SOLE_M = 2e-3
# Times of `step` on point feet over those on soles: a point cannot shift its pressure, so steps are quicker.
STEP_TIME, DOUBLE_SUPPORT, EARLIEST, LATEST = 0.6, 0.4, 0.42, 0.63
IMMEDIATE_START = {"capture_m": 1e-4, "near_m": 1.0}  # start of a robot that cannot stand still
IMMEDIATE_SETTLE_S = 0.05

Unit = tuple[float, float, float]  # exponents of kg, m and s
NO_UNIT: Unit = (0, 0, 0)

# Units by the end of a setting's name. All other settings are shares, counts, angles or rates of the loop.
BY_SUFFIX: dict[str, Unit] = {
    "_rad_s2": (0, 0, -2),
    "_m_s2": (0, 1, -2),
    "_rad_s": (0, 0, -1),
    "_m_s": (0, 1, -1),
    "_m": (0, 1, 0),
    "_n": (1, 1, -2),
    "_s": (0, 0, 1),
}
# Units by the end of a setting's key. The longest match counts.
BY_KEY: dict[str, Unit] = {
    "kp": (1, 2, -2),
    "kd": (1, 2, -1),
    "stiffness": (0, 0, -2),
    "damping": (0, 0, -1),
    "momentum_damping": (0, 0, -1),
    "heading.gain": (0, 0, -1),
    "standing_command": (0, 1, -1),
    "weights.position": (0, -2, 0),
    "weights.angular_rate": (0, 0, 2),
    "weights.velocity": (0, -2, 2),
    "weights.force": (-2, -2, 4),
    "weights.force_change": (-2, -2, 4),
    "weights.moment": (-2, -4, 4),
    "weights.place": (0, -2, 0),
    "weights.offset": (0, -2, 0),
    "whole_body.weights.momentum": (0, -4, 4),
    "whole_body.weights.attitude": (0, 0, 4),
    "whole_body.weights.swing_attitude": (0, 0, 4),
    "whole_body.weights.posture": (0, 0, 4),
    "whole_body.weights.force": NO_UNIT,
}
# Distances that are measured on both robots, and the fields of `Size` that have them.
MEASURED = {
    "apart_m": "apart_m",
    "sideways_m": "apart_m",
    "outward_m": "spread_m",
    "half_length_m": "sole_length_m",
    "half_width_m": "sole_width_m",
}
# A leg moves its foot sideways if a hinge axis has at least this component across the y direction.
SIDEWAYS = 0.1
# Minimum duty factor under MPC for legs that cannot push sideways, so that more feet stand.
PLANAR_DUTY = 0.65


class Size(NamedTuple):
    """The quantities by which settings are scaled."""

    mass_kg: float
    height_m: float  # of the base, standing
    spread_m: float  # height_m; 0 if a leg cannot move its foot sideways
    apart_m: float  # from the rightmost foot to the leftmost one, middle to middle
    sole_length_m: float  # of one foot's points of contact
    sole_width_m: float


class Walking(NamedTuple):
    """Settings of the hand-written controllers."""

    sections: dict[str, Any]  # by controller
    origin: str  # the source of the settings
    kp: float  # the largest gains among them, N m/rad and N m s/rad
    kd: float


class Limb(Protocol):
    """A leg: names of its foot's geoms, and of its joints."""

    @property
    def geoms(self) -> tuple[str, ...]: ...
    @property
    def joints(self) -> tuple[str, ...]: ...


def size_of(model: mujoco.MjModel, data: mujoco.MjData, legs: Sequence[Limb]) -> Size:
    """The size of a robot whose base is body 1, in its default pose.

    Args:
        model: model with a free base.
        data: data with computed kinematics and a level base.
        legs: each with a foot of spheres and ellipsoids.
    """
    feet = [leg.geoms for leg in legs]
    positions = [np.array([data.geom(name).xpos for name in geoms]) for geoms in feet]
    middles = np.array([points.mean(axis=0) for points in positions])
    extent = np.mean([np.ptp(points, axis=0) for points in positions], axis=0)
    lowest = min(lowest_height(model, data, model.geom(name).id) for geoms in feet for name in geoms)
    height = float(data.xpos[1][2] - lowest)
    out_of_plane = [max(np.hypot(*data.joint(name).xaxis[::2]) for name in leg.joints) for leg in legs]
    return Size(
        float(model.body_mass.sum()),
        height,
        height if min(out_of_plane) > SIDEWAYS else 0.0,
        float(np.ptp(middles[:, 1])),
        max(float(extent[0]), SMALLEST_SOLE_M),
        max(float(extent[1]), SMALLEST_SOLE_M),
    )


def scaled_controllers(size: Size, feet: int, stiffest: float) -> Walking:
    """Settings of the shipped robot with as many feet, scaled to another size.

    Args:
        size: size of the other robot.
        feet: number of feet.
        stiffest: largest stiffness of the robot's own gains, N m/rad; the minimum for `stand`.
    """
    shipped = {name: load_robot(name) for name in available_robots()}
    counts = {name: len(robot.description.feet) for name, robot in shipped.items()}
    name = min(counts, key=lambda each: (counts[each] < feet, abs(counts[each] - feet)))
    robot = shipped[name]
    model = load_spec(robot.xml_path).compile()
    data = in_default_pose(model, robot.description)
    mujoco.mj_kinematics(model, data)
    source = size_of(model, data, robot.description.feet)
    sections = _scaled(read_yaml(robot.folder / "controllers.yaml"), "", source, size)
    if size.spread_m == 0.0:
        _raise_duty(sections)
    stand = sections["stand"]
    factor = max(1.0, stiffest / stand["kp"])
    stand |= {key: _rounded(factor * stand[key]) for key in ("kp", "kd")}
    if "step" in sections and max(size.sole_length_m, size.sole_width_m) <= SMALLEST_SOLE_M:
        sections = {"step": _immediate_stepping(sections["step"])}
    origin = f"{name} ({source.mass_kg:.3g} kg, standing {source.height_m:.3g} m high)"
    return Walking(sections, origin, _largest(sections, "kp"), _largest(sections, "kd"))


def controllers_yaml(walking: Walking, gaits: Sequence[str]) -> str:
    """The text of `controllers.yaml`, without controllers whose gait is not among the robot's.

    `step` needs a left and a right foot, as every gait of two feet does.
    """
    names = [name for name, section in walking.sections.items() if _gait(section) in (None, *gaits)]
    if not gaits and "step" in names:
        names.remove("step")
    sections = {name: walking.sections[name] for name in names}
    head = f"# Settings of the hand-written controllers (policies/controllers/): those of {walking.origin},\n"
    head += "# scaled by mass, height and feet. Not tuned.\n"
    return head + yaml.safe_dump(sections, sort_keys=False, default_flow_style=None, width=110)


def _immediate_stepping(step: dict[str, Any]) -> dict[str, Any]:
    """The settings of `step` for point feet: it steps from the beginning, and faster."""
    gait, limits = step["gait"], step["gait"]["limits"]
    gait["step_s"] = _rounded(STEP_TIME * gait["step_s"])
    gait["double_support_s"] = _rounded(DOUBLE_SUPPORT * gait["double_support_s"])
    soonest, latest = limits["time_s"]
    limits["time_s"] = [_rounded(EARLIEST * soonest), _rounded(LATEST * latest)]
    step["start"] |= IMMEDIATE_START
    step["settle_s"] = IMMEDIATE_SETTLE_S
    step["whole_body"]["weights"]["swing_attitude"] = 0.0  # a point has no attitude
    return step


def _raise_duty(sections: dict[str, Any]) -> None:
    """Raise the duty factor of the controllers that plan forces."""
    for section in sections.values():
        plan = section.get("plan", section)
        if "horizon" in plan:
            plan["gait"]["duty"] = max(plan["gait"]["duty"], PLANAR_DUTY)


def _gait(section: dict[str, Any]) -> str | None:
    """The name of the gait in a controller's settings, or None."""
    gait = section.get("plan", section).get("gait", {})
    return gait.get("name") if isinstance(gait, dict) else None


def _scaled(value: Any, key: str, source: Size, target: Size) -> Any:
    """A copy of a setting, recursively, with numbers scaled from one size of robot to another."""
    if isinstance(value, dict):
        return {name: _scaled(each, f"{key}.{name}", source, target) for name, each in value.items()}
    if isinstance(value, list):
        return [_scaled(each, key, source, target) for each in value]
    if not isinstance(value, float):
        return value
    return _rounded(value * _factor(key, source, target))


def _factor(key: str, source: Size, target: Size) -> float:
    """Ratio of a setting's value on the other robot."""
    measured = MEASURED.get(key.rpartition(".")[2])
    if measured is not None:
        return float(getattr(target, measured) / getattr(source, measured))
    length = target.height_m / source.height_m
    kg, m, s = _unit(key)
    return float((target.mass_kg / source.mass_kg) ** kg * length ** (m + s / 2))


def _unit(key: str) -> Unit:
    """The unit of a setting by its whole key, names joined by dots."""
    fitting = [known for known in BY_KEY if f".{key}".endswith(f".{known}")]
    if fitting:
        return BY_KEY[max(fitting, key=len)]
    return next((unit for suffix, unit in BY_SUFFIX.items() if key.endswith(suffix)), NO_UNIT)


def _largest(value: Any, name: str) -> float:
    """The largest number with this name in a section, recursively; 0 if there is none."""
    if not isinstance(value, dict):
        return 0.0
    return max((each if key == name else _largest(each, name) for key, each in value.items()), default=0.0)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
