"""Interface of policies: hand-written controllers and learned ones."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from footfall.policies.contract import Contract
from footfall.robots.actuator import JointCommand
from footfall.robots.readings import Sensed

RATES_HZ = (1.0, 10_000.0)  # lowest and highest rate of a hand-written controller, and of the joint loop


class PolicyInput(NamedTuple):
    """Readings, command and estimate at a policy step."""

    time_s: float  # since the reset of the policy
    sensed: Sensed
    command: np.ndarray  # (3,) forward m/s, leftward m/s, yaw rad/s, body frame
    base_velocity: np.ndarray  # (3,) m/s, body frame: estimated; the true one in a study that provides it
    base_height: float  # m above the mean stance foot, estimated
    height_scan: np.ndarray | None = None  # (points,) m, see `HeightScan`; None without a recent scan


@runtime_checkable
class Policy(Protocol):
    """Computes joint commands. The loop calls `act` every 1/rate_hz s, at most once per joint tick."""

    name: str
    rate_hz: float
    needs_estimate: bool  # whether it uses base_velocity and base_height

    @property
    def contract(self) -> Contract | None:
        """Contract of a learned policy, checked against the robot; None for a hand-written controller."""

    @property
    def notes(self) -> Sequence[str]:
        """Deviations from the request with their reasons, one line each, without repetition. The list only
        grows."""

    def reset(self, inputs: PolicyInput) -> None:
        """Start an episode, from standing."""

    def act(self, inputs: PolicyInput) -> JointCommand:
        """Joint commands until the next call, arrays of shape (n,)."""
        ...

    def stance(self) -> np.ndarray | None:
        """Planned contact of each foot in [0, 1], shape (feet,); None without a plan."""


@runtime_checkable
class PlansFootholds(Protocol):
    """A policy that plans footholds."""

    def footholds(self) -> np.ndarray:
        """Planned footholds of swing feet, (feet, 3) m; NaN for stance feet.
        Relative to the base's origin, in its heading frame (x forward, z up), at the last step.
        """
        ...
