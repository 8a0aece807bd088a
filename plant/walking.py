"""Tests whether a robot's hand-written controllers stand and walk, each over the simulated bus."""

import math
from dataclasses import dataclass, replace

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.plant.episode import Episode, run_episode
from footfall.plant.trace import Trace
from footfall.policies.registry import CONTROLLERS, controllers_of, load_policy
from footfall.robots.description import Robot

SPEED_SHARE = 0.5  # of the robot's highest forward command
# Shares of the commanded speed: below the first the robot does not walk, below the second it walks slowly.
WALKS_SHARE, SLOW_SHARE = 0.1, 0.5
MEASURED_SHARE = 0.5  # speeds are measured in the last share of the time
MAX_SWAY = 0.05  # speed of a standing base, over sqrt(gravity times standing height)
MAX_DRIFT = 0.2  # drift of a standing robot, as a share of its standing height


@dataclass(frozen=True)
class ControllerResult:
    """Result of a controller's test."""

    name: str
    walks: bool  # whether the command was to walk
    command_m_s: float  # forward
    speed_m_s: float  # mean forward speed once settled
    sway_m_s: float  # largest horizontal speed of the base once settled
    trouble: str  # reason of the failure; empty on success
    trace: Trace | None  # None if the controller refused its settings

    @property
    def outcome(self) -> str:
        """The result in words."""
        if self.trouble or self.trace is None or not self.walks:
            return self.trouble or "stands"
        if self.speed_m_s >= SLOW_SHARE * self.command_m_s:
            return "walks"
        return "; ".join(["walks slowly", *self.trace.notes])


def controllers_test(robot: Robot, duration_s: float = 4.0, seed: int = 0) -> list[ControllerResult]:
    """Let each controller that the robot has settings for stand still, or walk forward at half top speed.

    A controller that refuses its settings has failed; the others are still tested.

    Raises:
        UserError: the file of settings is not YAML, or names an unknown controller.
    """
    return [_test(robot, name, duration_s, seed) for name in controllers_of(robot)]


def _test(robot: Robot, name: str, duration_s: float, seed: int) -> ControllerResult:
    walks = CONTROLLERS[name].walks
    speed = round(SPEED_SHARE * robot.description.commands.forward_m_s[1], 2) if walks else 0.0
    command = np.array([speed, 0.0, 0.0])
    episode = Episode(command_source=lambda _: command, duration_s=duration_s, seed=seed)
    try:
        policy = load_policy(name, robot)
    except UserError as error:
        return ControllerResult(name, walks, speed, 0.0, 0.0, str(error).removeprefix(f"{name}: "), None)
    trace = run_episode(robot, policy, episode)
    settled = slice(int(len(trace.time_s) * (1 - MEASURED_SHARE)), None)
    velocity = trace.base_velocity[settled, :2]
    result = ControllerResult(
        name=name,
        walks=walks,
        command_m_s=speed,
        speed_m_s=float(velocity[:, 0].mean()) if len(velocity) else 0.0,
        sway_m_s=float(np.linalg.norm(velocity, axis=1).max(initial=0.0)),
        trouble="",
        trace=trace,
    )
    return replace(result, trouble=_trouble(robot, result, trace, duration_s))


def _trouble(robot: Robot, result: ControllerResult, trace: Trace, duration_s: float) -> str:
    """Reason of the failure; empty on success."""
    height_m = robot.description.standing_height_m
    failed = trace.fall_reason or "; ".join(trace.faults) or ("the simulation diverged" if trace.fell else "")
    if failed:
        return f"{failed}, after {trace.walked_s:.1f} of {duration_s:.1f} s"
    if result.walks:
        if result.speed_m_s >= WALKS_SHARE * result.command_m_s:
            return ""
        return "; ".join([f"it does not walk at {result.command_m_s:.2f} m/s", *trace.notes])
    if result.sway_m_s > MAX_SWAY * math.sqrt(GRAVITY_M_S2 * height_m):
        return f"it sways at {result.sway_m_s:.2f} m/s after {(1 - MEASURED_SHARE) * duration_s:.1f} s"
    moved = float(np.linalg.norm(trace.base_position[-1, :2] - trace.base_position[0, :2]))
    if moved > MAX_DRIFT * height_m:
        return f"it moves by {moved:.2f} m"
    return ""
