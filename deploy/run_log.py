"""What the control loop writes to a log."""

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
    """Takes what happens in a run. Nothing here may block."""

    def tick(self, now_us: int, sensed: Sensed, motors: MotorHealth, commanded: np.ndarray | None) -> None:
        """Readings of a joint tick, and the command (5, n) that went out; None if none did."""

    def policy_step(self, now_us: int, inputs: PolicyInput, command: JointCommand, policy: Policy) -> None:
        """What the policies were given and what they decided; `policy` is the present one."""

    def change(self, now_us: int, change: Change) -> None:
        """What changes of the policy, its gait or its settings, from the policy step at this time on."""

    def applied(self, now_us: int, applied: Applied) -> None:
        """Gait and live settings that the present policy walks with, where they have changed."""

    def order(self, now_us: int, order: Order) -> None:
        """What somebody ordered the run to do."""

    def odometry(self, now_us: int, found: Odometry, footholds: np.ndarray | None = None) -> None:
        """The estimated motion of the base, and the footholds of a policy that plans them, (feet, 3) m."""

    def battery(self, now_us: int, battery: BatteryState) -> None:
        """The battery's state; nothing is known where none is declared."""

    def timing(self, now_us: int, work_us: float, lateness_us: float) -> None:
        """How long a tick's work took, and how late it began; by the wall clock alone."""

    def state(self, now_us: int, state: State) -> None:
        """A change of the supervisor's state."""

    def note(self, now_us: int, note: str) -> None:
        """What was changed of what was asked for."""
