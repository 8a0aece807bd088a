"""Getting up after a fall: consent, rest, and standing again."""

import math
from typing import NamedTuple

import numpy as np

from footfall.common.rotations import tilt
from footfall.deploy.clearance import Clearance
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.modes import Mode
from footfall.deploy.recovery_config import RecoveryConfig
from footfall.deploy.safety import State
from footfall.deploy.signals import RecoverySignals
from footfall.policies.policy import Policy
from footfall.robots.description import Robot


class GetUp(NamedTuple):
    """Consent of an operator to get up after a fall, with this policy."""

    policy: Policy
    spec: str = ""  # name or path of the policy, logged for a replay


class Recovered(NamedTuple):
    """A fall after which the robot got up."""

    fault: str  # reason why it counted as fallen
    fell_s: float  # by the loop's clock
    stood_s: float  # when it stood again
    tries: int


NO_RECOVERY = RecoverySignals()
SMOOTH_S = 0.1  # time constant of speeds: joints of a robot on a slope chatter in place


class Recovery:
    """Next action of a fallen robot, according to its readings."""

    def __init__(self, robot: Robot, config: RecoveryConfig, consent: bool) -> None:
        self._config, self._clearance, self._pose = config, Clearance(robot), robot.default_pose
        self._since_us: int | None = None  # start of the rest, or of standing
        self._mode = Mode.IDLE
        self._speeds, self._updated_us = np.zeros(len(robot.joint_names) + 3), 0  # of joints and base, rad/s
        self._fault, self._fell_s = "", 0.0
        self._consent = consent
        self._left_walking_s = -1.0  # time of the last walking
        self.recovery_s = 0.0  # total time from falls until the robot walked again
        self.recovered: list[Recovered] = []

    def revoke(self) -> None:
        """Revoke the consent after a failure of the program: the robot stays down."""
        self._consent = False

    def signals(
        self, now_us: int, state: State, joints: JointLayer, ending: bool, requested: bool
    ) -> RecoverySignals:
        """Signals on getting up, for the supervisor.

        Args:
            now_us: time of the loop.
            state: state of the supervisor.
            joints: joint layer with the latest readings.
            ending: whether a stop, or the end of the run, is requested.
            requested: whether an operator requests getting up.
        """
        if state.mode is not self._mode:
            self._mode, self._since_us = state.mode, None
            self._speeds = _speeds(joints)
        if state.mode is Mode.FALLING:
            if ending or not self._consent:
                return NO_RECOVERY
            lies_still = self._fastest(now_us, joints) < self._config.rest_rad_s
            rests = self._met_for_s(now_us, lies_still) >= self._config.rest_s
            ready = rests and (requested or not self._config.on_request)
            return RecoverySignals(allowed=True, ready=ready, tries=state.tries)
        if state.mode is Mode.RECOVERING:
            stands = self._met_for_s(now_us, self._stands(now_us, joints)) >= self._config.stand_s
            return RecoverySignals(stands=stands, tries=state.tries, tried_s=now_us * 1e-6 - state.since_s)
        return NO_RECOVERY

    def follow(self, before: State, state: State) -> str:
        """Follow a change of the state. Returns a note on it; empty for none."""
        lay_from_the_start = state.mode is Mode.RECOVERING and self._left_walking_s < 0.0
        if before.mode is Mode.WALKING or lay_from_the_start:
            self._left_walking_s = state.since_s
        elif state.mode is Mode.WALKING and before.tries:
            self.recovery_s += state.since_s - self._left_walking_s
        if state.mode is Mode.FALLING and not state.tries:
            self._fault, self._fell_s = state.faults[-1], state.since_s
        if before.mode is not Mode.RECOVERING or state.mode is not Mode.STANDING:
            return ""
        recovered = Recovered(self._fault, self._fell_s, state.since_s, state.tries)
        self.recovered.append(recovered)
        took_s = recovered.stood_s - recovered.fell_s
        return f"stood up again {took_s:.1f} s after a fall ({recovered.fault}), in try {recovered.tries}"

    def _met_for_s(self, now_us: int, met: bool) -> float:
        """Duration for which a condition has been met, s."""
        if not met:
            self._since_us = None
            return -1.0
        if self._since_us is None:
            self._since_us = now_us
        return (now_us - self._since_us) * 1e-6

    def _fastest(self, now_us: int, joints: JointLayer) -> float:
        """Largest speed of the joints and the base, smoothed since the start of the mode, rad/s."""
        decay = math.exp(-1e-6 * (now_us - self._updated_us) / SMOOTH_S)
        self._speeds = decay * self._speeds + (1.0 - decay) * _speeds(joints)
        self._updated_us = now_us
        return float(np.abs(self._speeds).max())

    def _stands(self, now_us: int, joints: JointLayer) -> bool:
        config, quaternion, position = self._config, joints.inertial.quaternion, joints.joints[0]
        return (
            self._fastest(now_us, joints) < config.stand_rad_s
            and tilt(quaternion) < config.upright_rad
            and float(np.abs(position - self._pose).max()) < config.pose_rad
            and self._clearance.sunk_share(position, quaternion) < 1.0 - config.height_share
        )


def _speeds(joints: JointLayer) -> np.ndarray:
    """Speeds of the joints and the base, rad/s, (n + 3,)."""
    return np.concatenate([joints.joints[1], joints.inertial.gyro])
