"""Live settings of a walk."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import configured_controllers
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.gaits import gaits_of
from footfall.policies.live_settings import Applied, Span, shared
from footfall.robots.description import Robot

_STEP = {"step_height_m": "height_m", "step_length_m": "length_m", "body_height_m": "body_height_m"}
ATTITUDE = ("roll_rad", "pitch_rad")


def live_settings(config: WalkConfig, period_s: float) -> dict[str, Span]:
    """The settings that a walk has, about those in its configuration and its gait's own period."""
    most = config.levelling.most_attitude_rad
    step = {name: getattr(config.step, field) for name, field in _STEP.items()}
    spans = shared({"step_period_s": period_s, **step})
    return spans | dict.fromkeys(ATTITUDE, Span(-most, most, 0.0))


def changed_step(step: StrideConfig, values: Mapping[str, float]) -> StrideConfig:
    """A stride with the values that are its own."""
    return replace(step, **{field: values[name] for name, field in _STEP.items() if name in values})


def applied(
    gait: str, period_s: float, step: StrideConfig, body_height_m: float, attitude: np.ndarray
) -> Applied:
    """What a walk steps with now. The height of a step holds from the next lift-off on."""
    values = {name: getattr(step, field) for name, field in _STEP.items()}
    now = {"step_period_s": period_s, **values, "body_height_m": body_height_m}
    return Applied(gait, now | dict(zip(ATTITUDE, attitude.tolist(), strict=True)))


def all_gaits(robot: Robot, config: WalkConfig) -> dict[str, GaitConfig]:
    """The gaits that a walk can take up, as in the robot's settings; one without has the walk's period."""
    own = config.gait
    settings = {
        name: section["gait"]
        for name, section in configured_controllers(robot).items()
        if isinstance(section, dict) and name == section.get("gait", {}).get("name")
    }
    gaits = {
        name: GaitConfig(**settings.get(name, {"name": name, "period_s": own.period_s}))
        for name in (gaits_of(robot) if config.gaits is None else config.gaits)
    }
    return gaits | {own.name: own}
