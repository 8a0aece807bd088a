"""Test of one foot: how closely it reaches positions in the air, or how hard it presses on a scale."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_between
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.easing import smooth_rise
from footfall.policies.contract import Contract
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.momentum import external_torque, upward_force
from footfall.robots.readings import Sensed

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class FootTestConfig:
    """Settings of the test and its limits."""

    settle_s: float = 1.5  # from the initial pose to the default pose
    move_s: float = 1.0  # from one position or force to the next
    hold_s: float = 1.0  # at each position; the second half is averaged
    press_s: float = 6.0  # at each force: time to read the scale
    reach_m: float = 0.03  # from the default pose, along each axis
    presses: tuple[float, ...] = (0.1, 0.2, 0.3)  # shares of the robot's weight
    press_stiffness: float = 0.2  # stiffness of the pressing leg, relative to the robot's own gain
    error_m: float = 0.01  # largest error of a position
    error_share: float = 0.15  # largest error of the force that the motors report

    def __post_init__(self) -> None:
        require_between(self, 0.1, 60.0, "settle_s", "move_s", "hold_s", "press_s")
        require_between(self, 0.001, 0.3, "reach_m", "error_m")
        require_between(self, 0.0, 1.0, "press_stiffness", "error_share")
        if len(self.presses) < 2 or any(not 0.0 < each <= 1.0 for each in self.presses):
            raise ValueError("presses needs two or more shares of the weight, above 0, at most 1")


class Hold(NamedTuple):
    """A position of the foot and a force on the ground, held for a time."""

    offset: np.ndarray  # (3,) m, from the default pose, base frame
    force_n: float  # downwards
    duration_s: float


class Measurement(NamedTuple):
    """Measurements during a hold."""

    hold: Hold
    offset: np.ndarray  # (3,) m, by the encoders
    force_n: float  # by the motors' torques
    scale_n: float  # by the scale; NaN until it is read


def reaches(config: FootTestConfig) -> list[Hold]:
    """Holds at both ends of each axis."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    return [Hold(config.reach_m * axis, 0.0, config.hold_s) for axis in axes]


def presses(robot: Robot, config: FootTestConfig) -> list[Hold]:
    """Holds with increasing forces in the default pose: friction then always acts in the same direction."""
    weight_n = GRAVITY_M_S2 * robot.legs.mass
    return [Hold(np.zeros(3), share * weight_n, config.press_s) for share in sorted(config.presses)]


class FootTest:
    """A policy that moves one foot through holds; the other legs keep the default pose."""

    name = "foot test"
    needs_estimate = False
    contract: Contract | None = None
    notes: Sequence[str] = ()

    def __init__(
        self,
        robot: Robot,
        leg: int,
        holds: Sequence[Hold],
        config: FootTestConfig,
        rate_hz: float,
        weigh: Callable[[], float] = lambda: np.nan,
    ) -> None:
        """Plan the motion.

        Args:
            robot: robot on a stand.
            leg: index of the leg.
            holds: what to do, one after the other.
            config: settings.
            rate_hz: rate of the policy, which may be the rate of the joint ticks.
            weigh: reads the scale, N.
        """
        self.rate_hz, self._robot, self._leg, self._config = rate_hz, robot, leg, config
        self._weigh, self._remaining = weigh, list(holds)
        self._start = robot.default_pose
        self._hold_start_s, self._previous = config.settle_s, Hold(np.zeros(3), 0.0, 0.0)
        self._samples: list[tuple[np.ndarray, float, float]] = []
        self.measured: list[Measurement] = []

    @property
    def duration_s(self) -> float:
        """Duration of the rest of the test."""
        return self._config.settle_s + sum(self._config.move_s + each.duration_s for each in self._remaining)

    @property
    def done(self) -> bool:
        """Whether all holds are over."""
        return not self._remaining

    def reset(self, inputs: PolicyInput) -> None:
        self._start = inputs.sensed.joint_position.copy()

    def stance(self) -> np.ndarray | None:
        return None

    def act(self, inputs: PolicyInput) -> JointCommand:
        robot, sensed, time_s, zero = self._robot, inputs.sensed, inputs.time_s, np.zeros_like(self._start)
        if time_s < self._config.settle_s or self.done:
            share = smooth_rise(time_s / self._config.settle_s)
            target = self._start + share * (robot.default_pose - self._start)
            return JointCommand(target, zero, robot.kp, robot.kd, zero)
        hold, since_s = self._remaining[0], time_s - self._hold_start_s
        share = smooth_rise(since_s / self._config.move_s)
        offset = self._previous.offset + share * (hold.offset - self._previous.offset)
        force_n = self._previous.force_n + share * (hold.force_n - self._previous.force_n)
        if since_s >= self._config.move_s + 0.5 * hold.duration_s:
            self._measure(inputs)
        if since_s >= self._config.move_s + hold.duration_s:
            self._finish(time_s)
        return self._command(sensed, offset, force_n, self._config.press_stiffness if hold.force_n else 1.0)

    def _command(self, sensed: Sensed, offset: np.ndarray, force_n: float, stiffness: float) -> JointCommand:
        robot, legs, leg = self._robot, self._robot.legs, self._leg
        foot, ground = legs.default_foot.copy(), np.zeros((legs.count, 3))
        foot[leg] += offset
        ground[leg] = force_n * UP
        weight = legs.holding_torque(sensed.joint_position, sensed.acceleration)
        push = legs.torque(legs.pose(sensed.joint_position).jacobian, ground)
        selected = np.zeros_like(robot.kp)
        selected[robot.foot_joints[leg]] = 1.0
        return JointCommand(
            legs.scatter(legs.solve(foot), robot.default_pose),
            np.zeros_like(robot.kp),
            robot.kp * np.where(selected > 0.0, stiffness, 1.0),
            robot.kd,
            selected * legs.scatter(weight + push, np.zeros_like(robot.kp)),
        )

    def _measure(self, inputs: PolicyInput) -> None:
        legs, sensed = self._robot.legs, inputs.sensed
        pose = legs.pose(sensed.joint_position)
        external = external_torque(legs, sensed, sensed.joint_torque)
        force = upward_force(pose.jacobian, external[..., None], UP)[self._leg, 0]
        offset = (pose.foot - legs.default_foot)[self._leg]
        self._samples.append((offset.copy(), float(force), self._weigh()))

    def _finish(self, time_s: float) -> None:
        offset, force, scale = (np.mean(each, axis=0) for each in zip(*self._samples, strict=True))
        self._previous = self._remaining.pop(0)
        self.measured.append(Measurement(self._previous, offset, float(force), float(scale)))
        self._samples, self._hold_start_s = [], time_s


def largest_error(measured: Sequence[Measurement]) -> float:
    """Largest distance between a commanded and a measured position of the foot, m."""
    return max(float(np.linalg.norm(each.offset - each.hold.offset)) for each in measured)


def press_findings(measured: Sequence[Measurement], config: FootTestConfig) -> list[str]:
    """Problems of the forces; empty if there are none.

    Slopes over all holds are compared: a preload, or a scale with another zero, has no effect.
    """
    scale = [each.scale_n for each in measured]
    pairs = (
        ("commanded force", [each.hold.force_n for each in measured]),
        ("force that the motors report", [each.force_n for each in measured]),
    )
    shares = {name: float(np.polyfit(force, scale, 1)[0]) for name, force in pairs}
    return [
        f"the scale shows {share:.2f} times the {name}: the factor must be 1, within {config.error_share:g}"
        for name, share in shares.items()
        if abs(share - 1.0) > config.error_share
    ]


def reach_findings(measured: Sequence[Measurement], config: FootTestConfig) -> list[str]:
    """Problems of the positions; empty if there are none."""
    error_m = largest_error(measured)
    if error_m <= config.error_m:
        return []
    return [f"the foot is {1e3 * error_m:.0f} mm off: {1e3 * config.error_m:g} mm at most"]
