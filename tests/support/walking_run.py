"""Status of a walking run for command sources, and functions that wait for other threads."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from footfall.deploy.command_source import Offer, Pose, Request, Status
from footfall.deploy.modes import Mode
from footfall.operate.abilities import Abilities, Limits
from footfall.operate.inbox import Inbox
from footfall.policies.live_settings import Applied, Span
from footfall.robots.commands import CommandRange

OFFER = Offer(
    ("trot", "stand"),
    ("trot", "wave"),
    {"step_height_m": Span(0.02, 0.1, 0.05), "body_height_m": Span(0.2, 0.3, 0.28)},
)
WALKING = Status(
    *(0.0, 1.0, Mode.WALKING, "trot", np.zeros(3), np.zeros(3), 0.3, Pose(1.0, 2.0, 0.0), (), ("a",), OFFER),
    applied=Applied("wave", {"step_height_m": 0.05, "body_height_m": 0.25}),
)
LIMITS = Limits(CommandRange((-0.5, 1.0), (-0.3, 0.3), (-0.8, 0.8)), min_norm=0.1)


def abilities(policy: str) -> Abilities:
    """`stand` goes nowhere; every other policy walks within `LIMITS`."""
    if policy == "stand":
        return Abilities(Limits(CommandRange(*[(0.0, 0.0)] * 3)), OFFER._replace(gaits=(), settings={}))
    return Abilities(LIMITS, OFFER)


def polled_until(inbox: Inbox, holds: Callable[[Request], object]) -> Request:
    """Poll as a loop does until a request is as expected; fails after 30 s."""
    deadline_s = time.monotonic() + 30.0
    while not holds(request := inbox.poll(WALKING)):
        assert time.monotonic() < deadline_s, request
        time.sleep(0.005)
    return request


def eventually(found: Callable[[], Any], timeout_s: float = 30.0) -> Any:
    """The first true value of a repeatedly called function; its last value if there is none."""
    end_s = time.monotonic() + timeout_s
    while not (value := found()) and time.monotonic() < end_s:
        time.sleep(0.005)
    return value
