"""Interface of the control loop to a log."""

from typing import Protocol

import numpy as np

from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.orders import Order
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.safety import State
from footfall.policies.live_settings import Applied
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand


class RunLog(Protocol):
    """Records the events of a run. No method may block."""

    def tick(self, now_us: int, sensed: Sensed, motors: MotorHealth, commanded: np.ndarray | None) -> None:
        """Record the readings of a joint tick, and the sent command (5, n); None if none was sent."""

    def policy_step(self, now_us: int, inputs: PolicyInput, command: JointCommand, policy: Policy) -> None:
        """Record inputs and decision of a policy step; `policy` is the current policy."""

    def change(self, now_us: int, change: Change) -> None:
        """Record changes of the policy, its gait or its settings, effective from this policy step on."""

    def applied(self, now_us: int, applied: Applied) -> None:
        """Record gait and live settings of the current policy after a change."""

    def order(self, now_us: int, order: Order) -> None:
        """Record an order to the run."""

    def odometry(self, now_us: int, odometry: Odometry, footholds: np.ndarray | None = None) -> None:
        """Record the estimated motion of the base, and the footholds of a policy that plans them, (feet, 3)
        m."""

    def battery(self, now_us: int, battery: BatteryState) -> None:
        """Record the battery's state, if robot.yaml has a battery."""

    def timing(self, now_us: int, work_us: float, lateness_us: float) -> None:
        """Record duration and lateness of a tick; only in real time."""

    def state(self, now_us: int, state: State) -> None:
        """Record a change of the supervisor's state."""

    def note(self, now_us: int, note: str) -> None:
        """Record a changed request."""
