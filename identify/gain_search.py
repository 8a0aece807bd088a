"""Step responses of joints, and the search for their gains: raised until a joint rings, then reduced.

First the stiffness is tuned at the robot's own damping, then the damping at the new stiffness.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from footfall.common.config import require_between
from footfall.common.easing import smooth_rise
from footfall.identify.excitation import swing_senses
from footfall.policies.contract import Contract
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

RISE_SHARES = (0.1, 0.9)  # of the final travel: the rise time is the time between them
MIN_GAIN = 0.05  # relative to the robot's own gain; the search stops below it
TORQUE_SHARE = 0.3  # maximum torque requested by a step, relative to a motor's peak torque
MAX_ERROR_STEPS = 3.0  # position error, in steps, at which a trial ends at once


@dataclass(frozen=True)
class GainConfig:
    """Settings of the steps and of the search. Gains are relative to the robot's own."""

    settle_s: float = 1.0  # from the initial pose to the default pose, and rest after ringing
    step_rad: float = 0.05
    trial_s: float = 0.6  # duration of each step
    raise_by: float = 1.25
    max_gain: float = 8.0  # maximum gain
    backoff: float = 0.8  # proposed gain, relative to the lowest gain that rings
    rings_rad: float = 0.1  # peak to peak in the second half of a trial, in steps: 0.1 x step_rad
    rings_rad_s: float = 0.3  # rms velocity in the second half of a trial

    def __post_init__(self) -> None:
        require_between(self, 0.1, 60.0, "settle_s", "trial_s")
        require_between(self, 0.005, 0.5, "step_rad")
        require_between(self, 1.01, 4.0, "raise_by")
        require_between(self, 1.0, 100.0, "max_gain")
        require_between(self, 0.1, 0.95, "backoff")
        require_between(self, 0.1, 1.0, "rings_rad")
        require_between(self, 0.01, 10.0, "rings_rad_s")


class Response(NamedTuple):
    """Response of a joint to a step."""

    rise_s: float  # from 10 to 90 % of its final travel; NaN if it does not move
    overshoot: float  # relative to the step
    rings: bool


class Gains(NamedTuple):
    """Gains relative to the robot's own."""

    kp: float = 1.0
    kd: float = 1.0


class Tuned(NamedTuple):
    """Result for one joint. Gains are relative to the robot's own; None: none of the tested gains rings."""

    own: Response  # with the robot's own gains
    kp_rings: float | None
    kd_rings: float | None
    proposed: Gains

    def figures(self) -> dict[str, Any]:
        """Plain values for a file."""
        limits = {"kp_rings": self.kp_rings, "kd_rings": self.kd_rings}
        return {"own": self.own._asdict(), **limits, "proposed": self.proposed._asdict()}


RESTING_GAINS = Gains(0.5, 1.0)  # for joints not being tested, and after ringing

Search = Generator[Gains, Response, Tuned]
"""Yields the gains of the next trial and takes its response."""


def response_of(
    time_s: np.ndarray, position: np.ndarray, velocity: np.ndarray, step: float, config: GainConfig
) -> Response:
    """Rise, overshoot and ringing.

    Args:
        time_s: time since the step, (T,).
        position: position relative to the one before the step, rad, (T,).
        velocity: velocity, rad/s, (T,).
        step: change of the target, rad, signed.
        config: thresholds of ringing.
    """
    share = position / step
    second_half = time_s >= 0.5 * time_s[-1]
    final = float(share[second_half].mean())
    above_first, above_last = (np.flatnonzero(share >= each * final) for each in RISE_SHARES)
    rise_s = (
        float(time_s[above_last[0]] - time_s[above_first[0]]) if final > 0.0 and len(above_last) else np.nan
    )
    rings = (
        np.ptp(share[second_half]) > config.rings_rad
        or np.sqrt((velocity[second_half] ** 2).mean()) > config.rings_rad_s
        or np.abs(share - 1.0).max() > MAX_ERROR_STEPS
    )
    return Response(rise_s, max(0.0, float(share.max()) - final), bool(rings))


def search(config: GainConfig) -> Search:
    """The search for one joint's gains."""
    own = yield Gains()
    kp, kp_rings = yield from _limit(lambda share: Gains(kp=share), config, own)
    calm = Response(np.nan, 0.0, False)
    kd, kd_rings = yield from _limit(lambda share: Gains(kp, share), config, calm)
    return Tuned(own, kp_rings, kd_rings, Gains(kp, kd))


def _limit(
    gains: Callable[[float], Gains], config: GainConfig, first: Response
) -> Generator[Gains, Response, tuple[float, float | None]]:
    """A gain that does not ring, and the lowest gain that rings.

    If no gain rings, there is no reason to change the robot's own gain.

    Args:
        gains: gains of a trial, from the tuned gain relative to the robot's own.
        config: settings of the search.
        first: response to the robot's own gain.
    """
    share, response = 1.0, first
    if response.rings:
        while response.rings and share > MIN_GAIN:
            lowest_ringing, share = share, share * config.backoff
            response = yield gains(share)
        return share, lowest_ringing
    while share * config.raise_by <= config.max_gain:
        share *= config.raise_by
        response = yield gains(share)
        if response.rings:
            return config.backoff * share, share
    return 1.0, None


class GainSearch:
    """A policy that tests step responses of a robot on a stand, one joint of each leg at a time."""

    name = "gain search"
    needs_estimate = False
    contract: Contract | None = None
    notes: Sequence[str] = ()

    def __init__(self, robot: Robot, config: GainConfig, rate_hz: float) -> None:
        """`rate_hz` is the rate of the policy, at most the rate of the joint ticks."""
        self.rate_hz, self._robot, self._config = rate_hz, robot, config
        self._default_pose = self._start = robot.default_pose
        self._senses = swing_senses(robot)
        longest = max(map(len, robot.foot_joints))
        self._remaining = [
            [int(joints[index]) for joints in robot.foot_joints if index < len(joints)]
            for index in range(longest)
        ]
        self._trials: list[_Trials] = []
        self.tuned: dict[int, Tuned] = {}  # by joint

    @property
    def duration_s(self) -> float:
        """Duration of the longest possible search."""
        config = self._config
        raises = math.ceil(math.log(config.max_gain) / math.log(config.raise_by))
        reductions = math.ceil(math.log(MIN_GAIN) / math.log(config.backoff))
        raised_s = raises * config.trial_s + config.settle_s  # at most the last trial rings
        reduced_s = (1 + reductions) * (config.trial_s + config.settle_s)  # every trial rings
        joint_s = 3 * config.trial_s + max(raised_s, reduced_s) + raised_s  # kp, then kd
        return config.settle_s + len(self._remaining) * joint_s

    @property
    def done(self) -> bool:
        """Whether all joints have a result."""
        return not self._remaining and not self._trials

    def reset(self, inputs: PolicyInput) -> None:
        self._start = inputs.sensed.joint_position.copy()

    def stance(self) -> np.ndarray | None:
        return None

    def act(self, inputs: PolicyInput) -> JointCommand:
        robot, sensed, time_s = self._robot, inputs.sensed, inputs.time_s
        zero = np.zeros_like(self._default_pose)
        target, kp, kd = self._default_pose.copy(), robot.kp.copy(), robot.kd.copy()
        if time_s < self._config.settle_s:
            share = smooth_rise(time_s, self._config.settle_s)
            target = self._start + share * (self._default_pose - self._start)
            return JointCommand(target, zero, kp, kd, zero)
        if not self._trials and self._remaining:
            self._trials = [self._trial(joint, time_s) for joint in self._remaining.pop(0)]
        for trial in list(self._trials):
            joint = trial.joint
            gains = trial.tick(time_s, sensed.joint_position[joint], sensed.joint_velocity[joint])
            target[joint] += trial.offset
            kp[joint] *= gains.kp
            kd[joint] *= gains.kd
            if trial.tuned is not None:
                self.tuned[joint] = trial.tuned
                self._trials.remove(trial)
        return JointCommand(target, zero, kp, kd, zero)

    def _trial(self, joint: int, time_s: float) -> "_Trials":
        max_nm, kp = TORQUE_SHARE * float(self._robot.motor.peak_torque[joint]), float(self._robot.kp[joint])

        def step(share: float) -> float:
            """Signed step; a larger one would saturate the motor and hide the gain."""
            return float(self._senses[joint]) * min(self._config.step_rad, max_nm / (share * kp))

        return _Trials(joint, step, self._config, time_s)


class _Trials:
    """The trials of one joint: the target alternates between the default pose and a step away from it."""

    def __init__(self, joint: int, step: Callable[[float], float], config: GainConfig, time_s: float) -> None:
        self.joint, self._step_of, self._config = joint, step, config
        self._search = search(config)
        self._gains = next(self._search)
        self.offset = 0.0
        self.tuned: Tuned | None = None
        self._begin_s = time_s + config.trial_s
        self._samples: list[tuple[float, float, float]] = []

    def tick(self, time_s: float, position: float, velocity: float) -> Gains:
        """The gains from now on. A trial ends after its time, or if the position error is too large."""
        if time_s < self._begin_s:
            return RESTING_GAINS
        if not self._samples:
            self._step = -self.offset if self.offset else self._step_of(self._gains.kp)
            self.offset += self._step
            self._first = position
        self._samples.append((time_s - self._begin_s, position - self._first, velocity))
        too_far = abs(position - self._first - self._step) > MAX_ERROR_STEPS * abs(self._step)
        if too_far or time_s - self._begin_s >= self._config.trial_s:
            self._finish(time_s)
        return self._gains

    def _finish(self, time_s: float) -> None:
        times_s, position, velocity = np.array(self._samples).T
        response = response_of(times_s, position, velocity, self._step, self._config)
        self._samples = []
        self._begin_s = time_s + (self._config.settle_s if response.rings else 0.0)
        try:
            self._gains = self._search.send(response)
        except StopIteration as end:
            self.tuned, self._gains = end.value, RESTING_GAINS
