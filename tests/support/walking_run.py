"""A run that walks, as a command source sees it, and waiting for what other threads do."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from footfall.deploy.command_source import Offer, Pose, Status
from footfall.deploy.modes import Mode
from footfall.operate.missions.limits import Abilities, Limits
from footfall.policies.live_settings import Span
from footfall.robots.commands import CommandRange

OFFER = Offer(("trot", "stand"), ("trot", "wave"), {"step_height_m": Span(0.02, 0.1, 0.05)})
WALKING = Status(
    0.0, 1.0, Mode.WALKING, "trot", np.zeros(3), np.zeros(3), 0.3, Pose(1.0, 2.0, 0.0), (), ("a",), OFFER
)


def abilities(policy: str) -> Abilities:
    """Of whichever policy: 1 m/s and 1 rad/s each way."""
    return Abilities(Limits(CommandRange((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))), OFFER)


def eventually(found: Callable[[], Any], patience_s: float = 5.0) -> Any:
    """The first true value of a function, which is called again and again; its last value if none is."""
    end_s = time.monotonic() + patience_s
    while not (value := found()) and time.monotonic() < end_s:
        time.sleep(0.005)
    return value
