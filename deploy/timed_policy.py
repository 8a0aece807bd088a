"""Runs a policy at its own rate."""

import math

import numpy as np
from numpy.ma import MaskedArray

from footfall.policies.policy import Policy, PolicyInput
from footfall.robots.actuator import JointCommand


class WrongSizeError(ValueError):
    """A policy's command has the wrong number of joints."""


class TimedPolicy:
    """A policy with the time of its next step and its last command. Times start at the beginning of
    walking."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.period_us = 1e6 / policy.rate_hz if policy.rate_hz > 0.0 else math.inf  # rejected later
        self.begin(0)

    def begin(self, now_us: int) -> None:
        """The policy takes over; it is reset before its first step."""
        self._began_us = now_us
        self._next_us = now_us - 0.5  # slightly early: rounding must not delay a step by a tick
        self.decision: np.ndarray | None = None  # (5, n), rows as of `JointCommand`

    def due(self, now_us: int) -> bool:
        """Whether the next step is due."""
        return now_us >= self._next_us

    def act(self, now_us: int, inputs: PolicyInput) -> np.ndarray:
        """Run a step of the policy; returns its command (5, n).

        Raises:
            ValueError: the command has masked entries or complex numbers.
            WrongSizeError: it has another shape.
        """
        if self._began_us:
            inputs = inputs._replace(time_s=(now_us - self._began_us) * 1e-6)
        if self.decision is None:
            self.policy.reset(inputs)
        self.decision = _copied(self.policy.act(inputs), len(inputs.sensed.joint_position))
        periods = math.ceil((now_us - self._next_us) / self.period_us)
        self._next_us += self.period_us * max(1, periods)
        return self.decision


def _copied(command: JointCommand, joints: int) -> np.ndarray:
    """A copy of a policy's command, (5, n)."""
    values = np.array(command)
    plain = set(map(type, command)) == {np.ndarray}  # one test takes a fraction of the time of five
    if values.dtype.kind == "c" or (not plain and any(map(_masked, command))):
        raise ValueError("its command has masked or complex numbers, expected real ones")
    values = values.astype(float, copy=False)
    if values.shape != (5, joints):
        raise WrongSizeError(f"its command has shape {values.shape}, expected (5, {joints})")
    return values


def _masked(row: np.ndarray) -> bool:
    return isinstance(row, MaskedArray) and np.ma.is_masked(row)
