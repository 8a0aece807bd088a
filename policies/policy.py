"""The interface of everything that decides: hand-written controllers and learned policies alike."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from footfall.policies.contract import Contract
from footfall.robots.actuator import JointCommand
from footfall.robots.readings import Sensed


class PolicyInput(NamedTuple):
    """What a policy is handed at each of its steps."""

    time_s: float  # since the policy's reset
    sensed: Sensed
    command: np.ndarray  # (3,) forward m/s, leftward m/s, yaw rad/s, body frame
    base_velocity: np.ndarray  # (3,) m/s, body frame, estimated (or true, where a study asks for it)
    base_height: float  # m above the mean stance foot, estimated


@runtime_checkable
class Policy(Protocol):
    """Decides what the joints do. The loop calls `act` every 1/rate_hz s, at most at each joint tick."""

    name: str
    rate_hz: float
    needs_estimate: bool  # whether it reads base_velocity and base_height

    @property
    def contract(self) -> Contract | None:
        """What a learned policy was trained with and a robot must fit; None of a hand-written controller."""

    @property
    def notes(self) -> Sequence[str]:
        """What it did otherwise than asked, and why: one line each, said once. They only ever grow."""

    def reset(self, inputs: PolicyInput) -> None:
        """Begin an episode from standing."""

    def act(self, inputs: PolicyInput) -> JointCommand:
        """Joint commands until the next call, arrays of shape (n,)."""
        ...

    def stance(self) -> np.ndarray | None:
        """Planned contact of each foot in [0, 1], shape (feet,), or None where it has no plan."""
