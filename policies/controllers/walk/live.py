"""Live settings of a walk."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from footfall.common.errors import UserError
from footfall.policies.controllers.gait import GaitConfig, StepClock
from footfall.policies.controllers.settings import configured_controllers
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.gaits import gait_names, gaits_of
from footfall.policies.live_settings import Applied, Span, spans_around
from footfall.robots.description import Robot

_STEP = {"step_height_m": "height_m", "step_length_m": "length_m", "body_height_m": "body_height_m"}
ATTITUDE = ("roll_rad", "pitch_rad")


def live_settings(config: WalkConfig, period_s: float) -> dict[str, Span]:
    """Spans of the live settings, around the configuration's values and the gait's own period."""
    limit = config.levelling.max_attitude_rad
    step = {name: getattr(config.step, field) for name, field in _STEP.items()}
    spans = spans_around({"step_period_s": period_s, **step})
    return spans | dict.fromkeys(ATTITUDE, Span(-limit, limit, 0.0))


def changed_step(step: StrideConfig, values: Mapping[str, float]) -> StrideConfig:
    """A stride with the given values that belong to it."""
    return replace(step, **{field: values[name] for name, field in _STEP.items() if name in values})


@lru_cache(maxsize=4)  # called at each step, and the arguments rarely change
def applied(
    gait: str, period_s: float, step: StrideConfig, body_height_m: float, attitude: tuple[float, ...]
) -> Applied:
    """Gait and values that the walk uses now. A step's height applies from the next lift-off."""
    values = {name: getattr(step, field) for name, field in _STEP.items()}
    current = {"step_period_s": period_s, **values, "body_height_m": body_height_m}
    return Applied(gait, current | dict(zip(ATTITUDE, attitude, strict=True)))


def all_gaits(robot: Robot, config: WalkConfig) -> dict[str, GaitConfig]:
    """Gaits available to a walk, with the robot's settings; a gait without settings has the walk's period.

    Listed gaits that do not fit the robot's feet are left out: settings may come from another robot.

    Raises:
        UserError: no robot has a listed gait.
    """
    walk_gait, known, fitting = config.gait, gait_names(), gaits_of(robot)
    for name in config.gaits or ():
        if name not in known:
            raise UserError(f"gaits: no gait '{name}': there are {', '.join(known)}")
    settings = {
        name: section["gait"]
        for name, section in configured_controllers(robot).items()
        if isinstance(section, dict) and name == section.get("gait", {}).get("name")
    }
    gaits = {
        name: GaitConfig(**settings.get(name, {"name": name, "period_s": walk_gait.period_s}))
        for name in (fitting if config.gaits is None else config.gaits)
        if name in fitting
    }
    return gaits | {walk_gait.name: walk_gait}


class WalkSettings:
    """Current gait and step of a walk, and the requested gait."""

    def __init__(self, robot: Robot, config: WalkConfig) -> None:
        self._robot, self._config = robot, config
        self._gaits = all_gaits(robot, config)
        self.names = tuple(self._gaits)  # names of the gaits
        self.reset()

    def reset(self) -> None:
        """Return to the configuration's values."""
        self.step, self.gait = self._config.step, self._config.gait
        self.requested_gait = self.gait

    def find(self, name: str) -> GaitConfig:
        """Gait by name, with its own period."""
        return self._gaits[name]

    def request(self, gait: GaitConfig) -> None:
        """Set the requested gait; raises UserError if the robot has no such gait."""
        gait.clock(self._robot)
        self.requested_gait = gait

    def request_period(self, period_s: float) -> None:
        """Set the period of the requested gait, clamped to its span."""
        same, span = self.requested_gait == self.gait, self.spans["step_period_s"]
        period_s = min(max(period_s, span.lowest), span.highest)
        self.requested_gait = replace(self.requested_gait, period_s=period_s)
        self.gait = self.requested_gait if same else self.gait

    @property
    def spans(self) -> dict[str, Span]:
        """Spans of the live settings, around the requested gait's own period."""
        requested = self.requested_gait
        return live_settings(self._config, self._gaits.get(requested.name, requested).period_s)

    @property
    def changes_gait(self) -> bool:
        """Whether the requested gait differs from the current one."""
        return self.requested_gait != self.gait

    def change_gait(self) -> StepClock:
        """Make the requested gait the current one; returns its clock."""
        self.gait = self.requested_gait
        return self.gait.clock(self._robot)
